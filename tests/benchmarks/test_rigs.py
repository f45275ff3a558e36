"""The benchmark of rigs compares the same pictures, with the same weight of their readings."""

from __future__ import annotations

import numpy as np

from adjust.observations.gnss_position import GnssPositions
from benchmarks.rigs import alone, flown


def test_single_cameras_have_the_pictures_and_readings_of_the_rig() -> None:
    block, observations = flown(2, 3)
    single, own = alone(block, observations)
    assert block.rig is not None
    assert single.rig is None
    assert len(block.events) == 6
    assert len(single.events) == len(block.images) == 30
    ours, theirs = (
        one.image_points.misclosure(other.approximate_state())
        for one, other in ((observations, block), (own, single))
    )
    np.testing.assert_allclose(ours, theirs, atol=1e-12)
    together, each = observations.others[0], own.others[0]
    assert isinstance(together, GnssPositions)
    assert isinstance(each, GnssPositions)
    weights = [np.sum(one.stochastic.sigma**-2) for one in (together, each)]
    np.testing.assert_allclose(weights[0], weights[1])
