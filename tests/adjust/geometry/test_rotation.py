"""Rotations: closed values of the conventions, and what holds for all of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from adjust.arrays import Floats
from adjust.geometry import rotation

ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
CAMERA_FORWARD = np.diag([1.0, -1.0, -1.0])
PI = np.pi

vectors = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array).filter(lambda v: np.linalg.norm(v) > 0.1)
directions = vectors.map(lambda v: v / np.linalg.norm(v))
angles = st.floats(-PI, PI)
# Away from gimbal lock, where the three angles are unique.
elevations = st.floats(-0.49 * PI, 0.49 * PI)


def enu_from_camera(heading_deg: float, pitch_deg: float, roll_deg: float) -> Floats:
    """A camera mounted with x forward, without boresight misalignment."""
    angles_rad = np.deg2rad([heading_deg, pitch_deg, roll_deg])
    return ENU_FROM_NED @ rotation.ned_from_body(angles_rad) @ CAMERA_FORWARD


def assert_rotation(matrix: Floats) -> None:
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=4e-15)
    assert np.linalg.det(matrix) == pytest.approx(1.0, abs=4e-15)


@pytest.mark.parametrize(("heading_deg", "kappa_deg"), [(0, 90), (90, 0), (180, -90), (270, -180)])
def test_kappa_of_a_level_flight_is_ninety_degrees_less_the_heading(
    heading_deg: float, kappa_deg: float
) -> None:
    expected = rotation.from_omega_phi_kappa(np.deg2rad([0.0, 0.0, kappa_deg]))
    np.testing.assert_allclose(enu_from_camera(heading_deg, 0.0, 0.0), expected, atol=1e-15)


def test_nose_up_on_a_northward_flight_is_a_positive_omega_and_looks_north() -> None:
    matrix = enu_from_camera(0.0, 2.0, 0.0)
    np.testing.assert_allclose(np.rad2deg(rotation.to_omega_phi_kappa(matrix)), [2.0, 0.0, 90.0], atol=1e-12)
    viewing = matrix @ [0.0, 0.0, -1.0]
    np.testing.assert_allclose(viewing, [0.0, np.sin(np.deg2rad(2.0)), -np.cos(np.deg2rad(2.0))], atol=1e-15)


def test_right_wing_down_on_a_northward_flight_is_a_positive_phi_and_looks_west() -> None:
    matrix = enu_from_camera(0.0, 0.0, 2.0)
    np.testing.assert_allclose(np.rad2deg(rotation.to_omega_phi_kappa(matrix)), [0.0, 2.0, 90.0], atol=1e-12)
    viewing = matrix @ [0.0, 0.0, -1.0]
    np.testing.assert_allclose(viewing, [-np.sin(np.deg2rad(2.0)), 0.0, -np.cos(np.deg2rad(2.0))], atol=1e-15)


def test_the_two_orders_of_omega_and_phi_give_the_known_different_angles() -> None:
    matrix = rotation.from_omega_phi_kappa(np.deg2rad([3.0, 2.0, 90.0]))
    omega, phi, kappa = np.rad2deg(rotation.to_phi_omega_kappa(matrix))
    assert (omega, phi, kappa) == pytest.approx((2.998171, 2.002742, 90.104794), abs=5e-7)


def test_attitude_of_the_published_vector_in_a_grid_with_and_without_convergence() -> None:
    # Image top forward: the camera is turned by −90° against the one with x forward.
    installation = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    body = rotation.ned_from_body(np.deg2rad([87.5, -0.8, 1.2]))
    convergence = np.deg2rad(-2.230355)
    without = ENU_FROM_NED @ body @ installation
    np.testing.assert_allclose(
        np.rad2deg(rotation.to_omega_phi_kappa(without)), [1.164092, 0.851408, -87.517028], atol=6e-7
    )
    in_grid = rotation.about_z(convergence) @ without
    np.testing.assert_allclose(
        np.rad2deg(rotation.to_omega_phi_kappa(in_grid)), [1.196340, 0.805463, -89.747143], atol=6e-7
    )
    boresight = rotation.from_omega_phi_kappa(np.deg2rad([0.05, -0.03, 0.10]))
    np.testing.assert_allclose(
        np.rad2deg(rotation.to_omega_phi_kappa(in_grid @ boresight)),
        [1.166558, 0.755331, -89.646750],
        atol=6e-7,
    )


def test_elementary_rotations_turn_each_axis_towards_the_next() -> None:
    x, y, z = np.eye(3)
    np.testing.assert_allclose(rotation.about_x(PI / 2) @ y, z, atol=1e-16)
    np.testing.assert_allclose(rotation.about_y(PI / 2) @ z, x, atol=1e-16)
    np.testing.assert_allclose(rotation.about_z(PI / 2) @ x, y, atol=1e-16)


def test_phi_of_ninety_degrees_leaves_the_matrix_reproducible_with_kappa_zero() -> None:
    matrix = rotation.from_omega_phi_kappa(np.array([0.3, PI / 2, 0.4]))
    found = rotation.to_omega_phi_kappa(matrix)
    assert found[2] == 0.0
    np.testing.assert_allclose(rotation.from_omega_phi_kappa(found), matrix, atol=1e-14)


def test_functions_work_on_any_leading_axes() -> None:
    angles_many = np.random.default_rng(5).uniform(-1.0, 1.0, (2, 4, 3))
    many = rotation.from_omega_phi_kappa(angles_many)
    assert many.shape == (2, 4, 3, 3)
    np.testing.assert_array_equal(many[1, 2], rotation.from_omega_phi_kappa(angles_many[1, 2]))
    np.testing.assert_allclose(rotation.log(many)[1, 2], rotation.log(many[1, 2][None])[0], atol=1e-15)


@given(directions, st.floats(0.0, PI - 1e-9))
@settings(max_examples=200, deadline=None)
def test_exp_agrees_with_an_independent_implementation(direction: Floats, angle: float) -> None:
    found = rotation.exp(angle * direction)
    assert_rotation(found)
    np.testing.assert_allclose(found, Rotation.from_rotvec(angle * direction).as_matrix(), atol=4e-15)


@given(
    directions,
    st.one_of(
        st.floats(0.0, PI),
        st.floats(0.0, 1e-3),
        st.sampled_from([0.0, 1e-300, 1e-16, 1e-9, 1e-5, 9.9e-5, 1.01e-4]),
        st.floats(0.0, 1e-2).map(lambda gap: PI - gap),
        st.sampled_from([PI, PI - 1e-12, PI - 1e-8, PI - 9.9e-4, PI - 1.01e-3]),
    ),
)
@settings(max_examples=500, deadline=None)
def test_exp_of_log_is_the_rotation_from_identity_to_half_turn(direction: Floats, angle: float) -> None:
    matrix = rotation.exp(angle * direction)
    vector = rotation.log(matrix[None])[0]
    assert np.linalg.norm(vector) <= PI * (1 + 1e-15)
    np.testing.assert_allclose(rotation.exp(vector), matrix, atol=2e-14)


@given(directions, st.floats(0.0, PI - 1e-2))
@settings(max_examples=200, deadline=None)
def test_log_of_exp_is_the_vector(direction: Floats, angle: float) -> None:
    found = rotation.log(rotation.exp(angle * direction)[None])[0]
    np.testing.assert_allclose(found, angle * direction, atol=1e-13)


def test_log_of_a_single_half_turn_needs_no_leading_axis() -> None:
    vector = rotation.log(rotation.exp(np.array([0.0, PI, 0.0])))
    assert np.linalg.norm(vector) == pytest.approx(PI)
    np.testing.assert_allclose(np.abs(vector), [0.0, PI, 0.0], atol=1e-12)


@given(directions, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
@settings(max_examples=50, deadline=None)
def test_turns_about_one_axis_add_up(direction: Floats, first: float, second: float) -> None:
    product = rotation.exp(first * direction) @ rotation.exp(second * direction)
    np.testing.assert_allclose(product, rotation.exp((first + second) * direction), atol=4e-15)


@pytest.mark.parametrize(
    ("forward", "backward", "middle"),
    [
        (rotation.from_omega_phi_kappa, rotation.to_omega_phi_kappa, 1),
        (rotation.from_phi_omega_kappa, rotation.to_phi_omega_kappa, 0),
        (rotation.ned_from_body, rotation.to_heading_pitch_roll, 1),
    ],
    ids=["omega-phi-kappa", "phi-omega-kappa", "heading-pitch-roll"],
)
@given(first=angles, steep=elevations, last=angles)
@settings(max_examples=200, deadline=None)
def test_angles_return_from_their_matrix(
    forward: Callable[[Floats], Floats],
    backward: Callable[[Floats], Floats],
    middle: int,
    first: float,
    steep: float,
    last: float,
) -> None:
    others = iter((first, last))
    given_angles = np.array([steep if k == middle else next(others) for k in range(3)])
    matrix = forward(given_angles)
    assert_rotation(matrix)
    difference = backward(matrix) - given_angles
    # The middle angle comes from an arcsine, which loses digits towards 90°.
    np.testing.assert_allclose(np.sin(0.5 * difference), 0.0, atol=1e-13)


# Gimbal lock is the case that matters: the angles are arbitrary there, the rotation is not.
@pytest.mark.parametrize(
    ("forward", "backward", "locked"),
    [
        (rotation.from_omega_phi_kappa, rotation.to_omega_phi_kappa, 1),
        (rotation.from_phi_omega_kappa, rotation.to_phi_omega_kappa, 0),
        (rotation.ned_from_body, rotation.to_heading_pitch_roll, 1),
    ],
    ids=["omega-phi-kappa", "phi-omega-kappa", "heading-pitch-roll"],
)
@pytest.mark.parametrize("gap", [0.0, 1e-14, 1e-12, 1e-9, 1e-7, 1e-5])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_rotation_survives_gimbal_lock(
    forward: Callable[[Floats], Floats],
    backward: Callable[[Floats], Floats],
    locked: int,
    gap: float,
    sign: float,
) -> None:
    given_angles = np.array([0.7, 0.7, 0.7])
    given_angles[locked] = sign * (0.5 * PI - gap)
    given_angles[2 if locked != 2 else 0] = -0.4
    matrix = forward(given_angles)
    # cos of an angle near 90° is known only to its rounding in the sine: √(2 ε) ≈ 2e-8.
    np.testing.assert_allclose(forward(backward(matrix)), matrix, atol=5e-8)


@pytest.mark.parametrize(
    ("forward", "jacobian"),
    [
        (rotation.from_omega_phi_kappa, rotation.omega_phi_kappa_jacobian),
        (rotation.from_phi_omega_kappa, rotation.phi_omega_kappa_jacobian),
        (rotation.ned_from_body, rotation.heading_pitch_roll_jacobian),
    ],
    ids=["omega-phi-kappa", "phi-omega-kappa", "heading-pitch-roll"],
)
@given(first=angles, second=angles, third=angles)
@settings(max_examples=60, deadline=None)
def test_angle_jacobians_give_the_small_rotation_on_the_right(
    forward: Callable[[Floats], Floats],
    jacobian: Callable[[Floats], Floats],
    first: float,
    second: float,
    third: float,
) -> None:
    given_angles = np.array([first, second, third])
    numeric = np.empty((3, 3))
    step = 1e-4  # truncation and rounding are both about 1e-9
    for k in range(3):
        change = step * np.eye(3)[k]
        small = forward(given_angles - change).T @ forward(given_angles + change)
        numeric[:, k] = rotation.log(small[None])[0] / (2.0 * step)
    np.testing.assert_allclose(jacobian(given_angles), numeric, atol=1e-7)


@given(first=angles, second=angles, third=angles)
@settings(max_examples=60, deadline=None)
def test_boresight_jacobian_gives_the_small_rotation_on_the_left(
    first: float, second: float, third: float
) -> None:
    given_angles = np.array([first, second, third])
    numeric = np.empty((3, 3))
    step = 1e-4
    for k in range(3):
        change = step * np.eye(3)[k]
        small = (
            rotation.from_roll_pitch_yaw(given_angles + change)
            @ rotation.from_roll_pitch_yaw(given_angles - change).T
        )
        numeric[:, k] = rotation.log(small[None])[0] / (2.0 * step)
    np.testing.assert_allclose(rotation.roll_pitch_yaw_jacobian(given_angles), numeric, atol=1e-7)


@given(directions, st.one_of(st.floats(0.0, 3.0), st.floats(0.0, 2e-2), st.just(1e-2)))
@settings(max_examples=200, deadline=None)
def test_inverse_right_jacobian_is_the_derivative_of_the_logarithm(direction: Floats, angle: float) -> None:
    vector = angle * direction
    matrix = rotation.exp(vector)
    step = 1e-5
    numeric = np.empty((3, 3))
    for k in range(3):
        change = rotation.exp(step * np.eye(3)[k])
        after, before = rotation.log((matrix @ change)[None])[0], rotation.log((matrix @ change.T)[None])[0]
        numeric[:, k] = (after - before) / (2.0 * step)
    np.testing.assert_allclose(rotation.right_jacobian_inverse(vector), numeric, atol=2e-7)


def test_the_naive_boresight_jacobian_would_be_wrong_by_its_misalignment() -> None:
    # mathematics.md 1.2: with half a degree the identity in place of E is off by 9e-3.
    jacobian = rotation.roll_pitch_yaw_jacobian(np.deg2rad([0.5, 0.5, 0.5]))
    assert 5e-3 < np.max(np.abs(jacobian - np.eye(3))) < 1.5e-2
