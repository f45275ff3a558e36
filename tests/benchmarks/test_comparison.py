"""Ours beside the peer on a block so small that it takes a second."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import estimate_block
from benchmarks.comparison import DisagreementError, agreement_of, compare
from benchmarks.problem import block_of, cost, solution_of
from benchmarks.workload import Workload, simulated

TINY = Workload("tiny", 3, 6)


def test_the_peer_holds_the_same_block_with_the_same_cost() -> None:
    pytest.importorskip("pycolmap", reason="the peer is an extra")
    from benchmarks.colmap import Peer

    problem = simulated(TINY)
    # Axes in which the positions are weighted differently and that are not those of the frame.
    turned = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    problem = replace(
        problem,
        interior=problem.interior + np.array([0.0, 4e-5, -7e-5]),
        position_sigma=problem.position_sigma * [0.5, 1.0, 3.0],
        local_from_enu=problem.local_from_enu @ turned,
    )
    peer = Peer(problem)
    start = peer.solution()
    np.testing.assert_allclose(start.projection_centre, problem.projection_centre, atol=1e-8)
    np.testing.assert_allclose(start.local_from_camera, problem.local_from_camera, atol=1e-12)
    report = peer.run()
    ours = solution_of(estimate_block(*block_of(problem)).state)
    agreement_of(problem, ours, peer.solution()).require()
    # The peer's own figure is half of vPv, printed with seven digits.
    words = report.replace(",", "").split()
    said = [float(words[k + 1]) for k, word in enumerate(words) if word == "cost:"]
    assert said[0] == pytest.approx(0.5 * cost(problem, problem.start), rel=1e-6)
    assert said[1] == pytest.approx(0.5 * cost(problem, ours), rel=1e-6)
    peer.reset()
    np.testing.assert_array_equal(peer.solution().object_point, problem.object_point)


def test_a_comparison_times_both_sides_in_turn() -> None:
    pytest.importorskip("pycolmap", reason="the peer is an extra")
    records = bare, complete, of_both = compare(TINY, runs=2)
    assert [record.name for record in records] == ["tiny", "tiny-statistics", "tiny-covariances"]
    for record in records:
        assert record.images == 18
        assert record.runs == 2
        assert record.peer_s is not None
        assert record.ratio == pytest.approx(record.peer_s / record.ours_s)
        assert 0.0 < record.ours_min_s <= record.ours_s <= record.ours_max_s
        assert record.peak_memory_mib is not None
        assert record.peak_memory_mib > 50.0
    assert bare.peer_s == complete.peer_s != of_both.peer_s
    assert complete.ours_s == of_both.ours_s


def test_solutions_that_differ_are_not_compared() -> None:
    problem = simulated(TINY)
    ours = solution_of(estimate_block(*block_of(problem)).state)
    agreement_of(problem, ours, ours).require()
    moved = ours.projection_centre.copy()
    moved[7, 2] += 0.02
    with pytest.raises(DisagreementError, match="positions"):
        agreement_of(problem, ours, replace(ours, projection_centre=moved)).require()
