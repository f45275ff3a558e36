"""Measured image points from ideal ones and back, for given values of additional parameters.

    x_id = x̄ + Δ(x̄)            ideal from measured
    x̄ ← x_id − Δ(x̄)            measured from ideal: a fixed point

As Δ changes by micrometres over centimetres, each step of the second shrinks the distance to the solution to
some 1e-4 of it. At a seam where Δ jumps there may be no measured point, or two.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Bools, Floats
from adjust.camera.additional.evaluation import total_correction
from adjust.camera.additional.register import AdditionalParameters

_MOST_STEPS = 30
_SETTLED = 1e-15  # metres, the rounding of coordinates of 0.1 m is 1e-17


def correction(parameters: AdditionalParameters, values: Floats, xy: Floats) -> Floats:
    """Correction Δ (n, 2) of the parameter values (k,) at measured points (n, 2), metres."""
    return total_correction(parameters, xy, values)


def ideal_from_measured(parameters: AdditionalParameters, values: Floats, measured: Floats) -> Floats:
    """Ideal points (n, 2) of measured ones (n, 2), metres from the principal point."""
    return measured + correction(parameters, values, measured)


def measured_from_ideal(
    parameters: AdditionalParameters, values: Floats, ideal: Floats
) -> tuple[Floats, Bools]:
    """Measured points (n, 2) of ideal ones (n, 2), metres, and whether each was found (n,).

    Not found are points at seams that have none, and everything where values are so large that the iteration
    does not contract.
    """
    measured = ideal - correction(parameters, values, ideal)
    found = np.zeros(len(ideal), dtype=bool)
    for _ in range(_MOST_STEPS):
        following = ideal - correction(parameters, values, measured)
        found = np.abs(following - measured).max(axis=1, initial=0.0) < _SETTLED
        measured = following
        if found.all():
            break
    return measured, found
