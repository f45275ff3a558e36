"""The figures of the adjustment's notes that the report shows, with their types.

``summary.json`` allows fields beyond its contract; here stands what the report expects of them. A figure that
is missing is None or empty, and the report says "none".
"""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import BaseModel, ConfigDict


class _Figure(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")


class GroupFigure(_Figure):
    """An observation group; ``sigma0`` is null without redundancy."""

    group: str
    observations: int
    redundancy: float | None = None
    sigma0: float | None = None
    rejected: int = 0
    uncontrolled: int = 0


class GlobalTestFigure(_Figure):
    """Limits of σ0 at a confidence level, and whether it keeps them; limits are null without redundancy."""

    lower: float | None = None
    upper: float | None = None
    confidence: float
    passed: bool


class DatumFigure(_Figure):
    """A direction of the datum: its σ (m, rad or relative; null if nothing holds it) and who holds it."""

    direction: str
    sigma: float | None = None
    held_by: Mapping[str, float] = {}


class AdjustmentFigures(_Figure):
    """Figures of the adjustment beyond the contract of summary.json."""

    groups: tuple[GroupFigure, ...] = ()
    global_test: GlobalTestFigure | None = None
    datum: tuple[DatumFigure, ...] = ()
    image_rms_px: tuple[float | None, ...] | None = None
    critical_value: float | None = None
    rejected_per_pass: tuple[int, ...] = ()
    sigma_scaled_by: float | None = None
    frame: str = ""


_WORDS = {
    "image_points": "image points",
    "control_points": "control points",
    "gnss_positions": "GNSS positions",
    "ins_attitudes": "INS attitudes",
}


def group_words(name: str) -> str:
    """The name of an observation group for people."""
    plain = _WORDS.get(name, name.replace("_", " ").replace("gnss", "GNSS"))
    return plain.replace("prior:", "priors: ")


_GATE_WORDS = {
    "sigma0": "σ0",
    "rmse_control_m": "RMS at control points",
    "rmse_check_m": "RMS at check points",
    "max_check_m": "largest difference at check points",
}


def gate_words(name: str) -> str:
    """The name of a limit for people; one of a component ends with its axis."""
    for known, words in _GATE_WORDS.items():
        if name == known:
            return words
        if name.startswith(f"{known}_"):
            return f"{words}, {name.removeprefix(known).lstrip('_')}"
    return name.replace("_", " ")
