"""Root mean square, mean, spread and largest of differences and parallaxes, next to their predictions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from adjust.arrays import Bools, Floats
from adjust.georeferencing.predicted_rms import PredictedRms, predicted_largest, predicted_rms
from adjust.georeferencing.relative_orientation import ELEMENTS
from tasks.files.json_text import JSON
from tasks.georeferencing.point_differences import PointDifferences
from tasks.georeferencing.stereo_models import ModelParallaxes

#: Probability with which a found root mean square lies between the limits of its prediction.
CONFIDENCE = 0.95
_UM = 1e6
#: Names of the parts of a predicted root mean square.
PARTS = ("image_points", "gnss_ins", "strips", "calibration", "survey", "shared")


def difference_figures(found: PointDifferences, chosen: Bools, *, with_limits: bool) -> dict[str, JSON]:
    """Figures of some of the intersections (q,), each with three numbers for east, north, up.

    Parameters
    ----------
    with_limits : whether the limits of the root mean square are wanted. They take every intersection for
        one of another point and of other image points; the models of a strip share both.
    """
    axes = [_axis_figures(found, chosen, axis, with_limits=with_limits) for axis in range(3)]
    figures: dict[str, JSON] = {name: [axis[name] for axis in axes] for name in axes[0]}
    parts = [_parts(found, chosen, axis) for axis in range(3)]
    figures["predicted_parts_m"] = {name: [part.get(name) for part in parts] for name in PARTS}
    return figures


def _axis_figures(found: PointDifferences, chosen: Bools, axis: int, *, with_limits: bool) -> dict[str, JSON]:
    """Figures of one coordinate; null without any point that has it."""
    rows = np.flatnonzero(chosen & np.isfinite(found.difference[:, axis]))
    names = ("rmse_m", "mean_m", "sd_m", "max_m", "rmse_gsd", "max_gsd")
    figures: dict[str, JSON] = dict.fromkeys(names)
    figures |= dict.fromkeys(("predicted_rmse_m", "predicted_low_m", "predicted_high_m"))
    figures |= {"points": len(rows), "predicted_mean_sigma_m": None, "degrees_of_freedom": None}
    if len(rows) == 0:
        return figures
    d = found.difference[rows, axis]
    in_gsd = d / found.gsd[rows]
    spread = float(np.std(d, ddof=1)) if len(d) > 1 else None
    values = (_rms(d), float(d.mean()), spread, _largest(d), _rms(in_gsd), _largest(in_gsd))
    figures |= dict(zip(names, values, strict=True))
    prediction = _prediction(found, rows, axis)
    figures["predicted_rmse_m"] = prediction.rms
    if with_limits:
        low, high = prediction.limits(CONFIDENCE)
        figures |= {
            "predicted_low_m": low,
            "predicted_high_m": high,
            "predicted_mean_sigma_m": prediction.sigma_of_mean,
            "degrees_of_freedom": prediction.degrees_of_freedom,
        }
    return figures


def _prediction(found: PointDifferences, rows: np.ndarray, axis: int) -> PredictedRms:
    return predicted_rms(found.errors.sensitivity.only(3 * rows + axis), found.own_variance[rows, axis])


def _parts(found: PointDifferences, chosen: Bools, axis: int) -> dict[str, JSON]:
    """Root mean squares that each source alone would cause, metres.

    ``shared``: what the calibration has in common with the others adds to their squares, or takes from them
    with the sign minus.
    """
    rows = np.flatnonzero(chosen & np.isfinite(found.difference[:, axis]))
    if len(rows) == 0:
        return {}
    answering = found.errors.sensitivity.only(3 * rows + axis)
    variances = (
        found.by_image_points[rows, axis],
        answering.variance_by_images(),
        answering.variance_by_strips(),
        answering.variance_by_calibration(),
        found.survey_variance[rows, axis],
    )
    parts: dict[str, JSON] = {
        name: float(np.sqrt(v.mean())) for name, v in zip(PARTS, variances, strict=False)
    }
    shared = float(answering.shared_variance().mean())
    return parts | {"shared": float(np.copysign(np.sqrt(abs(shared)), shared))}


def parallax_figures(found: ModelParallaxes) -> dict[str, JSON]:
    """Figures of the y-parallaxes of all models, µm; null without any."""
    rows = np.flatnonzero(found.used)
    names = ("rms", "max", "predicted_rms", "predicted_low", "predicted_high", "predicted_max")
    figures: dict[str, JSON] = {f"y_parallax_{name}_um": None for name in (*names, "predicted_max_limit")}
    figures |= {"y_parallax_remaining_sigma_um": None, "y_parallax_image_sigma_um": None}
    counts: Mapping[str, int] = {
        "y_parallax_models": len(np.unique(found.rays.common.model[rows])),
        "y_parallaxes": len(rows),
        "y_parallax_mismatches": int((~found.used).sum()),
    }
    figures |= counts
    if len(rows) == 0:
        return figures
    parallax = found.parallaxes.parallax[rows] * _UM
    own = found.parallaxes.by_image_points[rows]
    answering = found.parallaxes.sensitivity.only(rows)
    prediction, largest = predicted_rms(answering, own), predicted_largest(answering, own)
    low, high = prediction.limits(CONFIDENCE)
    values = (_rms(parallax), _largest(parallax), *(_UM * v for v in (prediction.rms, low, high)))
    figures |= {f"y_parallax_{name}_um": v for name, v in zip(names, values, strict=False)}
    figures["y_parallax_predicted_max_um"] = largest.median * _UM
    figures["y_parallax_predicted_max_limit_um"] = largest.limit * _UM
    figures["y_parallax_remaining_sigma_um"] = _remaining_sigma_um(found)
    figures["y_parallax_image_sigma_um"] = float(np.sqrt(own.mean())) * _UM
    return figures


def _remaining_sigma_um(found: ModelParallaxes) -> float | None:
    """Standard deviation of a parallax after the relative orientations, from their common redundancy."""
    rows = np.flatnonzero(found.used & np.isfinite(found.relative.residual))
    redundancy = len(rows) - ELEMENTS * len(np.unique(found.rays.common.model[rows]))
    if redundancy <= 0:
        return None
    return float(np.sqrt(np.sum(found.relative.residual[rows] ** 2) / redundancy)) * _UM


def _rms(values: Floats) -> float:
    """Root mean square, not centred."""
    return float(np.sqrt(np.mean(values**2)))


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values)))
