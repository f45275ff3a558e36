"""Positions of another point than declared: the antenna, or the camera a moment earlier.

Rays of forward and reverse strips then miss each other by twice the distance on the ground.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Bools, Floats
from tasks.block.given_orientations import GivenOrientations
from tasks.block.strip_motion import strip_motion
from tasks.plausibility.diagnosis import TieMisses
from tasks.plausibility.misalignment import fitted
from tasks.plausibility.mistake import Mistake
from tasks.plausibility.orientation_slips import Delivered

_MARGIN = 3.0
# A vector this much along the flight is as well a time offset.
_ALONG = 0.9


@dataclass(frozen=True, eq=False)
class DeclaredPositions:
    """Declarations of the project file on the positions.

    Attributes
    ----------
    reduced : (n,) whether they are declared to be projection centres.
    free : the parameters that are to be estimated; what is estimated is not a mistake.
    """

    reduced: Bools
    free: frozenset[str]


def moved_positions(
    delivered: Delivered, misses: TieMisses, declared: DeclaredPositions, suspicious_px: float
) -> list[Mistake]:
    """The mistake that explains the remaining misses, if there is one."""
    now = misses.of(delivered)
    if now <= suspicious_px:
        return []
    trials: list[tuple[float, Mistake]] = []
    given = delivered.given
    arms = given.mountings.lever_arm[given.camera]
    if arms.any():
        trials.append(_other_point(delivered, misses, declared, arms))
    elif "lever_arm" not in declared.free:
        trials += _fitted_arm(delivered, misses)
    if "time_offset" not in declared.free:
        trials += _fitted_time(delivered, misses)
    trials = sorted(trials, key=lambda trial: trial[0])
    if not trials or trials[0][0] * _MARGIN > now:
        return []
    evidence = tuple(f"{left:.1f} px: {mistake.evidence[0]}" for left, mistake in trials)
    return [replace(trials[0][1], evidence=(*evidence, f"{now:.1f} px: as declared"))]


def with_boresight(delivered: Delivered, misses: TieMisses, suspicious_px: float) -> Delivered:
    """With the misalignment of the cameras that makes the misses least, where it is estimated anyway."""
    if misses.of(delivered) <= suspicious_px:
        return delivered
    shape = delivered.given.mountings.boresight.shape

    def turned(angles: Floats) -> Delivered:
        given = delivered.given
        boresight = given.mountings.boresight + angles.reshape(shape)
        return replace(
            delivered, given=replace(given, mountings=replace(given.mountings, boresight=boresight))
        )

    return turned(_fitted(misses, turned, int(np.prod(shape)), 1e-3)[0])


def _other_point(
    delivered: Delivered, misses: TieMisses, declared: DeclaredPositions, arms: Floats
) -> tuple[float, Mistake]:
    """With the declared lever arm applied the other way: antenna for projection centre, or the reverse."""
    shift = np.einsum("nij,nj->ni", delivered.given.local_from_body(delivered.order), arms)
    # A projection centre is carried to the antenna by the import; taking that back is the antenna itself.
    moved = np.where(declared.reduced[:, None], -shift, shift)
    left = misses.of(_moved(delivered, moved))
    if declared.reduced.mean() > 0.5:
        what = "The positions look like those of the antenna, and are declared to be projection centres."
        kind = "antenna"
    else:
        what = "The positions look like projection centres, and are declared to be those of the antenna."
        kind = "projection_centre"
    return left, Mistake(
        what,
        (f"positions of the {kind.replace('_', ' ')}",),
        f'Declare position = "{kind}" for the exposures.',
        f'inputs.exposures.position = "{kind}"',
    )


def _fitted_arm(delivered: Delivered, misses: TieMisses) -> list[tuple[float, Mistake]]:
    """A lever arm that nobody declared."""
    body = delivered.given.local_from_body(delivered.order)

    # The height is carried by all points alike: only forward and right can be told without control.
    def at_camera(arm: Floats) -> Delivered:
        return _moved(delivered, -np.einsum("nij,j->ni", body, np.array([*arm, 0.0])))

    arm, left = _fitted(misses, at_camera, 2, 1.0)
    if np.abs(arm[0]) > _ALONG * np.linalg.norm(arm) and np.isfinite(delivered.given.time_s).all():
        return []
    text = f"({arm[0]:+z.2f}, {arm[1]:+z.2f}) m forward, right"
    names = delivered.given.mountings.names
    return [
        (
            left,
            Mistake(
                f"The positions look like those of a point {text} of the camera, such as the antenna.",
                (f"a lever arm of {text}",),
                'Declare position = "antenna" for the exposures, and lever_arm_m of the camera.',
                f"cameras.{names[0]}.lever_arm_m = [{arm[0]:.2f}, {arm[1]:.2f}, 0.0]",
            ),
        )
    ]


def _fitted_time(delivered: Delivered, misses: TieMisses) -> list[tuple[float, Mistake]]:
    """Exposures earlier or later than their positions."""
    velocity = velocities(delivered.given)
    if velocity is None:
        return []
    offset, left = _fitted(misses, lambda v: _moved(delivered, v[0] * velocity), 1, 0.02)
    return [
        (
            left,
            Mistake(
                f"The times of the exposures look {1e3 * abs(offset[0]):.0f} ms "
                f"{'early' if offset[0] > 0.0 else 'late'}: all positions are displaced along the flight "
                "direction.",
                (f"a time offset of {offset[0]:+z.3f} s",),
                "Correct the times of the events, or estimate the offset.",
                'adjustment.free = [..., "time_offset"]',
            ),
        )
    ]


def velocities(given: GivenOrientations) -> Floats | None:
    """Velocity (n, 3) of each image, m/s: as delivered, else from its neighbours in the strip.

    None where some have neither: no velocity, and no times or strips.
    """
    if np.isfinite(given.velocity).all():
        return given.velocity
    seen = np.bincount(given.strip_of_image)
    if not np.isfinite(given.time_s).all() or not all(given.strips) or seen.min() < 2:
        return None
    return strip_motion(given).velocity


def _moved(delivered: Delivered, shift: Floats) -> Delivered:
    return replace(delivered, given=replace(delivered.given, observed=delivered.given.observed + shift))


def _fitted(
    misses: TieMisses, with_values: Callable[[Floats], Delivered], unknowns: int, unit: float
) -> tuple[Floats, float]:
    """The unknowns that make the misses least, and what they leave, px."""
    blunt = float(np.clip(misses.of(with_values(np.zeros(unknowns))), 1.0, 1e4))
    values = fitted(lambda tried: misses.residuals(with_values(tried)), unknowns, blunt, unit)
    return values, misses.of(with_values(values))
