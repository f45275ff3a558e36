"""Gross errors among y-parallaxes, distinguished from errors of the orientation.

Wrong orientations give the parallaxes of a model a smooth form, that of the five elements of the relative
orientation; a point that was mismatched does not follow it. So the elements are estimated in every model,
and what is left over,

    p_y = a₁ dx₁ + … + a₅ dx₅ + v,

is an error of the image coordinates alone. Residuals are tested with their own redundancy numbers and the
largest of each model is taken out, until none is left that should not be there (Baarda 1968).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.georeferencing.y_parallax import YParallaxes

#: Elements of a relative orientation.
ELEMENTS = 5
# With fewer points above the five elements an error cannot be separated from the others.
_LEAST_REDUNDANCY = 3
_UNCONTROLLED = 0.1
_MOST_ROUNDS = 50


@dataclass(frozen=True, eq=False)
class RelativeOrientation:
    """What the relative orientations of the models leave of the parallaxes.

    Attributes
    ----------
    residual : (q,) v, metres; NaN in models with too few points to estimate one.
    is_gross_error : (q,) whether the point does not follow its model.
    scale : by how much the residuals exceed the standard deviations of the image coordinates, at least 1;
        the test takes it into account.
    """

    residual: Floats
    is_gross_error: Bools
    scale: float


def relative_orientation(parallaxes: YParallaxes, critical_value: float) -> RelativeOrientation:
    """Estimate the relative orientation of every model and test each parallax against it.

    Parameters
    ----------
    critical_value : of the standardized residual |v|/(s σ √r), with the scale s.
    """
    model = parallaxes.common.model
    sigma = np.sqrt(parallaxes.by_image_points)
    design = parallaxes.of_relative_orientation / sigma[:, None]
    observed = parallaxes.parallax / sigma
    models = int(model.max(initial=-1)) + 1
    tested = (np.bincount(model, minlength=models) >= ELEMENTS + _LEAST_REDUNDANCY)[model]
    used = tested.copy()
    scale = 1.0
    for _ in range(_MOST_ROUNDS):
        residual, redundancy = _residuals(design, observed, model, models, used)
        controlled = used & (redundancy > _UNCONTROLLED)
        size = np.where(controlled, np.abs(residual) / np.sqrt(np.maximum(redundancy, _UNCONTROLLED)), 0.0)
        scale = max(1.0, _robust_scale(size[controlled]))
        worst = _largest_of_each(size, model, models)
        worst = worst[size[worst] > critical_value * scale]
        if len(worst) == 0:
            break
        used[worst] = False
    enough = (np.bincount(model[used], minlength=models) >= ELEMENTS + 1)[model]
    return RelativeOrientation(np.where(tested & enough, residual * sigma, np.nan), tested & ~used, scale)


def _residuals(
    design: Floats, observed: Floats, model: Ints, models: int, used: Bools
) -> tuple[Floats, Floats]:
    """Whitened residuals (q,) of the least-squares fit in each model, and redundancy numbers (q,)."""
    normal, right = np.zeros((models, ELEMENTS, ELEMENTS)), np.zeros((models, ELEMENTS))
    own, rows = model[used], design[used]
    np.add.at(normal, own, rows[:, :, None] * rows[:, None, :])
    np.add.at(right, own, rows * observed[used, None])
    diagonal = np.sqrt(np.maximum(np.diagonal(normal, axis1=1, axis2=2), 1e-300))
    scaled = normal / (diagonal[:, :, None] * diagonal[:, None, :])
    # Points on one line do not determine all five elements; the inverse then leaves the rest at zero.
    inverse = np.linalg.pinv(scaled, rcond=1e-10, hermitian=True)
    cofactor = inverse / (diagonal[:, :, None] * diagonal[:, None, :])
    solution = np.einsum("mij,mj->mi", cofactor, right)
    hat = np.einsum("qi,qij,qj->q", design, cofactor[model], design)
    return observed - np.sum(design * solution[model], axis=1), 1.0 - hat


def _robust_scale(size: Floats) -> float:
    """Standard deviation of values that should be normal, from the median of their sizes (n,)."""
    return float(1.4826 * np.median(size)) if len(size) else 1.0


def _largest_of_each(size: Floats, model: Ints, models: int) -> Ints:
    """Index of the largest value of each model that has one above zero."""
    largest = np.zeros(models)
    np.maximum.at(largest, model, size)
    candidates = np.flatnonzero((size > 0.0) & (size == largest[model]))
    _, first = np.unique(model[candidates], return_index=True)
    return np.asarray(candidates[first], dtype=np.int64)
