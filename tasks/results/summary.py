"""summary.json: the figures of a run for programs, the same fields for every outcome.

The stages leave figures in their notes; here they are put together with the gates and timings.
Missing figures are null, never 0 or NaN. Fields beyond those of the contract are allowed:
everything the adjustment reports is passed on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal, TypeAlias, cast

from pydantic import BaseModel

from tasks.files.json_text import JSON, finite, read_json, replace_json
from tasks.results.quality_gates import GateResult, tested_gates
from tasks.settings.quality import Gates
from tasks.store.notes import Notes

CONTRACT_VERSION = 1
SUMMARY = "summary.json"

Status: TypeAlias = Literal["done", "gate_failed", "input_error", "not_computable"]


class Counts(BaseModel, frozen=True, extra="allow"):
    """Numbers of entities; null for what was not counted."""

    images: int | None = None
    object_points: int | None = None
    image_points: int | None = None
    rejected: int | None = None
    control: int | None = None
    check: int | None = None


class ParameterFigure(BaseModel, frozen=True, extra="allow"):
    """A system parameter as in parameters.parquet."""

    parameter: str
    entity: str | None = None
    value: float | None = None
    change: float | None = None
    sigma: float | None = None
    unit: str | None = None
    status: str | None = None


class CheckPointTest(BaseModel, frozen=True, extra="allow"):
    """RMS and mean at check points next to what their σ let expect; east, north, up, null without a point.

    ``ratio`` is the found over the predicted RMS, ``over_limit`` the largest figure over its upper limit.
    """

    points: tuple[int, ...]
    rmse_m: tuple[float | None, ...]
    predicted_rmse_m: tuple[float | None, ...]
    predicted_low_m: tuple[float | None, ...]
    predicted_high_m: tuple[float | None, ...]
    ratio: tuple[float | None, ...]
    degrees_of_freedom: tuple[float | None, ...]
    mean_m: tuple[float | None, ...]
    mean_limit_m: tuple[float | None, ...]
    confidence: float
    over_limit: float

    @property
    def passed(self) -> bool:
        """Whether no figure is above its limit."""
        return self.over_limit <= 1.0


class DistanceFigures(BaseModel, frozen=True, extra="allow"):
    """Distances between object points after the adjustment; null where there are none of a kind."""

    used: int
    rejected: int
    check: int
    rms_used_m: float | None
    rms_check_m: float | None
    max_check_m: float | None
    confidence: float
    over_limit: float | None


class DirectGeoreferencing(BaseModel, frozen=True, extra="allow"):
    """Figures of the direct-georeferencing check.

    ``rmse_m`` and ``max_m`` at the independent check points; null without any.
    """

    rmse_m: tuple[float | None, ...] | None = None
    max_m: tuple[float | None, ...] | None = None
    y_parallax_max_um: float | None = None


class DeliveryFigure(BaseModel, frozen=True, extra="allow"):
    """A delivery of the project: its folder below that of the results, and its largest misfit.

    ``misfit_px`` is null where it could not be made for another reason, which is in ``problems``.
    """

    format: str
    folder: str
    world: str
    misfit_px: float | None
    written: bool


class Summary(BaseModel, frozen=True, extra="allow"):
    """The content of summary.json.

    Three numbers stand for x, y, z (metres). ``sigma0`` is a posteriori / a priori; ``sigma0_um`` and
    ``sigma0_px`` are sigma0 times the a-priori standard deviation of the reference image observation.
    """

    contract_version: int = CONTRACT_VERSION
    status: Status
    sigma0: float | None = None
    sigma0_um: float | None = None
    sigma0_px: float | None = None
    redundancy: float | None = None
    iterations: int | None = None
    counts: Counts = Counts()
    rmse_control_m: tuple[float | None, ...] | None = None
    max_control_m: tuple[float | None, ...] | None = None
    rmse_check_m: tuple[float | None, ...] | None = None
    max_check_m: tuple[float | None, ...] | None = None
    check_point_test: CheckPointTest | None = None
    distances: DistanceFigures | None = None
    parameters: tuple[ParameterFigure, ...] | None = None
    direct_georeferencing: DirectGeoreferencing | None = None
    deliveries: tuple[DeliveryFigure, ...] = ()
    gates: tuple[GateResult, ...] = ()
    timings_s: Mapping[str, float] = {}
    problems: tuple[str, ...] = ()

    @property
    def missed_checks(self) -> str | None:
        """Independent checks beyond their limits, in words; None: none."""
        points, distances = self.check_point_test, self.distances
        beyond = (
            points is not None and not points.passed,
            distances is not None and (distances.over_limit or 0.0) > 1.0,
        )
        named = [words for words, is_beyond in zip(("points", "distances"), beyond, strict=True) if is_beyond]
        return f"check {' and '.join(named)}" if named else None

    def to_json(self) -> Mapping[str, JSON]:
        """The summary as it is written: JSON without NaN."""
        return cast(Mapping[str, JSON], finite(cast(JSON, self.model_dump(mode="json"))))


def summary_of(notes: Sequence[Notes], gates: Gates, timings_s: Mapping[str, float]) -> Summary:
    """Put the notes of all stages together (a later stage's figure counts) and test the gates.

    Problems are in the order of the stages, after the reasons against the result as a whole: what judges it
    runs last, and states what follows from the findings of the stages before. What is a reason is not said
    again.
    """
    figures = merged_figures(notes)
    results, untested = tested_gates(gates, figures)
    reasons = [sentence for note in notes for sentence in note.reasons]
    found = (sentence for note in notes for sentence in note.problems)
    others = (one for one in found if not any(reason.endswith(f": {one}") for reason in reasons))
    problems = (*reasons, *untested, *others)
    content: dict[str, object] = {
        **figures,
        "status": "done" if all(result.passed for result in results) else "gate_failed",
        "gates": results,
        "timings_s": timings_s,
        "problems": tuple(dict.fromkeys(problems)),
    }
    return Summary.model_validate(content)


def merged_figures(notes: Sequence[Notes]) -> dict[str, JSON]:
    """The figures of all stages; a later stage's counts."""
    figures: dict[str, JSON] = {}
    for note in notes:
        figures = _merged(figures, note.figures)
    return figures


def summary_of_figures(figures: Mapping[str, JSON]) -> Summary:
    """The fields of the contract among the figures of a stage; gates and timings are not known yet."""
    return Summary.model_validate({**figures, "status": "done"})


def failed_summary(
    status: Literal["input_error", "not_computable"], problems: Sequence[str], timings_s: Mapping[str, float]
) -> Summary:
    """The summary of a run without a result: first of all why there is none; null for everything else."""
    return Summary(status=status, timings_s=timings_s, problems=tuple(problems))


def write_summary(directory: Path, summary: Summary) -> None:
    """Write summary.json into the output folder, replacing the last one at once."""
    replace_json(directory / SUMMARY, summary.to_json())


def read_summary(directory: Path) -> Summary:
    """Read the summary of the last run.

    Raises
    ------
    FileNotFoundError, ValueError
        If there is none, or the file is not a summary.
    """
    return Summary.model_validate(read_json(directory / SUMMARY))


def _merged(old: Mapping[str, JSON], new: Mapping[str, JSON]) -> dict[str, JSON]:
    """`old` with the figures of `new`; tables of figures (counts) are merged, everything else replaced."""
    merged = dict(old)
    for name, value in new.items():
        before = merged.get(name)
        both = isinstance(before, Mapping) and isinstance(value, Mapping)
        merged[name] = (
            _merged(cast(Mapping[str, JSON], before), cast(Mapping[str, JSON], value)) if both else value
        )
    return merged
