"""All strips together with errors of the block: closed cases."""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.calibration.adjusted_strips import StripErrors
from adjust.calibration.joint_strips import JointStrips
from adjust.calibration.strip_comparison import StripComparison
from adjust.calibration.strip_means import StripMeans
from adjust.calibration.strip_offsets import linear_fit, membership
from tests.adjust.calibration.strips_flown import RULE, remounted, strips_flown


def test_without_errors_of_the_block_it_is_the_comparison_by_scatter() -> None:
    strips = strips_flown(np.random.default_rng(1), (8, 9))
    remounted(strips, strips.flight == 1, (0.004, 0.0, 0.002), (0.1, -0.05))
    joint = JointStrips.of(strips, strips.flight, StripErrors(np.zeros((17, 6, 17, 6))), RULE.strip_sigma)
    comparison = StripComparison.of(strips, strips.flight)
    found, covariance = joint.differences(1, 0)
    expected, spread = comparison.differences(1, 0)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    scatter = np.array([*(fit.variance for fit in comparison.misalignment), comparison.plan.variance])
    by_scatter = (np.diagonal(spread) * (scatter / comparison.variance)[[0, 1, 2, 3, 3]]).tolist()
    np.testing.assert_allclose(np.diagonal(covariance), by_scatter, rtol=1e-6)
    np.testing.assert_allclose(joint.freedom, [15.0, 15.0, 15.0, 34.0 - 8.0], rtol=1e-6)
    assert not joint.explained.any()


def test_a_free_tilt_of_the_block_is_an_unknown_of_the_strips() -> None:
    """Roll −sin ψ and pitch cos ψ of a tilt about north whose σ is a degree."""
    strips = strips_flown(np.random.default_rng(2), (20,))
    mounting = (np.arange(20) % 8 > 3).astype(np.int64)
    tilt = np.zeros((20, 6))
    tilt[:, 0], tilt[:, 1] = -np.sin(strips.heading), np.cos(strips.heading)
    tilt *= np.deg2rad(1.0)
    errors = StripErrors(np.einsum("ij,kl->ijkl", tilt, tilt))
    calm = JointStrips.of(strips, mounting, errors, RULE.strip_sigma)
    strips.mean[:, :3] += 0.1 * tilt[:, :3]
    joint = JointStrips.of(strips, mounting, errors, RULE.strip_sigma)
    # A tenth of a degree changes nothing but what the block explains.
    np.testing.assert_allclose(joint.explained - calm.explained, 0.1 * tilt[:, :5], atol=np.deg2rad(1e-5))
    np.testing.assert_allclose(joint.differences(1, 0)[0], calm.differences(1, 0)[0], atol=np.deg2rad(1e-5))
    # Least squares of roll and pitch with the tilt as an unknown, in units of their σ.
    members = membership(mounting)
    noise = np.sqrt([_variance(joint, strips, members, axis) for axis in (0, 1)])
    design = np.vstack(
        [
            np.hstack([np.kron(np.eye(2)[axis], members), tilt[:, axis : axis + 1]]) / noise[axis]
            for axis in (0, 1)
        ]
    )
    fit = linear_fit(design, np.concatenate([strips.mean[:, axis] / noise[axis] for axis in (0, 1)]))
    expected = [fit.solution[1] - fit.solution[0], fit.solution[3] - fit.solution[2]]
    np.testing.assert_allclose(joint.differences(1, 0)[0][:2], expected, atol=np.deg2rad(1e-5))


def _variance(joint: JointStrips, strips: StripMeans, members: Floats, axis: int) -> float:
    """Of what roll or pitch show beyond mounting and tilt: what makes their squares fit."""
    left = strips.mean[:, axis] - joint.explained[:, axis]
    return linear_fit(members, left).squares / float(joint.freedom[axis])


def test_what_one_direction_does_not_say_is_not_compared() -> None:
    strips = strips_flown(np.random.default_rng(3), (6, 6), (10.0,))
    errors = StripErrors(np.zeros((12, 6, 12, 6)))
    joint = JointStrips.of(strips, strips.flight, errors, RULE.strip_sigma)
    difference, _ = joint.differences(1, 0)
    assert np.isfinite(difference[:3]).all()
    assert np.isnan(difference[3:]).all()
    assert joint.differing(1, 0, np.zeros(4)) > 0.0
    # No angle differs by as much as this.
    assert joint.differing(1, 0, np.full(4, 1.0)) == 1.0
