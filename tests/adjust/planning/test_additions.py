"""Proposals: they cover the same ground, do what they say, and never make anything worse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.calibration.flight_pattern import flight_pattern
from adjust.parameters import BORESIGHT, GNSS_SHIFT, GNSS_STRIP_BIAS, INTERIOR_ORIENTATION
from adjust.planning.a_priori import CalibrationModel, a_priori_covariance
from adjust.planning.additions import Addition, additions
from adjust.planning.extension import AddedStrip, extended
from adjust.planning.flown_lines import FlownLine, without_return
from adjust.planning.network import PlannedNetwork
from adjust.planning.simulated_network import simulated_network
from adjust.rig import RELATIVE_ROTATION
from adjust.simulate.flight_plan import LineGroup, LinePattern, base_of, sides_along_and_across, spacing_of
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.trajectory import FlightVariation
from tests.adjust.rig_flights import penta
from tests.adjust.simulate.specifications import CAMERA, small_specification

ALL = (0, 1, 2)
MODEL = CalibrationModel(
    {INTERIOR_ORIENTATION: ALL, BORESIGHT: ALL, GNSS_SHIFT: ALL, GNSS_STRIP_BIAS: ALL},
    {GNSS_STRIP_BIAS: np.full(3, 0.03)},
)
HEIGHT, LINES, EXPOSURES = 1000.0, 5, 6


def lines(pattern: LinePattern, height: float = HEIGHT, heading: float = 0.5 * np.pi) -> PlannedNetwork:
    base, spacing = base_of(CAMERA, height, 0.6), spacing_of(CAMERA, height, 0.5)
    group = LineGroup("E", "1", 0, heading, height, (EXPOSURES,) * LINES, base, spacing, pattern)
    level = FlightVariation((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)
    points = PointSpecification(count=300)
    return simulated_network(small_specification(flight=(group,), variation=level, points=points))


def sigma(network: PlannedNetwork) -> Floats:
    """Of the nine quantities; those of the strips come after them."""
    found = a_priori_covariance(network, MODEL)
    return np.array(
        [value for (name, _, _), value in zip(found.names, found.sigma, strict=True) if "strip" not in name]
    )


def of_kind(proposals: tuple[Addition, ...], *kinds: str) -> list[Addition]:
    """Those made of these kinds of lines, in this order, without more control."""
    return [
        item for item in proposals if tuple(group.what for group in item.groups) == kinds and not item.control
    ]


def ground(strips: tuple[AddedStrip, ...]) -> Floats:
    """Lower and upper corner (2, 2) of what strips flown level east or north cover."""
    along, across = (0.5 * side / CAMERA.focal_length for side in sides_along_and_across(CAMERA))
    corners = []
    for strip in strips:
        eastward = abs(np.sin(strip.heading)) > 0.5
        reach = strip.height * np.array([along, across] if eastward else [across, along])
        corners += [strip.plan - reach, strip.plan + reach]
    every = np.concatenate(corners)
    return np.stack([every.min(axis=0), every.max(axis=0)])


def test_the_same_lines_flown_back_are_what_a_plan_with_both_directions_gives() -> None:
    single, both = lines("single"), lines("both")
    (back,) = of_kind(additions(single, 2.0), "back")
    assert back.exposures == LINES * EXPOSURES
    extra, planned = sigma(extended(single, back.strips)), sigma(both)
    # Focal length and the shift in height hang on the relief alone: other tie points, other values.
    fragile = np.array([0, 8])
    np.testing.assert_allclose(np.delete(extra, fragile), np.delete(planned, fragile), rtol=0.05)
    np.testing.assert_allclose(extra[fragile], planned[fragile], rtol=0.25)


def test_lines_that_were_flown_back_already_are_not_proposed_again() -> None:
    proposals = additions(lines("both"), 2.0)
    assert not of_kind(proposals, "back")
    assert of_kind(additions(lines("alternating"), 2.0), "back")


def test_proposed_lines_cover_the_ground_of_those_that_are_there() -> None:
    network = lines("single")
    there = extended(network, ())
    centre, half = there.exposures.projection_centre[:, :2], 0.5 * HEIGHT / CAMERA.focal_length
    along, across = sides_along_and_across(CAMERA)
    reach = half * np.array([along, across])
    area = np.stack([centre.min(axis=0) - reach, centre.max(axis=0) + reach])
    proposals = additions(network, 2.0)
    whole = [item for item in of_kind(proposals, "across") if not item.groups[0].both_ways]
    whole += [item for item in of_kind(proposals, "height") if item.groups[0].lines > 1]
    assert len(whole) >= 3
    repeated = [group for item in of_kind(proposals, "height") for group in item.groups if group.times > 1]
    assert {group.times for group in repeated} == {2, 3}
    for item in whole:
        covered = ground(item.strips)
        assert np.all(covered[0] <= area[0] + 1.0), item
        assert np.all(covered[1] >= area[1] - 1.0), item
        # and not a whole base or line more than that on each side
        extra = np.array([spacing_of(CAMERA, item.groups[0].height, 0.5)] * 2)
        assert np.all(area[0] - covered[0] <= extra)


def test_lines_of_a_rig_flown_back_are_taken_with_all_its_heads() -> None:
    """They determine as much as those of a plan with both directions."""

    def flown(pattern: LinePattern) -> PlannedNetwork:
        given = penta(lines=3, exposures=6, points=300)
        level = FlightVariation((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)
        groups = tuple(replace(group, pattern=pattern) for group in given.flight)
        return simulated_network(replace(given, flight=groups, variation=level))

    single, both = flown("single"), flown("both")
    (back,) = of_kind(additions(single, 2.0), "back")
    wider = extended(single, back.strips)
    assert wider.rig is not None
    assert both.rig is not None
    assert back.exposures == 3 * 6
    assert len(wider.event_of_image) == len(both.event_of_image) == 2 * 3 * 6 * 5
    assert len(wider.rays.image) == pytest.approx(len(both.rays.image), rel=0.1)
    assert wider.rig.motion is not None
    forward, aside, down = wider.rig.motion.velocity.T
    assert np.all(forward > 50.0)
    np.testing.assert_allclose(np.hypot(aside, down), 0.0, atol=0.1)
    free = {BORESIGHT: ALL, GNSS_SHIFT: ALL, RELATIVE_ROTATION: ALL}
    extra, planned = (a_priori_covariance(network, CalibrationModel(free, {})) for network in (wider, both))
    assert extra.names == planned.names
    np.testing.assert_allclose(extra.sigma, planned.sigma, rtol=0.1)


def test_a_second_height_keeps_the_ratio_and_the_ceiling() -> None:
    for height, expected in ((1000.0, {3.0, 2.1}), (3500.0, {2.1}), (6000.0, {0.5})):
        proposals = of_kind(additions(lines("single", height), 2.0), "height")
        found = {round(item.groups[0].height / height, 1) for item in proposals}
        assert found == expected
    assert not of_kind(additions(extended(lines("single"), high_line()), 2.0), "height")


def high_line() -> tuple[AddedStrip, ...]:
    plan = np.stack([np.linspace(-800.0, 800.0, 4), np.zeros(4)], -1)
    return (AddedStrip(plan, 0.5 * np.pi, 3.0 * HEIGHT),)


def test_directions_and_heights_of_the_extended_network_are_recognised() -> None:
    network = lines("single")
    for item in additions(network, 2.0):
        wider = extended(network, item.strips, item.control)
        pattern = flight_pattern(wider.heading, wider.height_above_ground, wider.exposures.strip)
        kinds = {group.what for group in item.groups}
        turned = bool(kinds & {"back", "across"}) or any(group.both_ways for group in item.groups)
        turned |= any(np.ptp([strip.heading for strip in group.strips]) > 3.0 for group in item.groups)
        assert (len(pattern.directions) > 1) == turned
        assert (pattern.height_ratio > 1.5) == ("height" in kinds)
        assert len(wider.exposures) == len(network.exposures) + item.exposures
        assert len(wider.control.point) == len(network.control.point) + item.control


def test_proposals_come_in_the_order_of_their_exposures_and_once() -> None:
    proposals = additions(lines("single"), 2.0)
    costs = [item.cost for item in proposals]
    assert costs == sorted(costs)
    assert len({item.key for item in proposals}) == len(proposals)


def test_no_addition_makes_anything_worse() -> None:
    network = lines("alternating")
    here = sigma(network)
    for item in additions(network, 2.0)[:8]:
        assert np.all(sigma(extended(network, item.strips, item.control)) <= here * (1.0 + 1e-9))


def test_additional_rays_lie_in_their_images_as_dense_as_the_others() -> None:
    network = lines("single")
    thinned = np.random.default_rng(2).uniform(size=len(network.rays.image)) < 0.5
    thinned |= np.isin(network.rays.point, network.control.point)
    rays = replace(
        network.rays,
        image=network.rays.image[thinned],
        point=network.rays.point[thinned],
        sigma=network.rays.sigma[thinned],
    )
    sparse = replace(network, rays=rays)
    (back,) = of_kind(additions(network, 2.0), "back")
    for given in (network, sparse):
        wider = extended(given, back.strips)
        added = wider.rays.image >= len(given.exposures)
        assert added.sum() == pytest.approx(len(given.rays.image), rel=0.08)
        assert np.all(np.abs(wider.image_coordinates[added]) < CAMERA.half_format)
        assert np.all(np.diff(wider.rays.point) >= 0)
        assert np.all(wider.exposures.strip[wider.rays.image[added]] >= len(given.strips))


def test_additional_control_is_spread_between_what_is_there() -> None:
    network = lines("single")
    wider = extended(network, (), control=9)
    new = wider.control.point[len(network.control.point) :]
    assert len(np.unique(wider.control.point)) == len(network.control.point) + 9
    place = network.object_point[:, :2]
    distance = np.linalg.norm(place[new][:, None] - place[network.control.point], axis=2).min(axis=1)
    every = np.linalg.norm(place[:, None] - place[network.control.point], axis=2).min(axis=1)
    assert distance.min() > np.median(every)
    bare = extended(
        replace(
            network,
            control=replace(
                network.control,
                point=network.control.point[:0],
                covariance=network.control.covariance[:0],
                present=network.control.present[:0],
            ),
        ),
        (),
        control=4,
    )
    assert len(bare.control.point) == 4


def test_a_network_without_declared_strips_still_gets_proposals() -> None:
    """All exposures under one name: directions and heights are recognised, and the area is covered."""
    network = lines("alternating")
    nameless = replace(
        network,
        strips=("",),
        exposures=replace(network.exposures, strip=np.zeros_like(network.exposures.strip)),
    )
    proposals = additions(nameless, 2.0)
    (across, *_) = of_kind(proposals, "across")
    assert abs(np.cos(across.groups[0].heading)) > 0.99
    (height, *_) = of_kind(proposals, "height")
    wider = extended(nameless, height.strips)
    pattern = flight_pattern(wider.heading, wider.height_above_ground, wider.exposures.strip)
    assert len(pattern.directions) == 2
    assert pattern.height_ratio > 2.0


def test_added_strips_are_taken_with_the_camera_of_their_flight() -> None:
    """The longest of three flights has one camera, and the two others together more images of another."""
    base, spacing = base_of(CAMERA, HEIGHT, 0.6), spacing_of(CAMERA, HEIGHT, 0.5)
    flights = tuple(
        LineGroup(name, name, camera, 0.0, HEIGHT, (count,) * 2, base, spacing, "single")
        for name, camera, count in (("1", 0, 6), ("2", 1, 5), ("3", 1, 5))
    )
    specification = small_specification(
        cameras=(CAMERA, replace(CAMERA, name="D")),
        flight=flights,
        points=PointSpecification(count=300),
    )
    network = simulated_network(specification)
    wider = extended(network, (AddedStrip(np.zeros((3, 2)), 0.0, HEIGHT),))
    added = slice(len(network.exposures), None)
    assert set(wider.exposures.flight[added]) == {0}
    assert set(wider.exposures.camera[added]) == {0}


def test_added_exposures_are_as_good_as_those_of_the_larger_flight_and_flown_at_a_usual_speed() -> None:
    network = lines("single")
    exposures, control = network.exposures, network.control
    count = len(exposures)
    sigma = np.where(np.arange(count)[:, None] % 2 == 0, 0.05, 0.15) * np.ones(3)
    flight = np.where(np.arange(count) < 10, 0, 1)
    covariance, present = control.covariance.copy(), control.present.copy()
    covariance[0], present[0] = np.eye(3), [False, False, True]
    network = replace(
        network,
        flights=("1", "2"),
        exposures=replace(exposures, position_sigma=sigma, flight=flight),
        control=replace(control, covariance=covariance, present=present),
    )
    plan = np.array([[0.0, 0.0], [150.0, 0.0], [450.0, 0.0]])
    wider = extended(network, (AddedStrip(plan, 0.5 * np.pi, 900.0),), control=2)
    added = wider.exposures
    assert added.flight[-3:].tolist() == [1, 1, 1]
    np.testing.assert_allclose(added.position_sigma[-3:], np.sqrt(0.5 * (0.05**2 + 0.15**2)))
    np.testing.assert_allclose(np.diff(added.time[-3:]), [2.0, 4.0])
    np.testing.assert_allclose(added.velocity[-1], [75.0, 0.0, 0.0], atol=0.1)
    np.testing.assert_allclose(
        wider.control.covariance[-2:], np.tile(control.covariance[1:].mean(axis=0), (2, 1, 1))
    )
    assert wider.control.present[-2:].all()


def test_the_base_of_a_line_is_the_distance_of_most_of_its_exposures() -> None:
    plan = np.array([[0.0, 0.0], [100.0, 0.0], [200.0, 0.0], [300.0, 0.0], [900.0, 0.0]])
    assert FlownLine(0, np.arange(5), 0.5 * np.pi, 1000.0, plan).base == 100.0


@pytest.mark.parametrize(("turn_deg", "back"), [(0.0, True), (14.0, True), (16.0, False), (80.0, False)])
def test_a_line_is_flown_back_by_one_of_nearly_the_opposite_direction(turn_deg: float, *, back: bool) -> None:
    plan = np.column_stack([np.linspace(-500.0, 500.0, 6), np.zeros(6)])
    line = FlownLine(0, np.arange(6), 0.5 * np.pi, 1000.0, plan)
    heading = 1.5 * np.pi + np.deg2rad(turn_deg)
    other = FlownLine(1, np.arange(6), heading, 1000.0, plan[::-1])
    assert without_return((line, other)) == (() if back else (line, other))
