"""Self-calibration of convergent photographs with the camera of OpenCV: a second computation by scipy.

Its formulas are those of OpenCV's projectPoints, its derivatives are numerical, its covariance is (JᵀJ)⁻¹.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import OptimizeResult, least_squares
from scipy.spatial.transform import Rotation

from adjust import (
    FAMILIES,
    AdjustmentResult,
    Block,
    CartesianFrame,
    ControlPoints,
    FrameCamera,
    ImagePoints,
    Observations,
    SystemParameters,
    adjust_block,
    self_calibration,
)
from adjust.arrays import Floats

PIXEL, SIGMA_PX, SIGMA_M = 4e-6, 0.3, 0.5e-3
TRUE = np.array([3210.0, 3200.0, 2015.0, 1490.0, -0.12, 0.09, 4e-4, -3e-4])  # fx, fy, cx, cy, k1, k2, p1, p2
IMAGES, POINTS, CONTROL = 8, 30, 6


def project(intrinsic: Floats, x_in_camera: Floats) -> Floats:
    """Pixels (n, 2), the centre of the first one being 0, 0; x right, y down, z forward."""
    fx, fy, cx, cy, k1, k2, p1, p2 = intrinsic
    u, v = (x_in_camera[:, :2] / x_in_camera[:, 2:]).T
    r2 = u * u + v * v
    radial = 1.0 + k1 * r2 + k2 * r2**2
    x = u * radial + 2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u)
    y = v * radial + p1 * (r2 + 2.0 * v * v) + 2.0 * p2 * u * v
    return np.column_stack([fx * x + cx, fy * y + cy])


class Photographs:
    """Points seen from all around, measured with errors; R and t of OpenCV, X_camera = R X + t."""

    def __init__(self) -> None:
        self.random = np.random.default_rng(4)
        self.points = self.random.uniform([-3, -2, -0.5], [3, 2, 0.5], (POINTS, 3))
        azimuth = 2.0 * np.pi * np.arange(IMAGES) / IMAGES
        distance = -8.0 + 0.5 * self.random.standard_normal(IMAGES)
        self.centre = np.column_stack([4.2 * np.sin(azimuth), 3.0 * np.cos(azimuth), distance])
        forward = -self.centre / np.linalg.norm(self.centre, axis=1, keepdims=True)
        right = np.cross([0.0, 1.0, 0.0], forward)
        right /= np.linalg.norm(right, axis=1, keepdims=True)
        upright = np.stack([right, np.cross(forward, right), forward], axis=1)
        quarters = np.outer(0.5 * np.pi * np.arange(IMAGES), [0.0, 0.0, 1.0])
        self.rotation = Rotation.from_rotvec(quarters).as_matrix() @ upright
        self.image, self.point = (grid.ravel() for grid in np.indices((IMAGES, POINTS)))
        exact = project(TRUE, self.in_camera(self.centre, self.rotation, self.points))
        self.pixel = exact + SIGMA_PX * self.random.standard_normal(exact.shape)
        self.control = self.points[:CONTROL] + SIGMA_M * self.random.standard_normal((CONTROL, 3))
        turned = Rotation.from_rotvec(0.01 * self.random.standard_normal((IMAGES, 3)))
        self.start = self.reference = turned.as_matrix() @ self.rotation

    def in_camera(self, centre: Floats, rotation: Floats, points: Floats) -> Floats:
        away = points[self.point] - centre[self.image]
        return np.einsum("nij,nj->ni", rotation[self.image], away)

    def residuals(self, unknowns: Floats) -> Floats:
        intrinsic, rest = unknowns[:8], unknowns[8:].reshape(-1, 3)
        centre, vector, points = np.split(rest, [IMAGES, 2 * IMAGES])
        rotation = Rotation.from_rotvec(vector).as_matrix() @ self.reference
        pixel = project(intrinsic, self.in_camera(centre, rotation, points))
        return np.concatenate(
            [
                ((pixel - self.pixel) / SIGMA_PX).ravel(),
                ((points[:CONTROL] - self.control) / SIGMA_M).ravel(),
            ]
        )


def by_scipy(photographs: Photographs) -> OptimizeResult:
    first = np.concatenate(
        [
            [3150.0, 3150.0, 1999.5, 1499.5, 0.0, 0.0, 0.0, 0.0],
            (photographs.centre + 0.05).ravel(),
            np.zeros(3 * IMAGES),
            (photographs.points + 0.02).ravel(),
        ]
    )
    rotations = slice(8 + 3 * IMAGES, 8 + 6 * IMAGES)
    for _ in range(2):  # at last with rotations that are small
        found = least_squares(photographs.residuals, first, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
        first = found.x.copy()
        vector = first[rotations].reshape(-1, 3)
        photographs.reference = Rotation.from_rotvec(vector).as_matrix() @ photographs.reference
        first[rotations] = 0.0
    return found


def by_arrays(photographs: Photographs) -> AdjustmentResult:
    camera = FrameCamera("camera", 4000, 3000, PIXEL, 3150.0 * PIXEL, (0.0, 0.0), "centre", 0)
    of_image = np.zeros(IMAGES, dtype=np.int64)
    model, additional = self_calibration([camera], of_image, "brown-forward:k1,k2,p1,p2,b1")
    interior = SystemParameters(
        FAMILIES["interior_orientation"],
        ("camera",),
        np.array([[camera.focal_length, 0.0, 0.0]]),
        np.ones((1, 3), dtype=bool),
    )
    block = Block(
        frame=CartesianFrame(),
        cameras=(camera,),
        images=tuple(f"i{k}" for k in range(IMAGES)),
        camera_of_image=of_image,
        flights=("",),
        flight_of_image=of_image,
        points=tuple(f"p{k}" for k in range(POINTS)),
        system=(interior, additional),
        projection_centre=photographs.centre + 0.05,
        local_from_camera=np.swapaxes(photographs.start, 1, 2) @ np.diag([1.0, -1.0, -1.0]),
        object_point=photographs.points + 0.02,
    )
    xy = camera.image_from_pixel(photographs.pixel)
    rays = ImagePoints.measured(
        block, photographs.image, photographs.point, xy, SIGMA_PX * PIXEL, self_calibration=model
    )
    control = ControlPoints.surveyed(block, np.arange(CONTROL), photographs.control, SIGMA_M)
    return adjust_block(block, Observations(rays, (control,)))


@pytest.fixture(scope="module")
def both() -> tuple[Photographs, AdjustmentResult, OptimizeResult]:
    photographs = Photographs()
    return photographs, by_arrays(photographs), by_scipy(photographs)


def test_values_are_those_of_the_second_computation(
    both: tuple[Photographs, AdjustmentResult, OptimizeResult],
) -> None:
    _, result, expected = both
    assert result.test.weighted_squares == pytest.approx(2.0 * expected.cost, rel=1e-9)
    assert result.test.redundancy == expected.fun.size - expected.x.size
    c, x0, y0 = result.state.system["interior_orientation"][0]
    k1, k2, p1, p2, b1 = result.state.system["additional_parameters"][0]
    intrinsic = [c * (1.0 + b1) / PIXEL, c / PIXEL, 1999.5 + x0 / PIXEL, 1499.5 - y0 / PIXEL, k1, k2, p1, p2]
    points = result.state.object_point
    found = np.concatenate([intrinsic, result.state.projection_centre.ravel(), points.ravel()])
    of_same = np.r_[: 8 + 3 * IMAGES, 8 + 6 * IMAGES : len(expected.x)]
    sigma = np.sqrt(np.diagonal(np.linalg.inv(expected.jac.T @ expected.jac)))
    assert np.max(np.abs(found - expected.x[of_same]) / sigma[of_same]) < 1e-3


def test_standard_deviations_are_those_of_the_second_computation(
    both: tuple[Photographs, AdjustmentResult, OptimizeResult],
) -> None:
    _, result, expected = both
    sigma = np.sqrt(np.diagonal(np.linalg.inv(expected.jac.T @ expected.jac)))
    of_points = np.sqrt(np.diagonal(result.cofactor.of_points, axis1=1, axis2=2))
    np.testing.assert_allclose(of_points.ravel(), sigma[-3 * POINTS :], rtol=1e-4)
    of_centres = result.to_dataframe("images", sigma0=1.0)[["sigma_x", "sigma_y", "sigma_z"]].to_numpy()
    np.testing.assert_allclose(of_centres.ravel(), sigma[8 : 8 + 3 * IMAGES], rtol=1e-4)
    of_distortion = result.covariance(parameters=["additional_parameters"], sigma0=1.0).sigma
    np.testing.assert_allclose(of_distortion[:4], sigma[4:8], rtol=1e-4)
    # A rotation vector in front of R is a small rotation in the camera frame of OpenCV: y and z turned.
    of_rotations = result.to_dataframe("images", sigma0=1.0).filter(like="sigma_rotation").to_numpy()
    np.testing.assert_allclose(of_rotations.ravel(), sigma[8 + 3 * IMAGES : 8 + 6 * IMAGES], rtol=1e-3)


def test_residuals_are_sorted_by_object_point(
    both: tuple[Photographs, AdjustmentResult, OptimizeResult],
) -> None:
    photographs, result, expected = both
    order = np.argsort(photographs.point, kind="stable")
    group = result.groups[0]
    np.testing.assert_array_equal(group.group.point, photographs.point[order])
    # Adjusted − observed; of a distortion the residual is that of the measured point.
    pixels = SIGMA_PX * expected.fun[: 2 * len(order)].reshape(-1, 2)[order] * [1.0, -1.0]
    np.testing.assert_allclose(group.residual / PIXEL, pixels, rtol=0.0, atol=1e-5)
