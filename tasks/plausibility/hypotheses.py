"""Hypotheses about a delivery: what it would be if common mistakes had been made, singly or combined."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.observations.image_point import ImagePoints
from adjust.parameters import State
from tasks.block.given_orientations import AngleOrder, GivenOrientations
from tasks.deliveries.exposure_angles import RADIANS_PER_UNIT
from tasks.plausibility.orientation_slips import OTHER_ORDER, Slip, usual_slips, with_omega_first
from tasks.settings.coordinates import Angles

_WORDS = {"gon": "gon", "deg": "degrees", "rad": "radians"}
_THESE = ("exposures.angles.unit", "exposures.angles.order")


@dataclass(frozen=True, eq=False)
class Delivered:
    """Orientations and image points as a hypothesis reads them.

    Attributes
    ----------
    given, rays : exposures and image points of a sample of points.
    order : how ω, φ, κ are read.
    turn : (3, 3) or (n, 3, 3), applied to the cameras last.
    """

    given: GivenOrientations
    rays: ImagePoints
    order: AngleOrder
    turn: Floats

    def state(self, state: State) -> State:
        """The state with these orientations."""
        centre, local_from_camera = self.given.orientations(self.order)
        return replace(state, projection_centre=centre, local_from_camera=local_from_camera @ self.turn)


@dataclass(frozen=True)
class Hypothesis:
    """One mistake that may have been made.

    Attributes
    ----------
    what : what the delivery looks like.
    remedy : what to do.
    declare : the line of the project file; empty: the files must be corrected.
    corrected : the delivery without the mistake.
    kind : hypotheses of one kind are different ways to have made the same mistake.
    """

    what: str
    remedy: str
    declare: str
    corrected: Callable[[Delivered], Delivered]
    kind: str = ""


def of_orientations(given: GivenOrientations, angles: Sequence[Angles]) -> list[Hypothesis]:
    """Mistakes that make the rays of tie points miss each other.

    Parameters
    ----------
    angles : as the inputs of exposures declare them; empty: not known here.
    """
    by_declared = _THESE if angles else ()
    found = [_of_slip(slip) for slip in usual_slips(given) if not slip.declare.startswith(by_declared)]
    units, orders = {one.unit for one in angles}, {one.order for one in angles}
    if len(units) == 1:
        found += _units(units.pop())
    if orders & {"omega-phi-kappa", "phi-omega-kappa"} and len(orders) == 1:
        found.append(_other_order("phi-omega-kappa" in orders))
    found.append(
        Hypothesis(
            "x and y of the exposures look swapped",
            "x is east and y is north in every input: exchange the two columns.",
            'inputs.exposures.columns = { x = "y", y = "x" }',
            lambda d: replace(d, given=replace(d.given, observed=_exchanged(d.given.observed))),
        )
    )
    found += [_shifted(step) for step in (1, -1)]
    references = {one.reference for one in angles}
    declared = f'inputs.exposures.angles.reference = "{references.pop()}"' if len(references) == 1 else None
    return [hypothesis for hypothesis in found if hypothesis.declare != declared]


def _of_slip(slip: Slip) -> Hypothesis:
    def corrected(delivered: Delivered) -> Delivered:
        given, rays, order, turn = slip.corrected(delivered.given, delivered.rays)
        other = order if order != "omega-phi-kappa" else delivered.order
        return Delivered(given, rays, other, delivered.turn @ turn)

    declare = f"inputs.{slip.declare}" if slip.declare else ""
    return Hypothesis(slip.looks_like, slip.remedy, declare, corrected, slip.kind)


def _units(declared: str) -> list[Hypothesis]:
    """The other units of angles, whatever the declared one is."""
    result = []
    for unit, words in _WORDS.items():
        factor = RADIANS_PER_UNIT[unit] / RADIANS_PER_UNIT[declared]
        if unit != declared:
            result.append(
                Hypothesis(
                    f"The angles look like {words}",
                    f'Declare angles.unit = "{unit}" for the exposures.',
                    f'inputs.exposures.angles.unit = "{unit}"',
                    lambda d, factor=factor: replace(  # type: ignore[misc]
                        d, given=replace(d.given, angles=d.given.angles * factor)
                    ),
                )
            )
    return result


def _other_order(is_phi_first: bool) -> Hypothesis:
    """ω, φ, κ declared as φ, ω, κ, which the import has turned into ω, φ, κ, or the reverse."""
    order = "omega-phi-kappa" if is_phi_first else "phi-omega-kappa"

    def corrected(delivered: Delivered) -> Delivered:
        if not is_phi_first:
            return replace(delivered, order="phi-omega-kappa")
        return replace(delivered, given=with_omega_first(delivered.given))

    return Hypothesis(
        OTHER_ORDER,
        f'Declare angles.order = "{order}" for the exposures.',
        f'inputs.exposures.angles.order = "{order}"',
        corrected,
    )


def _exchanged(observed: Floats) -> Floats:
    """Positions (n, 3) with east and north exchanged about their mean."""
    mean = observed.mean(axis=0)
    return np.asarray((observed - mean)[:, [1, 0, 2]] + mean)


def _shifted(step: int) -> Hypothesis:
    def corrected(delivered: Delivered) -> Delivered:
        source = np.roll(np.arange(len(delivered.given.image)), -step)
        return replace(delivered, given=with_orientations_of(delivered.given, source))

    neighbour = "next" if step > 0 else "previous"
    return Hypothesis(
        f"The exposures look shifted by one image: each has what belongs to its {neighbour} one",
        f"Give each image the position and angles of its {neighbour} one in the exposures, or correct the "
        "names of the images.",
        "",
        corrected,
    )


def with_orientations_of(given: GivenOrientations, source: Ints) -> GivenOrientations:
    """Images that have the positions and angles of other rows (n,)."""
    names = ("observed", "x_in_map", "local_from_grid", "local_from_enu", "angles", "is_heading", "time_s")
    return replace(given, **{name: getattr(given, name)[source] for name in names})
