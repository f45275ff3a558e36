"""All strips together with errors of the block: closed cases."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize

from adjust.arrays import Floats
from adjust.calibration.adjusted_strips import StripErrors
from adjust.calibration.joint_strips import JointStrips
from adjust.calibration.strip_comparison import StripComparison
from adjust.calibration.strip_means import StripMeans
from adjust.calibration.strip_offsets import body_fixed, linear_fit, membership
from tests.adjust.calibration.strips_flown import RULE, remounted, strips_flown


@pytest.mark.parametrize("flights", [(8, 9), (2, 3)])
def test_without_errors_of_the_block_it_is_the_comparison_by_scatter(flights: tuple[int, int]) -> None:
    k = sum(flights)
    strips = strips_flown(np.random.default_rng(1), flights)
    remounted(strips, strips.flight == 1, (0.004, 0.0, 0.002), (0.1, -0.05))
    joint = JointStrips.of(strips, strips.flight, StripErrors(np.zeros((k, 6, k, 6))), RULE.strip_sigma)
    comparison = StripComparison.of(strips, strips.flight)
    found, covariance = joint.differences(1, 0)
    expected, spread = comparison.differences(1, 0)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    scatter = np.array([*(fit.variance for fit in comparison.misalignment), comparison.plan.variance])
    by_scatter = (np.diagonal(spread) * (scatter / comparison.variance)[[0, 1, 2, 3, 3]]).tolist()
    np.testing.assert_allclose(np.diagonal(covariance), by_scatter, rtol=1e-6)
    np.testing.assert_allclose(joint.freedom, [k - 2.0] * 3 + [2.0 * k - 8.0], rtol=1e-6)
    assert not joint.explained.any()


def test_strips_are_not_taken_for_better_than_a_twentieth_of_their_stated_errors() -> None:
    calm = strips_flown(np.random.default_rng(1), (8, 9), attitude_deg=(1e-6, 1e-6, 1e-6), position_m=1e-5)
    joint = JointStrips.of(calm, calm.flight, StripErrors(np.zeros((17, 6, 17, 6))), RULE.strip_sigma)
    sigma = 0.05 * RULE.strip_sigma[:3] * np.sqrt(1.0 / 8.0 + 1.0 / 9.0)
    np.testing.assert_allclose(np.sqrt(np.diagonal(joint.differences(1, 0)[1])[:3]), sigma, rtol=1e-9)


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


def test_it_is_the_most_probable_of_full_matrices() -> None:
    """Variances by maximising the restricted likelihood, with a design written down from the signs."""
    random = np.random.default_rng(4)
    strips, k = strips_flown(random, (10, 12)), 22
    mounting = np.arange(k) % 3 // 2
    size = np.append(np.deg2rad([0.002, 0.001, 0.003]), [0.05, 0.04])
    root = np.tile(size, k)[:, None] * random.normal(size=(5 * k, 12)) / 3.0
    known = root @ root.T
    errors = np.zeros((k, 6, k, 6))
    errors[:, :5, :, :5] = known.reshape(k, 5, k, 5)
    values = np.hstack([strips.mean[:, :3], strips.mean[:, 6:8]]).ravel() + root @ random.normal(size=12)
    strips.mean[:, [0, 1, 2, 6, 7]] = values.reshape(k, 5)
    design = np.zeros((k, 5, 4 + 10))
    for strip, (mounted, heading) in enumerate(zip(mounting, strips.heading, strict=True)):
        design[strip, 3:, 2 * strips.flight[strip] :][:, :2] = np.eye(2)
        design[strip, :3, 4 + 3 * mounted :][:, :3] = np.eye(3)
        forward, right = [np.sin(heading), np.cos(heading)], [np.cos(heading), -np.sin(heading)]
        design[strip, 3:, 10 + 2 * mounted :][:, :2] = np.column_stack([forward, right])
    x, which = design.reshape(5 * k, -1), np.tile([0, 1, 2, 3, 3], k)

    def loss(logarithms: Floats) -> float:
        covariance = known + np.diag((RULE.strip_sigma**2 * np.exp(logarithms))[which])
        weight = np.linalg.inv(covariance)
        normal = x.T @ weight @ x
        left = values - x @ np.linalg.solve(normal, x.T @ weight @ values)
        logs = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(normal)[1]
        return float(0.5 * (logs + left @ weight @ left))

    lowest = 2.0 * np.log(0.05)
    found = optimize.minimize(loss, np.full(4, -2.0), method="L-BFGS-B", bounds=[(lowest, 8.0)] * 4)
    noise = (RULE.strip_sigma**2 * np.exp(found.x))[which]
    weight = np.linalg.inv(known + np.diag(noise))
    cofactor = np.linalg.inv(x.T @ weight @ x)
    solution = cofactor @ x.T @ weight @ values
    projector = weight - weight @ x @ cofactor @ x.T @ weight
    assert np.all(found.x > lowest)
    joint = JointStrips.of(strips, mounting, StripErrors(errors), RULE.strip_sigma)
    contrast = np.zeros((5, 14))
    contrast[:3, 4:7], contrast[:3, 7:10] = -np.eye(3), np.eye(3)
    contrast[3:, 10:12], contrast[3:, 12:] = -np.eye(2), np.eye(2)
    difference, covariance = joint.differences(1, 0)
    sigma = np.sqrt(np.diagonal(contrast @ cofactor @ contrast.T))
    np.testing.assert_allclose(difference / sigma, contrast @ solution / sigma, atol=0.01)
    np.testing.assert_allclose(np.sqrt(np.diagonal(covariance)), sigma, rtol=0.01)
    explained = (known @ weight @ (values - x @ solution)).reshape(k, 5)
    np.testing.assert_allclose(joint.explained / size, explained / size, atol=0.02)
    freedom = np.bincount(which, noise * np.diagonal(projector))
    np.testing.assert_allclose(joint.freedom, freedom, rtol=0.02)


def test_what_the_block_explains_is_taken_off_in_all_axes() -> None:
    strips = strips_flown(np.random.default_rng(6), (9, 9))
    root = np.zeros((18, 6))
    root[:, 1], root[:, 3], root[:, 4] = np.deg2rad(0.01), 0.3, np.linspace(-0.2, 0.2, 18)
    strips.mean[:, :3] += 2.0 * root[:, :3]
    turn = body_fixed(strips.heading, np.arange(18))
    strips.mean[:, 6:8] += 2.0 * root[:, 3:5]
    strips.mean[:, 3:5] = (turn.T @ strips.mean[:, 6:8].ravel()).reshape(-1, 2)
    errors = StripErrors(np.einsum("ij,kl->ijkl", root, root))
    joint = JointStrips.of(strips, np.zeros(18, dtype=np.int64), errors, RULE.strip_sigma)
    assert np.abs(joint.explained[:, 4]).max() > 0.1
    left = joint.less_explained(strips)
    np.testing.assert_allclose(left.mean[:, :3], strips.mean[:, :3] - joint.explained[:, :3], atol=1e-15)
    np.testing.assert_allclose(left.mean[:, 6:8], strips.mean[:, 6:8] - joint.explained[:, 3:], atol=1e-12)
    in_body = (turn.T @ left.mean[:, 6:8].ravel()).reshape(-1, 2)
    np.testing.assert_allclose(left.mean[:, 3:5], in_body, atol=1e-12)
    np.testing.assert_array_equal(left.mean[:, [5, 8]], strips.mean[:, [5, 8]])


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


@pytest.mark.parametrize("hidden", ["roll", "forward"])
def test_what_errors_of_the_block_hide_is_not_compared(hidden: str) -> None:
    """Errors of 300 σ of a strip that look like another roll, or another forward, of the second mounting."""
    strips = strips_flown(np.random.default_rng(5), (16,))
    mounting = (np.arange(16) % 8 > 3).astype(np.int64)
    like, sign = np.zeros((16, 6)), 2.0 * mounting - 1.0
    if hidden == "roll":
        like[:, 0] = 300.0 * RULE.strip_sigma[0] * sign
    else:
        heading = np.column_stack([np.sin(strips.heading), np.cos(strips.heading)])
        like[:, 3:5] = 300.0 * RULE.strip_sigma[3] * sign[:, None] * heading
    errors = StripErrors(np.einsum("ij,kl->ijkl", like, like))
    found, covariance = JointStrips.of(strips, mounting, errors, RULE.strip_sigma).differences(1, 0)
    # Of an offset in plan the length is tested, so that one component alone says nothing.
    said = np.array([False, True, True, True, True] if hidden == "roll" else [True] * 3 + [False] * 2)
    np.testing.assert_array_equal(np.isfinite(found), said)
    np.testing.assert_array_equal(np.isfinite(covariance), np.outer(said, said))
