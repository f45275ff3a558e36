"""Quality gates: the figures of a result against the limits of the project file.

Gates that are not in the project file are not tested. A gate whose figure does not exist (for example,
without check points) has failed, and a sentence says why. A gate of a part that the run does not have (an
adjustment, a direct-georeferencing check) is left to the run that has it, which is also stated.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

from pydantic import BaseModel

from tasks.files.json_text import JSON
from tasks.settings.quality import TRUST_MAP_GATES, AxisGate, Gate, Gates

_AXES = ("x", "y", "z")
#: The figure that a direct-georeferencing check leaves, and its parts by their gates.
DIRECT = "direct_georeferencing"
_DIRECT_FIGURES = {
    "direct_georeferencing_rmse_m": "rmse_m",
    "direct_georeferencing_max_m": "max_m",
    "y_parallax_rms_um": "y_parallax_rms_um",
    "y_parallax_max_um": "y_parallax_max_um",
}
#: Figures of a system calibration and of one in two steps alone; limits are tested whatever the gates are.
_TWO_STEP_ONLY = "two_step_calibration"
_CALIBRATIONS = ("calibration", _TWO_STEP_ONLY)
#: The figure that every adjustment has, if only as null.
_ADJUSTMENT = "sigma0"


class GateResult(BaseModel, frozen=True):
    """One tested limit.

    Attributes
    ----------
    name : the figure, with ``_x``, ``_y``, ``_z`` for the component of one that has three.
    value, limit : the figure (null: it does not exist) and its limit, in `unit`.
    unit : ``m``, ``um``, ``px``, or ``1`` for a ratio.
    bound : whether `limit` is the largest or the smallest value that passes.
    passed : whether the figure exists and meets the limit.
    """

    name: str
    value: float | None
    limit: float
    unit: str
    bound: Literal["max", "min"] = "max"
    passed: bool

    @property
    def words(self) -> tuple[str, str]:
        """Value and limit as numbers, the value with digits that tell on which side of its limit it is."""
        text, limit = "none", f"{self.limit:.15g}"
        for digits in range(4, 18) if self.value is not None else ():
            text = f"{self.value:.{digits}g}"
            shown = float(text)
            if self.passed == (shown <= self.limit if self.bound == "max" else shown >= self.limit):
                break
        return text, limit


def tested_gates(gates: Gates, figures: Mapping[str, JSON]) -> tuple[tuple[GateResult, ...], tuple[str, ...]]:
    """Test all gates of a project.

    Returns
    -------
    results : one for each limit, in the order of the project file's keys.
    untested : a sentence for each gate whose figure does not exist.
    """
    results: list[GateResult] = []
    sentences: list[str] = []
    for name in type(gates).model_fields:
        gate = getattr(gates, name)
        if gate is None:
            continue
        if not _belongs_to_run(name, figures):
            part = "direct-georeferencing check" if name in _DIRECT_FIGURES else "adjustment"
            sentences.append(f"The gate {name} is not tested: this run contains no {part}.")
            continue
        tested = tuple(_results(name, gate, _figure(name, figures)))
        results += tested
        if any(result.value is None for result in tested):
            sentences.append(f"The gate {name} counts as failed: {_why_untested(name, figures)}.")
    return (*results, *_of_calibration(figures)), tuple(sentences)


def _of_calibration(figures: Mapping[str, JSON]) -> Iterator[GateResult]:
    """The limits of a calibration flight together: all must be met."""
    for name in _CALIBRATIONS:
        calibration = figures.get(name)
        if isinstance(calibration, Mapping) and isinstance(calibration.get("reasons"), Sequence):
            missed = float(len(calibration["reasons"]))  # type: ignore[arg-type]
            yield _tested("missed_limits_of_calibration", missed, 0.0, "1", "max")


def _belongs_to_run(name: str, figures: Mapping[str, JSON]) -> bool:
    """Whether the run has the part that a gate concerns; a run without known parts has them all."""
    parts = {DIRECT: DIRECT in figures, _ADJUSTMENT: _ADJUSTMENT in figures}
    known = any(parts.values()) or _TWO_STEP_ONLY in figures
    return parts[DIRECT if name in _DIRECT_FIGURES else _ADJUSTMENT] or not known


def _why_untested(name: str, figures: Mapping[str, JSON]) -> str:
    found = figures.get("trust_map") if name in TRUST_MAP_GATES else None
    if not isinstance(found, Mapping):
        return "this run has no such figure to test"
    share, unmapped, uncontrolled = (
        _number(found[key]) or 0.0 for key in ("share", "unmapped", "uncontrolled")
    )
    reasons = []
    if unmapped:
        reasons.append(f"{100.0 * unmapped:.1f} % of the area is not mapped")
    if uncontrolled and name == "trust_map_external_m":
        reasons.append(
            f"{100.0 * uncontrolled:.1f} % of the mapped cells have new image coordinates without control, "
            "as two rays always do"
        )
    rest = f"{100.0 * (1.0 - share):.1f} % of the area"
    return f"its value is unlimited on more than {rest} ({'; '.join(reasons)})"


def _figure(name: str, figures: Mapping[str, JSON]) -> JSON:
    if name not in _DIRECT_FIGURES:
        return figures.get(name)
    direct = figures.get(DIRECT)
    return direct.get(_DIRECT_FIGURES[name]) if isinstance(direct, Mapping) else None


def _results(name: str, gate: Gate | AxisGate, figure: JSON) -> Iterator[GateResult]:
    if isinstance(gate, Gate):
        value, unit = _number(figure), next((unit for unit in ("um", "m") if name.endswith(f"_{unit}")), "1")
        if gate.max is not None:
            yield _tested(name, value, gate.max, unit, "max")
        if gate.min is not None:
            yield _tested(name, value, gate.min, unit, "min")
        return
    components = (
        figure if isinstance(figure, Sequence) and not isinstance(figure, str) else (None, None, None)
    )
    for axis, component, limit in zip(_AXES, components, gate.max, strict=True):
        yield _tested(f"{name}_{axis}", _number(component), limit, "m", "max")


def _tested(
    name: str, value: float | None, limit: float, unit: str, bound: Literal["max", "min"]
) -> GateResult:
    kept = value is not None and (value <= limit if bound == "max" else value >= limit)
    return GateResult(name=name, value=value, limit=limit, unit=unit, bound=bound, passed=kept)


def _number(figure: JSON) -> float | None:
    return float(figure) if isinstance(figure, int | float) and not isinstance(figure, bool) else None
