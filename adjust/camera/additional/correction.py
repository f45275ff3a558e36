"""Measured image points from ideal ones and back, for given values of additional parameters.

    x_id + D(x_id) = x̄ + Δ(x̄)        D of forward sets, Δ of all others

Each side is inverted by iteration. Δ changes by micrometres over centimetres, so each step of the fixed point
x̄ ← x_id + D − Δ(x̄) shrinks the distance to the solution to some 1e-4 of it; where Δ is a tenth of the image
and steps swing to and fro, half of each is taken. D may be a tenth of the image and is inverted by Newton's
method. At a seam where Δ jumps there may be no measured point, or two.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.camera.additional.evaluation import total_correction
from adjust.camera.additional.forward import Distortion, undistorted
from adjust.camera.additional.register import AdditionalParameters

_MOST_STEPS = 30
_SETTLED = 1e-15  # metres, the rounding of coordinates of 0.1 m is 1e-17


def correction(
    parameters: AdditionalParameters, values: Floats, xy: Floats, offset: Floats | None = None
) -> Floats:
    """Ideal − measured (n, 2) of the parameter values (k,) at measured points (n, 2), metres.

    With forward sets where the distortion is not invertible: some point near.

    Parameters
    ----------
    offset : (n, 2) metres, added to the image points whatever Δ is; None for nothing.
    """
    added = np.zeros_like(xy) if offset is None else offset
    forward = parameters.forward
    if not forward.any():
        return total_correction(parameters, xy, values) + added
    c = parameters.image_format.needed_focal_length
    target = xy + added + total_correction(parameters.only("correction"), xy, values[~forward])
    direction, _ = undistorted(Distortion.of(parameters), target / c, values[forward])
    return c * direction - xy


def ideal_from_measured(
    parameters: AdditionalParameters, values: Floats, measured: Floats, offset: Floats | None = None
) -> Floats:
    """Ideal points (n, 2) of measured ones (n, 2), metres from the principal point; offset as above."""
    return measured + correction(parameters, values, measured, offset)


def measured_from_ideal(
    parameters: AdditionalParameters,
    values: Floats,
    ideal: Floats,
    offset_at: Callable[[Floats], Floats] | None = None,
) -> tuple[Floats, Bools]:
    """Measured points (n, 2) of ideal ones (n, 2), metres, and whether each was found (n,).

    Not found are points at seams that have none, and everything where values are so large that the iteration
    does not contract.

    Parameters
    ----------
    offset_at : offset (m, 2) that was added at measured points (m, 2), both as above; None for nothing.
    """
    target = ideal + distortion_at(parameters, values, ideal)
    corrections, own = parameters.only("correction"), values[~parameters.forward]

    def following(rows: Ints, before: Floats) -> Floats:
        found = target[rows] - total_correction(corrections, before, own)
        return found if offset_at is None else found - offset_at(before)

    measured, found = _iterated(following, target, np.arange(len(ideal)), 1.0)
    rows = np.flatnonzero(~found)
    if len(rows):
        # Half a step contracts where whole ones swing to and fro, as with a strong barrel distortion.
        damped, settled = _iterated(following, target[rows], rows, 0.5)
        measured[rows[settled]], found[rows[settled]] = damped[settled], True
    return measured, found


def _iterated(
    following: Callable[[Ints, Floats], Floats], start: Floats, rows: Ints, part: float
) -> tuple[Floats, Bools]:
    """Points (n, 2) after steps of this part of the way, and whether each has settled (n,)."""
    points, settled = start.copy(), np.zeros(len(start), dtype=bool)
    for _ in range(round(_MOST_STEPS / part)):
        left = np.flatnonzero(~settled)
        before = points[left]
        # What runs away is not found.
        with np.errstate(over="ignore", invalid="ignore"):
            after = following(rows[left], before)
        points[left] = after if part == 1.0 else before + part * (after - before)
        settled[left] = np.abs(after - before).max(axis=1, initial=0.0) < _SETTLED
        if settled.all():
            break
    return points, settled


def distortion_at(parameters: AdditionalParameters, values: Floats, ideal: Floats) -> Floats:
    """D (n, 2) of the forward sets at ideal points (n, 2), metres; zero without any."""
    forward = parameters.forward
    if not forward.any():
        return np.zeros_like(ideal)
    c = parameters.image_format.needed_focal_length
    return c * total_correction(Distortion.of(parameters), ideal / c, values[forward])


def is_invertible(parameters: AdditionalParameters, values: Floats, measured: Floats) -> Bools:
    """(n,) whether each measured point (n, 2) has one ideal point, as far as forward sets go."""
    forward = parameters.forward
    if not forward.any():
        return np.ones(len(measured), dtype=bool)
    c = parameters.image_format.needed_focal_length
    return undistorted(Distortion.of(parameters), measured / c, values[forward])[1]
