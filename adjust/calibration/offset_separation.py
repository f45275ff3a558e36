"""Whether the strips require a lever arm, GNSS shift or boresight, by flight and mounting: nested tests.

The offsets are those that the given lever arm leaves: a lever arm here is a correction of the given one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.calibration.adjusted_strips import StripErrors
from adjust.calibration.orientation_differences import SHIFT
from adjust.calibration.strip_means import StripMeans
from adjust.calibration.strip_offsets import (
    NestedTest,
    body_fixed,
    linear_fit,
    map_fixed,
    membership,
    nested_test,
    without,
)

Verdict: TypeAlias = Literal["body", "map", "both", "neither", "undecided"]
#: Probability of calling for a lever arm that is not there; and the same for a shift.
SEPARATION_PROBABILITY = 0.025
_ANGLES = ("roll", "pitch", "yaw")


@dataclass(frozen=True, slots=True, eq=False)
class OffsetSeparation:
    """What the offsets of the main mounting consist of.

    Attributes
    ----------
    verdict : ``body``: of a lever arm; ``map``: of a shift; ``both``; ``neither``: there is no offset;
        ``undecided``: there is one, and it cannot be determined which.
    tests : by what is tested: ``offset`` (anything at all), ``lever_arm`` (next to a shift), ``shift``
        (next to a lever arm), ``shift_by_flight``, ``lever_arm_by_flight`` and ``lever_arm_by_mounting``
        (next to a shift of each flight), ``roll_by_flight`` … ``yaw_by_mounting``.
    lever_arm, shift : (2,) forward, right and east, north, metres, estimated together. Where flights have
        shifts that differ, the shift is the mean of those of all strips. NaN where the headings do not
        separate them.
    lever_arm_sigma, shift_sigma : (2,) their standard deviations; differences between flights count as
        scatter in that of the shift.
    freedom : degrees of freedom of that of the lever arm.
    """

    verdict: Verdict
    tests: Mapping[str, NestedTest]
    lever_arm: Floats
    lever_arm_sigma: Floats
    shift: Floats
    shift_sigma: Floats
    freedom: int


def separated_offset(
    strips: StripMeans, mounting: Ints, error_probability: float, errors: StripErrors | None = None
) -> OffsetSeparation:
    """Test the strips (k,) of the main mounting, and the mountings against each other.

    Parameters
    ----------
    error_probability : of finding that the shift differs from flight to flight when it does not.
    errors : of the adjusted orientations of the strips; None: not known.
    """
    main = mounting == 0
    heading, flight = strips.heading[main], strips.flight[main]
    one = np.zeros(int(main.sum()), dtype=np.int64)
    offset = strips.mean[main, SHIFT][:, :2].ravel()
    shift, lever_arm = map_fixed(one), body_fixed(heading, one)
    shifts = map_fixed(flight)
    both = np.hstack([shift, lever_arm])
    known = None if errors is None else errors.only(main).in_plan()
    by_flight = nested_test(both, np.hstack([shifts, lever_arm]), offset, known)
    # A shift of each flight where they differ: else it would pass for scatter.
    used = shifts if by_flight.probability < error_probability else shift
    together = np.hstack([used, lever_arm])
    tests = {
        "offset": nested_test(without(both), together, offset, known),
        "lever_arm": nested_test(used, together, offset, known),
        "shift": nested_test(lever_arm, together, offset, known),
        "shift_by_flight": by_flight,
        "lever_arm_by_flight": nested_test(
            np.hstack([shifts, lever_arm]), np.hstack([shifts, body_fixed(heading, flight)]), offset, known
        ),
        "lever_arm_by_mounting": _by_mounting(strips, mounting, errors),
    }
    tests |= {f"{name}_by_flight": test for name, test in _of_angles(strips, main, strips.flight, errors)}
    every = np.ones_like(main)
    tests |= {f"{name}_by_mounting": test for name, test in _of_angles(strips, every, mounting, errors)}
    fit, alike = linear_fit(together, offset), linear_fit(both, offset)
    found = fit.solution[-2:]
    left = (offset - lever_arm @ found).reshape(-1, 2).mean(axis=0)
    sigma = np.sqrt(np.diagonal(fit.covariance(together, known)))[-2:]
    # The scatter about one shift has in it how flights differ.
    of_shift = np.sqrt(np.diagonal(alike.covariance(both, known)))[:2]
    if fit.freedom > len(offset) - together.shape[1]:
        found = sigma = left = of_shift = np.full(2, np.nan)
    return OffsetSeparation(_verdict(tests), tests, found, sigma, left, of_shift, fit.freedom)


def _of_angles(
    strips: StripMeans, chosen: Bools, group: Ints, errors: StripErrors | None
) -> Iterator[tuple[str, NestedTest]]:
    """Roll, pitch and yaw of the chosen strips (k,): one for each group against one for all."""
    one, own = membership(0 * group[chosen]), membership(group[chosen])
    for axis, name in enumerate(_ANGLES):
        known = None if errors is None else errors.only(chosen).covariance[:, axis, :, axis]
        yield name, nested_test(one, own, strips.mean[chosen, axis], known)


def _by_mounting(strips: StripMeans, mounting: Ints, errors: StripErrors | None) -> NestedTest:
    offset = strips.mean[:, SHIFT][:, :2].ravel()
    shifts = map_fixed(strips.flight)
    common = np.hstack([shifts, body_fixed(strips.heading, 0 * mounting)])
    known = None if errors is None else errors.in_plan()
    return nested_test(common, np.hstack([shifts, body_fixed(strips.heading, mounting)]), offset, known)


def _verdict(tests: Mapping[str, NestedTest]) -> Verdict:
    significant = {
        name: tests[name].probability < SEPARATION_PROBABILITY for name in ("offset", "lever_arm", "shift")
    }
    separable = tests["lever_arm"].testable and tests["shift"].testable
    if not separable:
        # Shifts that differ from flight to flight say nothing about a lever arm in addition.
        return "neither" if tests["offset"].testable and not significant["offset"] else "undecided"
    if significant["lever_arm"] and significant["shift"]:
        return "both"
    if significant["lever_arm"]:
        return "body"
    if significant["shift"]:
        return "map"
    return "undecided" if significant["offset"] else "neither"
