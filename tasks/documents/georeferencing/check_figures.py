"""Figures of a check of direct georeferencing, as summary.json and the tables of its page have them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from pydantic import BaseModel

from tasks.results.figures import StatementFigure
from tasks.results.summary import ParameterFigure

#: East, north, up; null where there is no point.
Triple: TypeAlias = tuple[float | None, float | None, float | None]
NONE: Triple = (None, None, None)


class _Figure(BaseModel, frozen=True, extra="ignore"):
    """Figures to which later versions may add."""


class DifferenceFigures(_Figure):
    """Differences at some points and their prediction, east, north, up; metres."""

    points: Triple = NONE
    rmse_m: Triple = NONE
    mean_m: Triple = NONE
    sd_m: Triple = NONE
    max_m: Triple = NONE
    rmse_gsd: Triple = NONE
    max_gsd: Triple = NONE
    predicted_rmse_m: Triple = NONE
    predicted_low_m: Triple = NONE
    predicted_high_m: Triple = NONE
    predicted_mean_sigma_m: Triple = NONE
    degrees_of_freedom: Triple = NONE
    predicted_parts_m: Mapping[str, Triple] = {}

    @property
    def count(self) -> int:
        """Number of points; the largest of the three."""
        return int(max((value or 0.0) for value in self.points))


class CheckFigures(DifferenceFigures):
    """Figures of a check: the differences at independent points, at others, in models, and the parallaxes."""

    at_control_of_calibration: DifferenceFigures = DifferenceFigures()
    in_models: DifferenceFigures = DifferenceFigures()
    gsd_m: float | None = None
    statements: tuple[StatementFigure, ...] = ()
    calibration: tuple[ParameterFigure, ...] = ()
    y_parallaxes: int = 0
    y_parallax_models: int = 0
    y_parallax_mismatches: int = 0
    y_parallax_rms_um: float | None = None
    y_parallax_max_um: float | None = None
    y_parallax_predicted_rms_um: float | None = None
    y_parallax_predicted_low_um: float | None = None
    y_parallax_predicted_high_um: float | None = None
    y_parallax_predicted_max_um: float | None = None
    y_parallax_predicted_max_limit_um: float | None = None
    y_parallax_remaining_sigma_um: float | None = None
    y_parallax_image_sigma_um: float | None = None
