"""Observations with a closed answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.camera.interior import nominal_mounting
from adjust.errors import InconsistentBlockError
from adjust.geometry import rotation
from adjust.geometry.earth import CartesianFrame, Ellipsoid, TopocentricFrame
from adjust.observations.base import StochasticModel
from adjust.observations.control_point import ControlPoints
from adjust.observations.gnss_position import GnssPositions, StripMotion
from adjust.observations.image_point import ImagePoints
from adjust.observations.ins_attitude import BodyRates, InsAttitudes
from adjust.parameters import (
    BORESIGHT,
    GNSS_DRIFT,
    GNSS_SHIFT,
    GNSS_STRIP_BIAS,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    OBJECT_POINT,
    TIME_OFFSET,
    State,
)

ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
UNIT = StochasticModel.from_sigma(np.ones((1, 3)))
ONE = np.zeros(1, dtype=np.int64)


def state_of(
    centre: tuple[float, float, float] = (0.0, 0.0, 1000.0),
    local_from_camera: np.ndarray | None = None,
    point: tuple[float, float, float] = (0.0, 0.0, 0.0),
    **system: list[float],
) -> State:
    values = {
        INTERIOR_ORIENTATION: [0.1, 0.0, 0.0],
        BORESIGHT: [0.0] * 3,
        LEVER_ARM: [0.0] * 3,
        GNSS_SHIFT: [0.0] * 3,
        **system,
    }
    return State(
        np.array([centre]),
        (np.eye(3) if local_from_camera is None else local_from_camera)[None],
        np.array([point]),
        {name: np.array([row], dtype=float) for name, row in values.items()},
    )


def image_point(x: float, y: float) -> ImagePoints:
    return ImagePoints(ONE, ONE, ONE, np.array([[x, y]]), np.full((1, 2), 1e-6), np.ones(1, dtype=bool))


def test_a_vertical_photograph_of_flat_ground_is_a_map_at_the_scale_c_over_h() -> None:
    state = state_of(point=(300.0, -200.0, 0.0))
    np.testing.assert_allclose(image_point(0.030, -0.020).misclosure(state), [[0.0, 0.0]], atol=1e-17)


def test_relief_displaces_a_point_radially_by_r_dh_over_h() -> None:
    raised = state_of(point=(300.0, 0.0, 50.0))
    radial = -image_point(0.030, 0.0).misclosure(raised)[0, 0]
    assert radial == pytest.approx(0.030 * 50.0 / (1000.0 - 50.0))


def test_a_camera_turned_by_kappa_turns_its_image_back() -> None:
    state = state_of(local_from_camera=rotation.about_z(np.pi / 2), point=(300.0, 0.0, 0.0))
    np.testing.assert_allclose(image_point(0.0, -0.030).misclosure(state), [[0.0, 0.0]], atol=1e-17)


def test_the_principal_point_shifts_the_computed_image_point() -> None:
    state = state_of(point=(300.0, 0.0, 0.0), interior_orientation=[0.1, 20e-6, -10e-6])
    np.testing.assert_allclose(image_point(0.030020, -10e-6).misclosure(state), [[0.0, 0.0]], atol=1e-17)


def test_a_point_above_the_camera_has_no_misclosure() -> None:
    assert np.isnan(image_point(0.0, 0.0).misclosure(state_of(point=(0.0, 0.0, 2000.0)))).all()


def test_image_points_must_come_sorted_by_object_point() -> None:
    with pytest.raises(InconsistentBlockError, match="sorted by object point"):
        ImagePoints(
            np.array([0, 0]), np.array([1, 0]), ONE, np.zeros((2, 2)), np.ones((2, 2)), np.ones(2, bool)
        )


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_image_coordinates_must_be_finite(bad: float) -> None:
    with pytest.raises(InconsistentBlockError, match="finite"):
        image_point(bad, 0.0)


def test_an_antenna_above_the_aircraft_on_a_level_northward_flight_stands_above_it() -> None:
    body = ENU_FROM_NED @ rotation.ned_from_body(np.zeros(3))
    mounting = nominal_mounting(0)
    # 0.4 m forward (north), 0.2 m right (east), 1.1 m above: z of the body points down.
    state = state_of(local_from_camera=body @ mounting, lever_arm=[0.4, 0.2, -1.1])
    group = GnssPositions(
        ONE, ONE, ONE, np.array([[0.2, 0.4, 1001.1]]), np.eye(3)[None], mounting[None], UNIT
    )
    np.testing.assert_allclose(group.linearize(state).misclosure, 0.0, atol=1e-12)


@pytest.mark.parametrize("mount_deg", [0, 90, 180, 270])
def test_the_lever_arm_is_in_body_axes_whatever_the_mounting(mount_deg: int) -> None:
    body = ENU_FROM_NED @ rotation.ned_from_body(np.deg2rad([70.0, 3.0, -2.0]))
    mounting = nominal_mounting(mount_deg)
    arm = np.array([0.4, 0.2, -1.1])
    state = state_of(local_from_camera=body @ mounting, lever_arm=list(arm))
    antenna = np.array([0.0, 0.0, 1000.0]) + body @ arm
    group = GnssPositions(ONE, ONE, ONE, antenna[None], np.eye(3)[None], mounting[None], UNIT)
    np.testing.assert_allclose(group.linearize(state).misclosure, 0.0, atol=1e-12)


def test_shift_bias_drift_and_time_offset_add_to_the_antenna_position() -> None:
    state = state_of(
        gnss_shift=[1.0, 0.0, 0.0],
        **{GNSS_STRIP_BIAS: [0.0, 2.0, 0.0], GNSS_DRIFT: [0.0, 0.0, 0.5], TIME_OFFSET: [0.01]},
    )
    motion = StripMotion(ONE, np.array([6.0]), np.array([[70.0, 0.0, 0.0]]))
    observed = np.array([[1.0 + 0.7, 2.0, 1000.0 + 3.0]])
    group = GnssPositions(ONE, ONE, ONE, observed, np.eye(3)[None], np.eye(3)[None], UNIT, motion)
    np.testing.assert_allclose(group.linearize(state).misclosure, 0.0, atol=1e-12)


def test_a_boresight_roll_shows_as_the_roll_error_of_the_attitude() -> None:
    body = ENU_FROM_NED @ rotation.ned_from_body(np.deg2rad([120.0, 4.0, -3.0]))
    mounting = nominal_mounting(90)
    misaligned = np.deg2rad([0.5, 0.0, 0.0])
    camera = body @ rotation.from_roll_pitch_yaw(misaligned) @ mounting
    group = InsAttitudes(ONE, ONE, body[None], mounting[None], UNIT)
    known = state_of(local_from_camera=camera, boresight=list(misaligned))
    np.testing.assert_allclose(group.linearize(known).misclosure, 0.0, atol=1e-15)
    ignored = group.linearize(state_of(local_from_camera=camera)).misclosure
    np.testing.assert_allclose(ignored, [-misaligned], atol=1e-15)


def test_attitudes_read_later_are_turned_by_the_rates_and_by_nothing_else() -> None:
    body = ENU_FROM_NED @ rotation.ned_from_body(np.deg2rad([120.0, 4.0, -3.0]))
    mounting, rate = nominal_mounting(90), np.deg2rad([1.0, -0.5, 2.0])
    # 5 ms at 1 °/s are 5 mdeg.
    late = rotation.exp(0.005 * rate)
    group = InsAttitudes(ONE, ONE, (body @ late)[None], mounting[None], UNIT, BodyRates(ONE, rate[None]))
    camera = body @ mounting
    known = state_of(local_from_camera=camera, time_offset=[0.005])
    np.testing.assert_allclose(group.linearize(known).misclosure, 0.0, atol=1e-15)
    np.testing.assert_allclose(group.at_exposure(known.system), [body], atol=1e-15)
    ignored = group.linearize(state_of(local_from_camera=camera, time_offset=[0.0])).misclosure
    np.testing.assert_allclose(np.rad2deg(ignored), [[0.005, -0.0025, 0.010]], atol=1e-12)
    without_rates = replace(group, turning=None).linearize(known)
    np.testing.assert_allclose(without_rates.misclosure, ignored, atol=1e-15)
    assert TIME_OFFSET not in {term.block for term in without_rates.terms}


def survey(frame: object, given: list[float], height: float, sigma: list[float]) -> ControlPoints:
    return ControlPoints(
        ONE,
        np.array([given]),
        np.array([height]),
        frame,  # type: ignore[arg-type]
        StochasticModel.from_sigma(np.array([sigma])),
    )


def test_a_surveyed_point_misses_by_surveyed_minus_computed() -> None:
    group = survey(CartesianFrame(), [10.0, 20.0, 30.0], 30.0, [0.1, 0.1, 0.1])
    found = group.linearize(state_of(point=(10.5, 19.0, 32.0))).misclosure
    np.testing.assert_allclose(found, [[-0.5, 1.0, -2.0]])


def test_a_height_needs_no_plan_position_and_knows_the_curvature() -> None:
    frame = TopocentricFrame(Ellipsoid(6378137.0, 1 / 298.257222101), 0.8, 0.2)
    state = state_of(point=(6000.0, 0.0, 100.0))
    group = survey(frame, [np.nan] * 3, 100.0, [np.nan, np.nan, 0.1])
    # Six kilometres from the origin a point at z = 100 m is 100 + D²/2R high.
    assert group.linearize(state).misclosure[0, 2] == pytest.approx(-(6000.0**2) / (2 * 6389e3), rel=1e-3)


def test_a_plan_position_needs_no_height() -> None:
    frame = TopocentricFrame(Ellipsoid(6378137.0, 1 / 298.257222101), 0.8, 0.2)
    geodetic = np.array([[0.8001, 0.2002, 0.0], [0.8001, 0.2002, 800.0]])
    foot, top = frame.from_geodetic(geodetic)
    group = survey(frame, list(foot), np.nan, [0.1, 0.1, np.nan])
    found = group.linearize(state_of(point=tuple(top))).misclosure
    np.testing.assert_allclose(found[0, :2], 0.0, atol=1e-8)
    assert [term.block for term in group.linearize(state_of()).terms] == [OBJECT_POINT]
