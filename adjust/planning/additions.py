"""Possible additions to a flight: lines back or again, lines across, a second height, more control.

Proposals cover the area of the lines that are there, with their overlaps. Which of them is worth its images
only a computation tells.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from adjust.arrays import Floats
from adjust.calibration.strip_means import height_groups
from adjust.camera.interior import FrameCamera
from adjust.planning.extension import AddedStrip
from adjust.planning.flown_lines import FlownLine, flown_lines, without_return
from adjust.planning.network import PlannedNetwork
from adjust.simulate.flight_plan import LinePattern, base_of, spacing_of

# Overlap of lines whose own cannot be seen in the network.
_OVERLAP = 0.6
_LEAST_LAP, _MOST_LAP = 0.2, 0.9
# Ratios of heights that are proposed, as far as they are allowed; no aircraft is sent above the ceiling.
_HEIGHT_RATIOS = (3.0, 2.1)
# Over the least ratio: nobody flies to the metre.
_MARGIN = 1.05
_CEILING_M = 8000.0
_LEAST_CONTROL = 9
# Fewer have no tie points in three images.
_LEAST_EXPOSURES = 3


@dataclass(frozen=True, eq=False)
class ProposedLines:
    """Lines that belong together.

    Attributes
    ----------
    what : "back", "again": lines that are there, flown back or again; "across", "height": new ones.
    heading : of the first line, radians.
    height : above ground, metres.
    lines : number of lines, each flown once or both ways.
    both_ways : whether every line is flown forward and reverse.
    times : how often all that is flown.
    strips : all strips of them.
    """

    what: str
    heading: float
    height: float
    lines: int
    both_ways: bool
    strips: tuple[AddedStrip, ...]
    times: int = 1

    @property
    def exposures(self) -> int:
        """Number of exposures."""
        return sum(len(strip.plan) for strip in self.strips)


@dataclass(frozen=True, eq=False)
class Addition:
    """One proposal.

    Attributes
    ----------
    groups : the lines.
    control : number of additional control points.
    """

    groups: tuple[ProposedLines, ...] = ()
    control: int = 0

    @property
    def strips(self) -> tuple[AddedStrip, ...]:
        """All strips."""
        return tuple(strip for group in self.groups for strip in group.strips)

    @property
    def exposures(self) -> int:
        """Number of additional exposures: what the proposal costs."""
        return sum(group.exposures for group in self.groups)

    @property
    def key(self) -> tuple[object, ...]:
        """The same for the same lines and control."""
        strips = [(strip.plan.tobytes(), strip.heading, strip.height) for strip in self.strips]
        return (*sorted(strips), self.control)

    @property
    def cost(self) -> tuple[int, int]:
        """Exposures first, control points between equals."""
        return self.exposures, self.control


def additions(network: PlannedNetwork, height_ratio: float) -> tuple[Addition, ...]:
    """Proposals for a network, the cheapest first.

    Parameters
    ----------
    height_ratio : least ratio of two flying heights that counts as two.
    """
    lines = flown_lines(network)
    levels = _levels(lines)
    turning = [*_back(levels), *_across(network, levels)]
    highest, lowest = (np.median([line.height for line in levels[k]]) for k in (-1, 0))
    rising = list(_second_height(network, levels[0], height_ratio)) if highest < height_ratio * lowest else []
    control = max(len(network.control.point), _LEAST_CONTROL)
    single = [Addition((_again(lines),)), *(Addition(groups) for groups in turning)]
    single += [Addition((group,)) for group in rising]
    several = [_repeated(group, times) for group in rising if group.both_ways for times in (2, 3)]
    single += [Addition((group,)) for group in several]
    pairs = [Addition((*groups, group)) for groups, group in product(turning, rising + several)]
    if not rising:  # back and across together are the next step once there are two heights
        back = list(_back(levels))
        pairs = [Addition((*one, *other)) for one, other in product(back[-1:], _across(network, levels))]
    surveyed = [replace(item, control=control) for item in (*single, *pairs)]
    unique = {item.key: item for item in (Addition(control=control), *single, *pairs, *surveyed)}
    return tuple(sorted(unique.values(), key=lambda item: item.cost))


def _again(lines: tuple[FlownLine, ...]) -> ProposedLines:
    """All lines again."""
    strips = tuple(AddedStrip(line.plan, line.heading, line.height) for line in lines)
    return ProposedLines("again", lines[0].heading, lines[0].height, len(lines), False, strips)


def _repeated(group: ProposedLines, times: int) -> ProposedLines:
    """The same lines flown several times: an error of a strip falls only with the number of strips."""
    return replace(group, strips=group.strips * times, times=times)


def _levels(lines: tuple[FlownLine, ...]) -> list[tuple[FlownLine, ...]]:
    """The lines of every flying height, the lowest first."""
    group = height_groups(np.array([line.height for line in lines]))
    return [
        tuple(line for line, own in zip(lines, group, strict=True) if own == k)
        for k in range(group.max() + 1)
    ]


def _back(levels: list[tuple[FlownLine, ...]]) -> Iterator[tuple[ProposedLines, ...]]:
    """The same lines flown back: of every height by itself, then of all."""
    groups = []
    for lines in levels:
        single = without_return(lines)
        if single:
            strips = tuple(AddedStrip(line.plan[::-1], line.heading + np.pi, line.height) for line in single)
            first = single[0]
            groups.append(
                ProposedLines("back", first.heading + np.pi, first.height, len(strips), False, strips)
            )
            yield (groups[-1],)
    if len(groups) > 1:
        yield tuple(groups)


def _across(
    network: PlannedNetwork, levels: list[tuple[FlownLine, ...]]
) -> Iterator[tuple[ProposedLines, ...]]:
    """Lines across, where all lines of a height are parallel: two of them, then over the whole area."""
    few, whole = [], []
    for lines in levels:
        main = _main_heading(lines)
        if any(abs(np.sin(line.heading - main)) > np.sin(np.deg2rad(30.0)) for line in lines):
            continue
        height = float(np.median([line.height for line in lines]))
        few.append(_cover(network, lines, "across", main + 0.5 * np.pi, height, "both", most=1))
        whole.append(_cover(network, lines, "across", main + 0.5 * np.pi, height, "alternating"))
        yield (few[-1],)
        yield (whole[-1],)
    if len(whole) > 1:
        yield tuple(few)
        yield tuple(whole)


def _second_height(
    network: PlannedNetwork, lines: tuple[FlownLine, ...], least: float
) -> Iterator[ProposedLines]:
    """Lines at a second height: one line there and back, then the whole area once, then both ways."""
    main, here = _main_heading(lines), float(np.median([line.height for line in lines]))
    ratios = [ratio for ratio in _HEIGHT_RATIOS if ratio >= _MARGIN * least] or [_MARGIN * least]
    above = [ratio * here for ratio in ratios if ratio * here <= _CEILING_M]
    for height in above:
        yield _cover(network, lines, "height", main, height, "both", most=1)
        yield _cover(network, lines, "height", main, height, "alternating")
        yield _cover(network, lines, "height", main, height, "both")
    if not above:
        yield _cover(network, lines, "height", main, here / ratios[-1], "both", most=1)
        yield _cover(network, lines, "height", main, here / ratios[-1], "alternating")


def _main_heading(lines: tuple[FlownLine, ...]) -> float:
    """Direction of most exposures, lines there and back alike, radians."""
    doubled = np.array([2.0 * line.heading for line in lines])
    weight = np.array([len(line.exposures) for line in lines])
    # The line whose direction most exposures share (crossing lines would average to none of them).
    shared = [float(np.sum(weight * (np.cos(doubled - own) > 0.5))) for own in doubled]
    return lines[int(np.argmax(shared))].heading


def _cover(
    network: PlannedNetwork,
    lines: tuple[FlownLine, ...],
    what: str,
    heading: float,
    height: float,
    pattern: LinePattern,
    most: int | None = None,
) -> ProposedLines:
    """Parallel lines over the area of others; `most` of them, in its middle, if that is given."""
    camera = network.cameras[int(np.bincount(network.exposures.camera).argmax())]
    end_lap, side_lap = _overlaps(lines, base_of(camera, 1.0, 0.0), spacing_of(camera, 1.0, 0.0))
    base, spacing = base_of(camera, height, end_lap), spacing_of(camera, height, side_lap)
    forward = np.array([np.sin(heading), np.cos(heading)])
    right = np.array([np.cos(heading), -np.sin(heading)])
    covered = np.concatenate([_covered(line, camera) for line in lines])
    along, across = covered @ forward, covered @ right
    # The outermost images see the border of the area, whatever their height.
    exposures = max(_LEAST_EXPOSURES, _places(np.ptp(along) - base_of(camera, height, 0.0), base))
    count = _places(np.ptp(across) - spacing_of(camera, height, 0.0), spacing) if most is None else most
    middle = 0.5 * (along.min() + along.max()) * forward + 0.5 * (across.min() + across.max()) * right
    strips = []
    for number in range(count):
        offset = (number - 0.5 * (count - 1)) * spacing
        steps = (np.arange(exposures) - 0.5 * (exposures - 1)) * base
        own = middle + steps[:, None] * forward + offset * right
        there = AddedStrip(own, heading, height)
        back = AddedStrip(own[::-1], heading + np.pi, height)
        if pattern == "both":
            strips += [there, back]
        else:
            strips.append(back if pattern == "alternating" and number % 2 else there)
    return ProposedLines(what, heading, height, count, pattern == "both", tuple(strips))


def _covered(line: FlownLine, camera: FrameCamera) -> Floats:
    """Corners (4 k, 2) of the ground that the exposures of a line cover, local frame, metres."""
    forward = 0.5 * base_of(camera, line.height, 0.0) * np.array([np.sin(line.heading), np.cos(line.heading)])
    right = (
        0.5 * spacing_of(camera, line.height, 0.0) * np.array([np.cos(line.heading), -np.sin(line.heading)])
    )
    corners = [a * forward + b * right for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    return np.concatenate([line.plan + corner for corner in corners])


def _places(extent: float, step: float) -> int:
    """Number of places, one step apart at most, from one end of an extent to the other."""
    return max(1, int(np.ceil(extent / step - 1e-6)) + 1)


def _overlaps(lines: tuple[FlownLine, ...], along: float, across: float) -> tuple[float, float]:
    """End lap and side lap of lines; `along`, `across`: sides of the footprint per metre of height."""
    bases = [line.base / line.height for line in lines if np.isfinite(line.base)]
    end_lap = 1.0 - float(np.median(bases)) / along if bases else _OVERLAP
    spacings = _spacings(lines)
    side_lap = 1.0 - float(np.median(spacings)) / across if len(spacings) else _OVERLAP
    return _plausible(end_lap), _plausible(side_lap)


def _plausible(lap: float) -> float:
    return lap if _LEAST_LAP <= lap <= _MOST_LAP else _OVERLAP


def _spacings(lines: tuple[FlownLine, ...]) -> Floats:
    """Distances of neighbouring parallel lines over their height."""
    found = []
    for line in lines:
        beside = [
            abs(line.across(other.plan.mean(axis=0))) / line.height
            for other in lines
            if abs(np.sin(line.heading - other.heading)) < np.sin(np.deg2rad(15.0))
            and abs(other.height - line.height) < 0.1 * line.height
        ]
        apart = [distance for distance in beside if distance > 0.1]
        if apart:
            found.append(min(apart))
    return np.array(found)
