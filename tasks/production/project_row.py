"""A line of the production page: the latest run of a story on a project; and the trend of the figures.

Prefect shows runs and knows neither projects nor their figures, limits and documents.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import TypeAlias

from pydantic import ValidationError

from tasks.files.json_text import JSON
from tasks.production.run_record import RunRecord, StageTime, State
from tasks.production.stage_states import StageState, stage_states
from tasks.results.quality_gates import GateResult

#: x, y, z; None where there is no figure.
Axes: TypeAlias = tuple[float | None, float | None, float | None]

#: Document of an output folder, by the stage that writes it.
DOCUMENTS: Mapping[str, str] = {
    "report": "report.html",
    "certificate": "certificate.html",
    "georeferencing_page": "georeferencing_check.html",
    "sweep_page": "sweep.html",
    "image_quality_page": "image_quality.html",
    "radiometric_certificate": "radiometric_certificate.html",
}


@dataclass(frozen=True)
class ProjectRow:
    """The latest run of a story on a project.

    Attributes
    ----------
    key : the same for every run of this story on this project file.
    run : id of the run.
    project, project_file, directory, story, state, message : as of `RunRecord`.
    stages : state of each stage the story has come to or will come to, in order.
    scheduled, begun, ended : UTC.
    attempts : how often it was started.
    sigma0 : a posteriori / a priori.
    rmse_check_m : of the check points.
    trust_map_m : σ of new points in plan and height over the area, by the trust map; None without one.
    gates : the limits that were tested.
    problem : the sentence to be read first; None: there is nothing to say.
    runs : runs of this story on this project file.
    documents : files of the output folder that this run wrote; empty if a later run has replaced them.
    """

    key: str
    run: str
    project: str
    project_file: str
    directory: str
    story: str
    state: State
    message: str
    stages: Mapping[str, StageState]
    scheduled: datetime
    begun: datetime | None
    ended: datetime | None
    attempts: int
    sigma0: float | None
    rmse_check_m: Axes
    trust_map_m: tuple[float | None, float | None]
    gates: tuple[GateResult, ...]
    problem: str | None
    runs: int
    documents: tuple[str, ...]

    @property
    def failed_gates(self) -> tuple[str, ...]:
        """Names of the failed gates."""
        return tuple(gate.name for gate in self.gates if not gate.passed)

    @property
    def changed(self) -> datetime:
        """Time of the last change of its state."""
        return self.ended or self.begun or self.scheduled

    @property
    def seconds(self) -> float | None:
        """Duration, s; None: it has not ended, or did not begin."""
        if self.begun is None or self.ended is None:
            return None
        return max((self.ended - self.begun).total_seconds(), 0.0)

    def limit(self, gate: str) -> float | None:
        """The largest value that passes a gate; None: it was not tested."""
        return next((one.limit for one in self.gates if one.name == gate and one.bound == "max"), None)


def project_row(
    run: RunRecord, *, runs: int, has_results: bool, done: Sequence[StageTime] | None = None
) -> ProjectRow:
    """The row of a project from its latest run.

    Parameters
    ----------
    runs : how many there are.
    has_results : whether the output folder holds what this run has published.
    done : stages that have ended, if the record does not know them yet.
    """
    summary = run.summary or {}
    wrote = {one.stage for one in run.stages}
    written = tuple(document for stage, document in DOCUMENTS.items() if stage in wrote)
    return ProjectRow(
        key_of(run),
        run.id,
        run.project,
        run.project_file,
        run.directory,
        run.story,
        run.state,
        run.message,
        stage_states(run, run.stages if done is None else done),
        run.scheduled,
        run.begun,
        run.ended,
        run.attempts,
        _number(summary.get("sigma0")),
        _axes(summary.get("rmse_check_m")),
        (_number(summary.get("trust_map_plan_m")), _number(summary.get("trust_map_height_m"))),
        gates_of(summary),
        _problem(run),
        runs,
        written if has_results else (),
    )


def key_of(run: RunRecord) -> str:
    """The same text for every run of a story on a project file, and for no other."""
    told = "\0".join((run.project_file, run.project, run.story))
    return hashlib.sha256(told.encode("utf-8", "surrogatepass")).hexdigest()[:24]


def gates_of(summary: Mapping[str, JSON]) -> tuple[GateResult, ...]:
    """The tested limits in a summary; those unknown to this version are left out."""
    found = []
    listed = summary.get("gates")
    for gate in listed if isinstance(listed, Sequence) and not isinstance(listed, str) else ():
        try:
            found.append(GateResult.model_validate(gate))
        except ValidationError:
            continue
    return tuple(found)


def problems_of(run: RunRecord) -> tuple[str, ...]:
    """The problems and remarks of a run in order; files of the project by their names."""
    return tuple(in_project(run, sentence) for sentence in _said(run))


def in_project(run: RunRecord, sentence: str) -> str:
    """A sentence on a project with the project's folder left out of paths."""
    folder = run.project_file.rpartition("/")[0]
    return sentence.replace(f"{folder}/", "") if folder else sentence


def _said(run: RunRecord) -> tuple[str, ...]:
    listed = (run.summary or {}).get("problems")
    said = tuple(map(str, listed)) if isinstance(listed, Sequence) and not isinstance(listed, str) else ()
    if run.state in ("Completed", "GateFailed"):
        return said
    return tuple(dict.fromkeys((run.message, *said))) if run.message else said


def _problem(run: RunRecord) -> str | None:
    if run.state == "Running" and run.attempts > 1:
        return f"Attempt {run.attempts}; completed stages are reused."
    return next(iter(problems_of(run)), None)


def _axes(figure: JSON) -> Axes:
    if isinstance(figure, Sequence) and not isinstance(figure, str) and len(figure) == 3:
        x, y, z = map(_number, figure)
        return x, y, z
    return None, None, None


def _number(figure: JSON) -> float | None:
    return float(figure) if isinstance(figure, int | float) and not isinstance(figure, bool) else None


_AXIS_NAMES = ("x", "y", "z")


@dataclass(frozen=True)
class TrendPoint:
    """The figures of one project.

    Attributes
    ----------
    run, project, story : whose they are.
    ended : when they were computed, UTC.
    passed : whether all gates were.
    sigma0, sigma0_limit : a posteriori / a priori, and the largest value its gate lets pass.
    rmse_check_m, rmse_limit_m : of the check points, and the largest values their gate lets pass.
    """

    run: str
    project: str
    story: str
    ended: datetime
    passed: bool
    sigma0: float | None
    sigma0_limit: float | None
    rmse_check_m: Axes
    rmse_limit_m: Axes


def trend_of(rows: Sequence[ProjectRow], most: int = 300) -> tuple[TrendPoint, ...]:
    """The figures of those projects that have any, the latest ones, in the order of time."""
    ended = [
        row for row in rows if row.ended is not None and (row.sigma0 is not None or any_of(row.rmse_check_m))
    ]
    latest = sorted(ended, key=lambda row: (row.changed, row.key))[-most:]
    return tuple(map(_point, latest))


def any_of(figures: Axes) -> bool:
    """Whether there is any figure."""
    return any(figure is not None for figure in figures)


def _point(row: ProjectRow) -> TrendPoint:
    x, y, z = (row.limit(f"rmse_check_m_{axis}") for axis in _AXIS_NAMES)
    return TrendPoint(
        row.run,
        row.project,
        row.story,
        row.changed,
        row.state == "Completed",
        row.sigma0,
        row.limit("sigma0"),
        row.rmse_check_m,
        (x, y, z),
    )
