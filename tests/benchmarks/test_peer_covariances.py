"""Joint covariances of orientations and of a camera, next to those that Ceres computes of the same block."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.arrays import Floats
from adjust.block import Block
from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.register import additional_parameters
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.parameters import (
    ADDITIONAL_PARAMETERS,
    INTERIOR_ORIENTATION,
    SystemParameters,
    additional_family,
)
from adjust.solve.system import Observations
from benchmarks.problem import block_of
from benchmarks.workload import Workload, simulated

STRIPS = Workload("strips", 3, 10)


def test_covariances_between_images_are_those_of_ceres() -> None:
    """Of all pairs with common points; relative to the product of both σ."""
    pytest.importorskip("pycolmap", reason="the peer is an extra")
    from benchmarks.colmap import PeerWithCovariances

    problem = simulated(STRIPS)
    result = adjust_block(*block_of(problem))
    cofactor, images = result.cofactor.reduced, np.arange(len(problem.projection_centre))
    one, other = (side.ravel() for side in np.meshgrid(images, images))
    there = (one <= other) & (cofactor.pattern.find(one, other) >= 0)
    one, other = one[there], other[there]
    assert len(one) > 200
    peer = PeerWithCovariances(problem)
    peer.run()
    theirs = peer.covariances(one, other)
    sigma = np.sqrt(np.diagonal(cofactor.of_exposures, axis1=1, axis2=2))
    difference = (cofactor.between(one, other) - theirs) / (sigma[one][:, :, None] * sigma[other][:, None, :])
    # Both are derivatives at nearly the same values: the peer ends at 1e-8 of its cost.
    assert largest(difference) < 1e-7
    assert largest(cofactor.between(one, other)[one != other]) > 0.0


def test_a_self_calibration_is_that_of_ceres() -> None:
    """c, x0, y0, k1 and k2 of the RADIAL camera, with their joint covariance."""
    pycolmap = pytest.importorskip("pycolmap", reason="the peer is an extra")
    from benchmarks.colmap import PeerWithCovariances

    problem = simulated(STRIPS)
    block, observations = _with_free_camera(*block_of(problem))
    result = adjust_block(block, observations)
    state, cofactor = result.state.system, result.cofactor.reduced.corner
    sigma = np.sqrt(np.diag(cofactor))
    peer = PeerWithCovariances(problem, free_camera=True, tolerance=1e-12)
    camera = peer.reconstruction.camera(1)
    camera.model, camera.params = pycolmap.CameraModelId.RADIAL, [*camera.params, 0.0, 0.0]
    peer.run()
    # Image coordinates of the peer are in units of their σ, y down.
    unit = problem.sigma_image[0]
    ours_by_theirs = np.diag([unit, unit, -unit, 1.0, 1.0])
    values = np.concatenate([state[INTERIOR_ORIENTATION][0], state[ADDITIONAL_PARAMETERS][0]])
    assert largest((values - ours_by_theirs @ camera.params) / sigma) < 2e-4
    theirs = ours_by_theirs @ peer.found.get_other_params_cov(camera.params) @ ours_by_theirs.T
    assert largest((cofactor - theirs) / np.outer(sigma, sigma)) < 1e-6


def _with_free_camera(block: Block, observations: Observations) -> tuple[Block, Observations]:
    """The block with its interior orientation and two radial parameters free."""
    (camera,) = block.cameras
    image_format = ImageFormat(*camera.half_format, focal_length=camera.focal_length)
    radial = additional_parameters("brown-forward:k1-k2", image_format)
    system = tuple(
        replace(item, free=np.ones((1, 3), dtype=bool)) if item.family.name == INTERIOR_ORIENTATION else item
        for item in block.system
    )
    family = additional_family(radial.names, radial.units)
    own = SystemParameters(family, (camera.name,), np.zeros((1, 2)), np.ones((1, 2), dtype=bool))
    of_image = np.zeros(len(block.images), dtype=np.int64)
    calibration = SelfCalibration.of(radial.names, (radial,), of_image)
    rays = replace(observations.image_points, self_calibration=calibration)
    return replace(block, system=(*system, own)), replace(observations, image_points=rays)


def largest(values: Floats) -> float:
    return float(np.abs(values).max())
