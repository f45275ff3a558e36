"""Joint covariances of orientations, next to those that Ceres computes of the same block."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.arrays import Floats
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


def largest(values: Floats) -> float:
    return float(np.abs(values).max())
