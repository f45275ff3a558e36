"""Hypotheses about a delivery: what it would be if common mistakes had been made, singly or combined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adjust.arrays import Floats, Ints
from tasks.block.given_orientations import AngleOrder, GivenOrientations
from tasks.deliveries.exposure_angles import RADIANS_PER_UNIT
from tasks.plausibility.orientation_slips import (
    UNITS,
    Slip,
    of_given,
    other_order,
    other_unit,
    usual_slips,
)
from tasks.settings.coordinates import Angles

_THESE = ("inputs.exposures.angles.unit", "inputs.exposures.angles.order")


def of_orientations(given: GivenOrientations, angles: Sequence[Angles]) -> list[Slip]:
    """Mistakes that make the rays of tie points miss each other.

    Parameters
    ----------
    angles : as the inputs of exposures declare them; empty: not known here.
    """
    by_declared = _THESE if angles else ()
    found = [slip for slip in usual_slips(given) if not slip.declare.startswith(by_declared)]
    units, orders = {one.unit for one in angles}, {one.order for one in angles}
    if len(units) == 1:
        declared = units.pop()
        found += [
            other_unit(unit, words, RADIANS_PER_UNIT[unit] / RADIANS_PER_UNIT[declared])
            for unit, words, _ in UNITS
            if unit != declared
        ]
    if orders & {"omega-phi-kappa", "phi-omega-kappa"} and len(orders) == 1:
        order: AngleOrder = "omega-phi-kappa" if "phi-omega-kappa" in orders else "phi-omega-kappa"
        found.append(other_order(order, f'Declare angles.order = "{order}" for the exposures.'))
    found.append(
        of_given(
            "x and y of the exposures look swapped",
            "x is east and y is north in every input: exchange the two columns.",
            lambda g: replace(g, observed=_exchanged(g.observed)),
            'inputs.exposures.columns = { x = "y", y = "x" }',
        )
    )
    found += [_shifted(step) for step in (1, -1)]
    references = {one.reference for one in angles}
    line = f'inputs.exposures.angles.reference = "{references.pop()}"' if len(references) == 1 else None
    return [slip for slip in found if slip.declare != line]


def _exchanged(observed: Floats) -> Floats:
    """Positions (n, 3) with east and north exchanged about their mean."""
    mean = observed.mean(axis=0)
    return np.asarray((observed - mean)[:, [1, 0, 2]] + mean)


def _shifted(step: int) -> Slip:
    def corrected(given: GivenOrientations) -> GivenOrientations:
        return with_orientations_of(given, np.roll(np.arange(len(given.image)), -step))

    neighbour = "next" if step > 0 else "previous"
    return of_given(
        f"The exposures look shifted by one image: each has what belongs to its {neighbour} one",
        f"Give each image the position and angles of its {neighbour} one in the exposures, or correct the "
        "names of the images.",
        corrected,
    )


def with_orientations_of(given: GivenOrientations, source: Ints) -> GivenOrientations:
    """Images that have the positions and angles of other rows (n,)."""
    names = ("observed", "x_in_map", "local_from_grid", "local_from_enu", "angles", "is_heading", "time_s")
    return replace(given, **{name: getattr(given, name)[source] for name in names})
