"""Rotations: elementary, exponential map, and the angle systems of photogrammetry.

All matrices are active and right-handed, named ``b_from_a``; all functions are vectorised
over leading axes. Small rotations act on the right: ``R · exp(δ)``. Conventions:
``docs/conventions.md``.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Bools, Floats

# Below this angle (rad) the closed forms lose digits and the series (error θ⁴/120) are used.
_SMALL_ANGLE = 1e-4
# By which RᵀR of a rotation may differ from the unit matrix.
_ORTHOGONAL = 1e-9
ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def about_x(angle: Floats | float) -> Floats:
    """Rotation R_x(angle), shape (..., 3, 3); angle in radians."""
    return _elementary(angle, 1, 2)


def about_y(angle: Floats | float) -> Floats:
    """Rotation R_y(angle), shape (..., 3, 3); angle in radians."""
    return _elementary(angle, 2, 0)


def about_z(angle: Floats | float) -> Floats:
    """Rotation R_z(angle), shape (..., 3, 3); angle in radians."""
    return _elementary(angle, 0, 1)


def _elementary(angle: Floats | float, first: int, second: int) -> Floats:
    """Rotation in the plane of two axes, from the first towards the second."""
    angle = np.asarray(angle, dtype=np.float64)
    matrix = np.zeros((*angle.shape, 3, 3))
    third = 3 - first - second
    matrix[..., third, third] = 1.0
    matrix[..., first, first] = matrix[..., second, second] = np.cos(angle)
    matrix[..., second, first] = np.sin(angle)
    matrix[..., first, second] = -np.sin(angle)
    return matrix


def are_rotations(matrix: Floats) -> Bools:
    """Whether each of n matrices (n, 3, 3) is orthogonal and right-handed."""
    away = np.abs(np.swapaxes(matrix, 1, 2) @ matrix - np.eye(3)).reshape(-1, 9)
    return np.asarray((away < _ORTHOGONAL).all(axis=1) & (np.linalg.det(matrix) > 0.0))


def cross_matrix(vector: Floats) -> Floats:
    """Matrix [a]× with [a]× b = a × b; vector (..., 3), result (..., 3, 3)."""
    vector = np.asarray(vector, dtype=np.float64)
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    # For few vectors a third of the time that stacking nine arrays takes.
    matrix = np.zeros((*vector.shape, 3))
    matrix[..., 2, 1], matrix[..., 0, 2], matrix[..., 1, 0] = x, y, z
    matrix[..., 1, 2], matrix[..., 2, 0], matrix[..., 0, 1] = -x, -y, -z
    return matrix


def exp(vector: Floats) -> Floats:
    """Rotation with the rotation vector (..., 3) in radians: I + sin θ K + (1 − cos θ) K²."""
    vector = np.asarray(vector, dtype=np.float64)
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    # np.sinc(x) = sin(πx)/(πx) is exact at zero; (1−cos θ)/θ² = ½ sinc²(θ/2).
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    skew = cross_matrix(vector)
    result: Floats = np.eye(3) + first * skew + second * (skew @ skew)
    return result


def log(matrix: Floats) -> Floats:
    """Rotation vector (..., 3) in radians, |vector| ≤ π, of a rotation (..., 3, 3); exp(log R) = R."""
    matrix = np.asarray(matrix, dtype=np.float64)
    axis = 0.5 * np.stack(
        [
            matrix[..., 2, 1] - matrix[..., 1, 2],
            matrix[..., 0, 2] - matrix[..., 2, 0],
            matrix[..., 1, 0] - matrix[..., 0, 1],
        ],
        axis=-1,
    )
    sine = np.linalg.norm(axis, axis=-1)
    cosine = 0.5 * (np.trace(matrix, axis1=-2, axis2=-1) - 1.0)
    angle = np.arctan2(sine, cosine)
    with np.errstate(invalid="ignore", divide="ignore"):
        factor = np.where(sine > _SMALL_ANGLE, angle / sine, 1.0 + sine**2 / 6.0)
    vector: Floats = factor[..., None] * axis
    half_turn = (cosine < 0.0) & (sine < 1e-3)
    if np.any(half_turn):
        vector[half_turn] = _log_near_half_turn(matrix[half_turn], axis[half_turn], angle[half_turn])
    return vector


def _log_near_half_turn(matrix: Floats, axis: Floats, angle: Floats) -> Floats:
    """Rotation vectors (n, 3) where sin θ is too small to hold the axis: it is taken from R + Rᵀ."""
    symmetric = 0.5 * (matrix + np.swapaxes(matrix, -1, -2))
    outer = (symmetric - np.cos(angle)[:, None, None] * np.eye(3)) / (1.0 - np.cos(angle))[:, None, None]
    largest = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    unit = outer[np.arange(len(outer)), :, largest]
    unit = unit / np.linalg.norm(unit, axis=-1, keepdims=True)
    sign = np.where(np.sum(unit * axis, axis=-1) < 0.0, -1.0, 1.0)
    vectors: Floats = (sign * angle)[:, None] * unit
    return vectors


def right_jacobian_inverse(vector: Floats) -> Floats:
    """Derivative of log(R · exp(δ)) with respect to δ at δ = 0, R = exp(vector); (..., 3, 3).

    J_r⁻¹(φ) = I + ½ [φ]× + (1/θ² − (1 + cos θ)/(2 θ sin θ)) [φ]×²  (Chirikjian 2012; Barfoot 2017,
    section 7.1.5); valid for θ < π.
    """
    vector = np.asarray(vector, dtype=np.float64)
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    small = angle < 1e-2  # series error θ⁴/30240 < 4e-13 there
    safe = np.where(small, 1.0, angle)
    closed = 1.0 / safe**2 - (1.0 + np.cos(safe)) / (2.0 * safe * np.sin(safe))
    coefficient = np.where(small, 1.0 / 12.0 + angle**2 / 720.0, closed)
    skew = cross_matrix(vector)
    return np.eye(3) + 0.5 * skew + coefficient * (skew @ skew)


def from_omega_phi_kappa(angles: Floats) -> Floats:
    """R = R_x(ω) R_y(φ) R_z(κ), ground from camera; angles (..., 3) = ω, φ, κ in radians."""
    angles = np.asarray(angles, dtype=np.float64)
    return about_x(angles[..., 0]) @ about_y(angles[..., 1]) @ about_z(angles[..., 2])


def to_omega_phi_kappa(matrix: Floats) -> Floats:
    """ω, φ, κ (..., 3) in radians of R = R_x(ω) R_y(φ) R_z(κ); at |φ| = 90° κ is set to zero."""
    matrix = np.asarray(matrix, dtype=np.float64)
    phi = np.arcsin(np.clip(matrix[..., 0, 2], -1.0, 1.0))
    omega = np.arctan2(-matrix[..., 1, 2], matrix[..., 2, 2])
    kappa = np.arctan2(-matrix[..., 0, 1], matrix[..., 0, 0])
    locked = np.hypot(matrix[..., 1, 2], matrix[..., 2, 2]) < 1e-12
    omega = np.where(locked, np.arctan2(matrix[..., 2, 1], matrix[..., 1, 1]), omega)
    kappa = np.where(locked, 0.0, kappa)
    return np.stack([omega, phi, kappa], axis=-1)


def omega_phi_kappa_jacobian(angles: Floats) -> Floats:
    """E (..., 3, 3) with δ = E · (dω, dφ, dκ)ᵀ for R ← R · exp(δ), δ in the camera frame."""
    angles = np.asarray(angles, dtype=np.float64)
    sine_phi, cosine_phi = np.sin(angles[..., 1]), np.cos(angles[..., 1])
    sine_kappa, cosine_kappa = np.sin(angles[..., 2]), np.cos(angles[..., 2])
    zero, one = np.zeros_like(sine_phi), np.ones_like(sine_phi)
    columns = [
        cosine_phi * cosine_kappa, sine_kappa, zero,
        -cosine_phi * sine_kappa, cosine_kappa, zero,
        sine_phi, zero, one,
    ]  # fmt: skip
    return np.stack(columns, axis=-1).reshape(*sine_phi.shape, 3, 3)


def from_phi_omega_kappa(angles: Floats) -> Floats:
    """R = R_y(φ) R_x(ω) R_z(κ), ground from camera; angles (..., 3) in the order ω, φ, κ, radians."""
    angles = np.asarray(angles, dtype=np.float64)
    return about_y(angles[..., 1]) @ about_x(angles[..., 0]) @ about_z(angles[..., 2])


def to_phi_omega_kappa(matrix: Floats) -> Floats:
    """Angles (..., 3) in the order ω, φ, κ (radians) of R = R_y(φ) R_x(ω) R_z(κ)."""
    matrix = np.asarray(matrix, dtype=np.float64)
    phi = np.arctan2(matrix[..., 0, 2], matrix[..., 2, 2])
    omega = np.arcsin(np.clip(-matrix[..., 1, 2], -1.0, 1.0))
    kappa = np.arctan2(matrix[..., 1, 0], matrix[..., 1, 1])
    return np.stack([omega, phi, kappa], axis=-1)


def phi_omega_kappa_jacobian(angles: Floats) -> Floats:
    """E (..., 3, 3) with δ = E · (dω, dφ, dκ)ᵀ for R = R_y(φ) R_x(ω) R_z(κ) ← R · exp(δ)."""
    angles = np.asarray(angles, dtype=np.float64)
    kappa_back = np.swapaxes(about_z(angles[..., 2]), -1, -2)
    omega_back = np.swapaxes(about_x(angles[..., 0]), -1, -2)
    columns = [
        kappa_back[..., :, 0],
        (kappa_back @ omega_back)[..., :, 1],
        np.broadcast_to(np.array([0.0, 0.0, 1.0]), (*angles.shape[:-1], 3)),
    ]
    return np.stack(columns, axis=-1)


def ned_from_body(angles: Floats) -> Floats:
    """R = R_z(heading) R_y(pitch) R_x(roll), north-east-down from forward-right-down.

    angles (..., 3) in the order heading (clockwise from north), pitch (nose up positive), roll
    (right wing down positive), radians (ARINC 705).
    """
    angles = np.asarray(angles, dtype=np.float64)
    return about_z(angles[..., 0]) @ about_y(angles[..., 1]) @ about_x(angles[..., 2])


def to_heading_pitch_roll(ned_from_body_matrix: Floats) -> Floats:
    """Heading, pitch, roll (..., 3) in radians of a rotation north-east-down from body."""
    matrix = np.asarray(ned_from_body_matrix, dtype=np.float64)
    heading = np.arctan2(matrix[..., 1, 0], matrix[..., 0, 0])
    pitch = -np.arcsin(np.clip(matrix[..., 2, 0], -1.0, 1.0))
    roll = np.arctan2(matrix[..., 2, 1], matrix[..., 2, 2])
    return np.stack([heading, pitch, roll], axis=-1)


def heading_pitch_roll_jacobian(angles: Floats) -> Floats:
    """E (..., 3, 3) with δ = E · (dheading, dpitch, droll)ᵀ for R ← R · exp(δ), δ in the body frame."""
    angles = np.asarray(angles, dtype=np.float64)
    roll_back = np.swapaxes(about_x(angles[..., 2]), -1, -2)
    pitch_back = np.swapaxes(about_y(angles[..., 1]), -1, -2)
    columns = [
        (roll_back @ pitch_back)[..., :, 2],
        roll_back[..., :, 1],
        np.broadcast_to(np.array([1.0, 0.0, 0.0]), (*angles.shape[:-1], 3)),
    ]
    return np.stack(columns, axis=-1)


def from_roll_pitch_yaw(angles: Floats) -> Floats:
    """Boresight rotation R_B = R_z(yaw) R_y(pitch) R_x(roll); angles (..., 3) = roll, pitch, yaw, radians."""
    return ned_from_body(np.asarray(angles, dtype=np.float64)[..., ::-1])


def roll_pitch_yaw_jacobian(angles: Floats) -> Floats:
    """E (..., 3, 3) with R_B(b + db) = exp(E db) R_B(b), b = roll, pitch, yaw in radians.

    The small rotation is on the left: it is expressed in the axes of the inertial unit.
    """
    angles = np.asarray(angles, dtype=np.float64)
    yaw = about_z(angles[..., 2])
    columns = [
        (yaw @ about_y(angles[..., 1]))[..., :, 0],
        yaw[..., :, 1],
        np.broadcast_to(np.array([0.0, 0.0, 1.0]), (*angles.shape[:-1], 3)),
    ]
    return np.stack(columns, axis=-1)
