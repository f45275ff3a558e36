"""Errors of the means of strips against dense matrices and adjustments with other values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block, estimate_block
from adjust.arrays import Floats
from adjust.calibration.adjusted_strips import StripErrors, adjusted_strip_errors
from adjust.calibration.orientation_differences import OrientationPairs, orientation_differences
from adjust.geometry import rotation
from adjust.georeferencing.error_sources import CalibrationErrors
from adjust.parameters import INTERIOR_ORIENTATION, State
from adjust.result import AdjustmentResult
from adjust.solve.design_matrix import design_matrix, full_normals
from adjust.solve.system import System
from tests.adjust.scenes import Scene, two_strips

SIGMA0 = 1.4
#: Two strips; the last image is of none.
STRIP = np.array([0] * 5 + [1] * 4 + [-1])


@pytest.fixture(scope="module")
def adjusted() -> tuple[Scene, AdjustmentResult, Floats]:
    """A block of two cameras, of which one stands across, with some image points rejected; its adjustment.

    Axes east, north, up differ from image to image.
    """
    scene = two_strips(noise_seed=3, cameras=2)
    rays = scene.observations.image_points
    rejected = np.random.default_rng(5).random(len(rays.image)) < 0.1
    scene = replace(scene, observations=replace(scene.observations, image_points=rays.without(rejected)))
    axes = rotation.exp(0.3 * np.sin(np.arange(30.0)).reshape(10, 3))
    return scene, adjust_block(scene.block, scene.observations), axes


def means(scene: Scene, axes: Floats, observed: State, adjusted: State) -> Floats:
    """(2, 6) roll, pitch, yaw and east, north, up of the strips: adjusted against observed orientations."""
    mounting = scene.block.body_from_camera
    pairs = OrientationPairs(
        adjusted.projection_centre,
        adjusted.local_from_camera,
        observed.projection_centre,
        observed.local_from_camera @ np.swapaxes(mounting, 1, 2),
        mounting,
        axes,
    )
    none = np.zeros(10, dtype=np.int64)
    found = orientation_differences(pairs, none, none, np.arange(10.0), np.ones(10))
    each = np.hstack([found.misalignment, found.shift])
    return np.array([each[strip == STRIP].mean(axis=0) for strip in (0, 1)])


def test_they_are_those_of_the_orientations_of_the_whole_block(
    adjusted: tuple[Scene, AdjustmentResult, Floats],
) -> None:
    scene, result, axes = adjusted
    normal, _ = full_normals(design_matrix(System.of(scene.block, scene.observations), result.state))
    step, functional = 1e-6, np.zeros((12, 60))
    layout = scene.block.layout
    nothing = np.zeros(layout.border), np.zeros((layout.points, 3))
    for column in range(60):
        moved = np.zeros((10, 6))
        moved.flat[column] = step
        state = layout.update(result.state, moved, nothing[0], nothing[1])
        functional[:, column] = means(scene, axes, result.state, state).ravel() / step
    expected = SIGMA0**2 * functional @ np.linalg.inv(normal)[:60, :60] @ functional.T
    found = adjusted_strip_errors(scene.block, result, STRIP, axes, sigma0=SIGMA0)
    scale = np.sqrt(np.diagonal(expected))
    np.testing.assert_allclose(
        found.covariance.reshape(12, 12) / np.outer(scale, scale),
        expected / np.outer(scale, scale),
        atol=1e-5,
    )


def test_held_interior_orientations_move_them_as_adjustments_with_others_do(
    adjusted: tuple[Scene, AdjustmentResult, Floats],
) -> None:
    """c, x0 and y0 of both cameras, with correlated errors."""
    scene, result, axes = adjusted
    half = 5e-6 * np.random.default_rng(4).normal(size=(6, 6))
    errors = CalibrationErrors({INTERIOR_ORIENTATION: np.arange(6).reshape(2, 3)}, half @ half.T)
    without = adjusted_strip_errors(scene.block, result, STRIP, axes).covariance
    added = adjusted_strip_errors(scene.block, result, STRIP, axes, errors).covariance - without

    def moved(change: Floats) -> Floats:
        system = tuple(
            replace(item, values=item.values + change) if item.family.name == INTERIOR_ORIENTATION else item
            for item in scene.block.system
        )
        other = estimate_block(replace(scene.block, system=system), scene.observations).state
        return means(scene, axes, result.state, other).ravel()

    by_each = np.array([moved(change.reshape(2, 3)) for change in half.T])
    scale = np.linalg.norm(by_each, axis=0)
    expected = by_each.T @ by_each / np.outer(scale, scale)
    np.testing.assert_allclose(added.reshape(12, 12) / np.outer(scale, scale), expected, atol=0.01)


def test_along_the_axes_of_the_body_they_are_those_of_the_map_turned_to_the_headings() -> None:
    half = np.random.default_rng(5).normal(size=(12, 12))
    errors = StripErrors((half @ half.T).reshape(2, 6, 2, 6))
    heading = np.array([0.4, -2.0])
    found = errors.of_components(heading)
    for k, component in enumerate((0, 1, 2, None, None, 5, 3, 4, 5)):
        if component is not None:
            np.testing.assert_array_equal(found[k], errors.covariance[:, component, :, component])
    forward = np.stack([np.sin(heading), np.cos(heading)], axis=1)
    right = np.stack([np.cos(heading), -np.sin(heading)], axis=1)
    in_plan = errors.covariance[:, 3:5, :, 3:5]
    for k, way in ((3, forward), (4, right)):
        np.testing.assert_allclose(found[k], np.einsum("ai,aibj,bj->ab", way, in_plan, way))
