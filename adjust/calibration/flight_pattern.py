"""Flight directions and flying heights of a block, recognised from its exposures.

What a flight can tell apart depends on them: opposite or crossing directions separate what is fixed in the
camera from what is fixed in the map, two heights what grows with the height from what does not. They come
from the orientations themselves, never from what somebody declared about the lines.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.calibration.strip_means import direction_groups, height_groups
from adjust.errors import InconsistentBlockError

# Headings of one direction lie within this angle, radians; heights of one level within this ratio.
_WIDEST_DIRECTION, _WIDEST_LEVEL = np.deg2rad(60.0), 1.5
# Directions that differ by more than this from the reverse of each other cross, radians.
_OPPOSITE = np.deg2rad(30.0)
# Exposures of a strip whose heading differs from the others' and which are fewer than this part of it are no
# direction of their own: a turn, or a wrong angle.
_LEAST_PART = 0.15


@dataclass(frozen=True, slots=True, eq=False)
class FlightPattern:
    """Directions and heights of a flight; d directions, h heights.

    Attributes
    ----------
    directions : (d,) mean headings, radians, 0 … 2π, ascending.
    heights : (h,) median heights above ground, metres, ascending.
    images : (d, h) number of exposures of each direction at each height.
    strips : (d, h) number of strips of each.
    """

    directions: Floats
    heights: Floats
    images: Ints
    strips: Ints

    @property
    def height_ratio(self) -> float:
        """Highest over lowest flying height; 1 with one."""
        return float(self.heights[-1] / self.heights[0])

    @property
    def opposite(self) -> tuple[tuple[int, int], ...]:
        """Pairs of directions that are the reverse of each other."""
        return tuple(pair for pair in self._pairs if self._is_opposite(*pair))

    @property
    def crossing(self) -> tuple[tuple[int, int], ...]:
        """Pairs of directions that are neither the same nor opposite."""
        return tuple(pair for pair in self._pairs if not self._is_opposite(*pair))

    @property
    def _pairs(self) -> Iterable[tuple[int, int]]:
        return ((a, b) for b in range(len(self.directions)) for a in range(b))

    def _is_opposite(self, a: int, b: int) -> bool:
        return bool(np.cos(self.directions[a] - self.directions[b]) < -np.cos(_OPPOSITE))


def flight_pattern(heading: Floats, height: Floats, strip: Ints) -> FlightPattern:
    """Directions and heights of n exposures.

    A strip counts as a whole, with the median of its headings (so a crab angle of an exposure, or its
    deviation, does not matter) and of its heights (nor does relief below it). What is called a strip but
    was flown in several directions is none; its exposures count singly.

    Parameters
    ----------
    heading : (n,) radians, clockwise from north (or from the y axis of the local frame).
    height : (n,) above ground, metres.
    strip : (n,) number of the strip.

    Raises
    ------
    InconsistentBlockError
        If there is no exposure, or a heading or height is not finite or a height not positive.
    """
    if len(heading) == 0:
        raise InconsistentBlockError("No flight direction could be recognised from the exposures.")
    if not (np.isfinite(heading).all() and np.isfinite(height).all() and np.all(height > 0.0)):
        raise InconsistentBlockError("A heading or a height above ground is missing or not positive.")
    units = [unit for number in np.unique(strip) for unit in _units(heading, np.flatnonzero(strip == number))]
    mean = np.array([_middle(heading[unit]) for unit in units])
    level = np.array([np.median(height[unit]) for unit in units])
    count = np.array([len(unit) for unit in units])
    direction = _numbered(_narrow(mean, direction_groups(mean), _too_wide, _cut_direction))
    of_height = _narrow(level, height_groups(level), _too_high, _cut_level)
    directions = np.array([_middle(mean[direction == k]) for k in range(direction.max() + 1)]) % (2 * np.pi)
    heights = np.array([np.median(level[of_height == k]) for k in range(of_height.max() + 1)])
    by_heading, by_height = np.argsort(directions, kind="stable"), np.argsort(heights, kind="stable")
    images = np.zeros((len(directions), len(heights)), dtype=np.int64)
    strips = np.zeros_like(images)
    np.add.at(images, (direction, of_height), count)
    np.add.at(strips, (direction, of_height), 1)
    chosen = np.ix_(by_heading, by_height)
    return FlightPattern(directions[by_heading], heights[by_height], images[chosen], strips[chosen])


def _units(heading: Floats, rows: Ints) -> list[Ints]:
    """The exposures of a strip that count together: all of them, or each by itself."""
    group = direction_groups(heading[rows])
    count = np.bincount(group)
    main = np.flatnonzero(count >= _LEAST_PART * len(rows))
    if len(main) == 1:
        return [rows[group == main[0]]]
    return [rows[k : k + 1] for k in range(len(rows))]


def _middle(heading: Floats) -> float:
    """Median direction: the median of the deviations from the mean direction, which it is added to."""
    mean = np.arctan2(np.sin(heading).mean(), np.cos(heading).mean())
    return float(mean + np.median(_between(heading - mean)))


def _between(angle: Floats) -> Floats:
    """Angles turned to −π … π."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def _narrow(
    values: Floats, group: Ints, is_too_wide: Callable[[Floats], bool], cut: Callable[[Floats], Bools]
) -> Ints:
    """Groups (k,) cut at their widest gap until none is too wide: many small gaps can make a full circle."""
    group = group.copy()
    waiting = list(range(int(group.max()) + 1))
    while waiting:
        rows = np.flatnonzero(group == waiting.pop())
        if not is_too_wide(values[rows]):
            continue
        number = int(group.max()) + 1
        waiting += [int(group[rows[0]]), number]
        group[rows[cut(values[rows])]] = number
    return group


def _too_wide(heading: Floats) -> bool:
    turned = np.sort(heading % (2.0 * np.pi))
    gap = np.diff(turned, append=turned[0] + 2.0 * np.pi)
    return bool(2.0 * np.pi - gap.max() > _WIDEST_DIRECTION)


def _cut_direction(heading: Floats) -> Bools:
    """The half of the headings after the widest gap but one; the widest is the group's own border."""
    order = np.argsort(heading % (2.0 * np.pi), kind="stable")
    turned = heading[order] % (2.0 * np.pi)
    gap = np.diff(turned, append=turned[0] + 2.0 * np.pi)
    border = int(np.argmax(gap))
    # Start after the border, so that the group is one row of ascending angles.
    order = np.roll(order, -(border + 1))
    inner = np.roll(gap, -(border + 1))[:-1]
    return _from(order, int(np.argmax(inner)) + 1)


def _too_high(height: Floats) -> bool:
    return bool(height.max() > _WIDEST_LEVEL * height.min())


def _cut_level(height: Floats) -> Bools:
    order = np.argsort(height, kind="stable")
    return _from(order, int(np.argmax(np.diff(np.log(height[order])))) + 1)


def _from(order: Ints, first: int) -> Bools:
    """The members (k,) that are in an order at a place or after it."""
    chosen = np.zeros(len(order), dtype=bool)
    chosen[order[first:]] = True
    return chosen


def _numbered(group: Ints) -> Ints:
    """The same groups, numbered without gaps."""
    return np.asarray(np.unique(group, return_inverse=True)[1])
