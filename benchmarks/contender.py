"""What is timed: an adjustment that starts from the arrays of a problem."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from adjust.adjustment import adjust_block, estimate_block
from adjust.options import AdjustmentOptions
from benchmarks.problem import Problem, Solution, block_of, solution_of

#: The names of the contenders, ours first; a process is started for each of them.
ESTIMATE, STATISTICS = "estimate", "statistics"
PEER, PEER_COVARIANCES = PEERS = "colmap", "colmap-covariances"
CONTENDERS = (ESTIMATE, STATISTICS, *PEERS)


class Contender(Protocol):
    """One way to adjust a problem."""

    def reset(self) -> None:
        """Go back to the start values; not timed."""
        ...

    def run(self) -> str:
        """Adjust; timed. Returns what it says about the iteration."""
        ...

    def solution(self) -> Solution:
        """The adjusted values of the last run."""
        ...


class Estimate:
    """Ours, values only: block, symbolic analysis, iteration to convergence."""

    def __init__(self, problem: Problem, threads: int) -> None:
        self.problem = problem
        self.options = AdjustmentOptions(threads=threads)
        self.found: Solution = problem.start

    def reset(self) -> None:
        """Nothing: every run begins with the arrays."""

    def run(self) -> str:
        """Adjust."""
        estimate = estimate_block(*block_of(self.problem), self.options)
        self.found = solution_of(estimate.state)
        return f"{len(estimate.iterations)} iterations, vPv {estimate.weighted_squares:.6f}"

    def solution(self) -> Solution:
        """The adjusted values of the last run."""
        return self.found


class Statistics(Estimate):
    """Ours with marginal covariances of all exposures and points and all redundancy numbers."""

    def run(self) -> str:
        """Adjust, with all statistics."""
        result = adjust_block(*block_of(self.problem), self.options)
        self.found = solution_of(result.state)
        redundancy = sum(group.redundancy_sum for group in result.groups)
        return f"{len(result.iterations[0])} iterations, Σr {redundancy:.4f} of {result.test.redundancy}"


def _peer(problem: Problem, threads: int) -> Contender:
    # An extra: imported where it is requested, and never in the process of another contender.
    from benchmarks.colmap import Peer

    return Peer(problem, threads)


def _peer_with_covariances(problem: Problem, threads: int) -> Contender:
    from benchmarks.colmap import PeerWithCovariances

    return PeerWithCovariances(problem, threads)


_MAKERS: dict[str, Callable[[Problem, int], Contender]] = {
    ESTIMATE: Estimate,
    STATISTICS: Statistics,
    PEER: _peer,
    PEER_COVARIANCES: _peer_with_covariances,
}


def contender(name: str, problem: Problem, threads: int) -> Contender:
    """The contender of a name, with the problem already in its own terms."""
    return _MAKERS[name](problem, threads)
