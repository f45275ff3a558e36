"""A line of the production page: the latest run of a story on a project; and the trend of the figures.

Prefect shows runs and knows neither projects nor their figures, limits and documents.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

from tasks.production.run_record import NO_AXES, PUBLISHING, RunFigures, RunRecord, StageTime
from tasks.production.stage_states import StageState, stage_states

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
    run : the run.
    stages : state of each stage the story has come to or will come to, in order.
    runs : runs of this story on this project file.
    documents : files of the output folder that this run wrote; empty if a later run has replaced them.
    """

    run: RunRecord
    stages: Mapping[str, StageState]
    runs: int
    documents: tuple[str, ...]

    @property
    def key(self) -> str:
        """The same for every run of this story on this project file."""
        return key_of(self.run)

    @property
    def failed_gates(self) -> tuple[str, ...]:
        """Names of the failed gates."""
        return tuple(gate.name for gate in self.run.figures.gates if not gate.passed)

    @property
    def changed(self) -> datetime:
        """Time of the last change of its state."""
        return self.run.ended or self.run.begun or self.run.scheduled

    @property
    def seconds(self) -> float | None:
        """Duration, s; None: it has not ended, or did not begin."""
        if self.run.begun is None or self.run.ended is None:
            return None
        return max((self.run.ended - self.run.begun).total_seconds(), 0.0)

    @property
    def problem(self) -> str | None:
        """The sentence to be read first; None: there is nothing to say."""
        if self.run.state == "Running" and self.run.attempts > 1:
            return f"Attempt {self.run.attempts}; completed stages are reused."
        return next(iter(problems_of(self.run)), None)

    def limit(self, gate: str) -> float | None:
        """The largest value that passes a gate; None: it was not tested."""
        gates = self.run.figures.gates
        return next((one.limit for one in gates if one.name == gate and one.bound == "max"), None)


def project_row(run: RunRecord, *, runs: int, has_results: bool, done: Sequence[StageTime]) -> ProjectRow:
    """The row of a project from its latest run.

    Parameters
    ----------
    runs : how many there are.
    has_results : whether the output folder holds what this run has published.
    done : stages that have ended.
    """
    wrote = {one.stage for one in run.stages}
    written = tuple(document for stage, document in DOCUMENTS.items() if stage in wrote)
    return ProjectRow(run, stage_states(run, done), runs, written if has_results else ())


def key_of(run: RunRecord) -> str:
    """The same text for every run of a story on a project file, and for no other."""
    told = "\0".join((run.project_file, run.project, run.story))
    return hashlib.sha256(told.encode("utf-8", "surrogatepass")).hexdigest()[:24]


def problems_of(run: RunRecord) -> tuple[str, ...]:
    """The problems and remarks of a run in order; files of the project by their names."""
    said = run.figures.problems
    if run.state not in PUBLISHING and run.message:
        said = tuple(dict.fromkeys((run.message, *said)))
    return tuple(in_project(run, sentence) for sentence in said)


def in_project(run: RunRecord, sentence: str) -> str:
    """A sentence on a project with the project's folder left out of paths."""
    folder = run.project_file.rpartition("/")[0]
    return sentence.replace(f"{folder}/", "") if folder else sentence


def with_figures(rows: Sequence[ProjectRow], most: int = 300) -> tuple[ProjectRow, ...]:
    """The rows with σ0 or check points, the latest ones, in the order of time."""
    ended = [row for row in rows if row.run.ended is not None and _has_figures(row.run.figures)]
    return tuple(sorted(ended, key=lambda row: (row.changed, row.key))[-most:])


def _has_figures(figures: RunFigures) -> bool:
    return figures.sigma0 is not None or figures.rmse_check_m != NO_AXES
