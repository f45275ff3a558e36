"""Heads that are exposed late: where the body has carried them, with a camera that is misaligned to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block, estimate_block
from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.parameters import BORESIGHT, ConsideredParameters, ParameterPlace, State
from adjust.quality.late_heads import unknown_carriage
from adjust.result_columns import sigma_of_images
from adjust.rig import RELATIVE_POSITION, RELATIVE_ROTATION, SYNCHRONISATION_OFFSET
from adjust.solve.design_matrix import design_matrix
from tasks.evaluation.adjustment_figures import late_head_figures
from tests.adjust.scenes import DEGREE, Scene, two_strips

# Largest boresight that the mounting does not contain.
_TURNED = np.array([1.0, -0.8, 0.6]) * DEGREE


def turned(**switches: object) -> Scene:
    """A block whose first camera is misaligned by a degree; its heads are exposed some milliseconds late."""
    scene = two_strips(heads=3, synchronised=False, **switches)
    boresight = scene.truth.system[BORESIGHT].copy()
    boresight[0] = _TURNED
    return replace(scene, truth=replace(scene.truth, system={**scene.truth.system, BORESIGHT: boresight}))


def carried(state: State) -> tuple[Floats, Floats]:
    """Poses of the pictures from the path of the body in the local frame, one picture after the other."""
    rig, system = state.rig, state.system
    assert rig is not None
    assert rig.motion is not None
    centres, axes = [], []
    for event, head in zip(rig.event_of_image, rig.camera_of_image, strict=True):
        reference = rig.reference[head]
        inertial_from_camera = (
            rotation.from_roll_pitch_yaw(system[BORESIGHT][reference]) @ rig.body_from_camera[reference]
        )
        body = state.local_from_camera[event] @ inertial_from_camera.T
        later = system[SYNCHRONISATION_OFFSET][head, 0]
        centre = state.projection_centre[event] + body @ rig.motion.velocity[event] * later
        body = body @ rotation.exp(rig.motion.rate[[event]] * later)[0]
        camera = body @ inertial_from_camera
        nominal = camera @ rig.body_from_camera[reference].T
        centres.append(centre + nominal @ system[RELATIVE_POSITION][head])
        turn = rotation.from_roll_pitch_yaw(system[RELATIVE_ROTATION][head])
        axes.append(nominal @ turn @ rig.body_from_camera[head])
    return np.array(centres), np.array(axes)


def test_a_late_head_is_where_the_body_has_carried_it() -> None:
    """With the nominal mounting alone it was up to 1.5 mm off."""
    state = turned(cameras=2).truth
    centres, axes = carried(state)
    np.testing.assert_allclose(state.pictures.projection_centre, centres, atol=1e-9)
    np.testing.assert_allclose(state.pictures.local_from_camera, axes, atol=1e-12)


FREE = {BORESIGHT: True, RELATIVE_ROTATION: True, SYNCHRONISATION_OFFSET: True}


def test_a_boresight_that_is_estimated_carries_the_heads() -> None:
    """Exact observations, boresight given as zero: with that in the motion, pictures were 0.7 mm off."""
    scene = two_strips(heads=3, synchronised=False, turning=True, free=FREE, start_seed=5)
    result = adjust_block(scene.block, scene.observations)
    for family, tolerance in ((BORESIGHT, 1e-9), (RELATIVE_ROTATION, 1e-9), (SYNCHRONISATION_OFFSET, 1e-8)):
        found, true = result.state.system[family], scene.truth.system[family]
        np.testing.assert_allclose(found, true, atol=tolerance)
    centres, axes = carried(result.state)
    np.testing.assert_allclose(result.state.pictures.projection_centre, centres, atol=2e-6)
    np.testing.assert_allclose(result.state.pictures.local_from_camera, axes, atol=2e-9)
    estimate = estimate_block(scene.block, scene.observations)
    np.testing.assert_allclose(estimate.state.object_point, scene.truth.object_point, atol=1e-6)


def test_the_boresight_that_carries_heads_is_as_well_as_known() -> None:
    """As an unknown of the motion σ would be 2e-5 smaller, and values another 3e-4 σ."""
    scene = two_strips(heads=3, synchronised=False, turning=True, free=FREE, noise_seed=5)
    result = adjust_block(scene.block, scene.observations)
    system, state = result.system, result.state
    design = design_matrix(system, state)
    known, rays = design.matrix.toarray(), system.observations.image_points
    of_boresight = design.border_columns[system.layout.columns[BORESIGHT][0]]
    every, of_rays = known.copy(), slice(design.row_start[0], design.row_start[1])
    for k, column in enumerate(of_boresight):
        ends = []
        for step in (1e-4, -1e-4):
            boresight = state.system[BORESIGHT].copy()
            boresight[0, k] += step
            ends.append(rays.misclosure(replace(state, rig=state.rig.moving_by(boresight))))
        every[of_rays, column] -= ((ends[0] - ends[1]) / 2e-4 * rays.inverse_sigma).ravel()
    sigma, smaller = (np.sqrt(np.diagonal(np.linalg.inv(a.T @ a))) for a in (known, every))
    step = np.linalg.solve(every.T @ every, every.T @ design.misclosure)
    assert np.max(sigma / smaller) < 1.0 + 1e-4
    assert np.abs(step / sigma).max() < 1e-3


@pytest.mark.parametrize("considered", [False, True])
def test_what_errors_of_the_boresight_mean_for_late_heads(considered: bool) -> None:
    """Movements of the projection centres by numeric derivatives, for attitudes of half a degree."""
    free = {} if considered else {BORESIGHT: True}
    scene = two_strips(heads=3, synchronised=False, free=free, noise_seed=5, sigma_ins_rad=0.5 * DEGREE)
    block, sigma = scene.block, np.deg2rad([0.5, 0.3, 0.9])
    if considered:
        places = tuple(ParameterPlace(BORESIGHT, 0, k) for k in range(3))
        block = replace(block, considered=ConsideredParameters(places, np.diag(sigma**2)))
    result = adjust_block(block, scene.observations)
    covariance = np.diag(sigma**2)
    if not considered:
        covariance = result.covariance((), (), (BORESIGHT,)).matrix
    state, ends = result.state, []
    assert state.rig is not None
    for k in range(3):
        both = []
        for step in (1e-4, -1e-4):
            boresight = state.system[BORESIGHT].copy()
            boresight[0, k] += step
            both.append(replace(state, rig=state.rig.moving_by(boresight)).pictures.projection_centre)
        ends.append((both[0] - both[1]) / 2e-4)
    moved = np.stack(ends, axis=2)
    expected = np.sqrt(np.linalg.eigvalsh(moved @ covariance @ np.swapaxes(moved, 1, 2))[:, -1])
    found, part = unknown_carriage(result)
    np.testing.assert_allclose(found, expected, rtol=0.02, atol=1e-9)
    np.testing.assert_allclose(part, found / sigma_of_images(result)[:, :3].min(axis=1))
    assert found[block.camera_of_image == 0].max() == 0.0 < found[block.camera_of_image > 0].min()


def test_heads_are_named_that_a_weak_boresight_carries_elsewhere() -> None:
    known = {"free": {BORESIGHT: True}, "noise_seed": 5, "sigma_gnss_m": 0.01}
    scenes = [
        two_strips(heads=3, synchronised=False, sigma_ins_rad=own * DEGREE, **known) for own in (0.005, 5.0)
    ]
    usual, weak = (late_head_figures(adjust_block(one.block, one.observations)) for one in scenes)
    assert not usual
    assert [item.head for item in weak] == ["forward_1", "forward_2"]
    assert all(0.1 < item.part_of_sigma < 1.0 and 0.001 < item.sigma_m < 0.02 for item in weak)
