"""Whether the model of an adjusted block is incomplete: tests of its alternatives.

An error of the model first looks like gross errors: of a camera that was remounted all attitudes of a day are
rejected, and what is left shows nothing. Where much of a group was rejected, all of it comes back before
the alternatives are tested.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adjust.block import Block
from adjust.observations.base import ObservationGroup
from adjust.one_thread import one_thread
from adjust.options import AdjustmentOptions
from adjust.parameters import State
from adjust.quality.alternative_products import ModelAlternative
from adjust.quality.model_alternatives import AlternativeTests, alternative_tests
from adjust.result import AdjustmentResult, GroupResult
from adjust.solve.gauss_newton import iterate
from adjust.solve.system import Observations, System

#: Part of a group, and number of its observations, from which those that were rejected come back.
MANY, SEVERAL = 0.05, 3
# The same of a group of few, where those that are left may be the wrong ones.
_THIRD, _TWO = 1.0 / 3.0, 2
# Redundancy numbers of what is left after most was rejected may be next to nothing.
_LEAST_PART = 0.5


@dataclass(frozen=True)
class RestoredGroup:
    """A group with so many rejected observations that all of them were used in the tests.

    Attributes
    ----------
    name : of the group.
    weighted_squares : vᵀPv with all of its observations.
    redundancy : of all of them, at the redundancy numbers of those that were left.
    """

    name: str
    weighted_squares: float
    redundancy: float

    def sigma0(self, explained: float) -> float:
        """σ0 of the group if alternatives explain so much of its vᵀPv: still large, its σ are wrong."""
        return float(np.sqrt(max(self.weighted_squares - explained, 0.0) / self.redundancy))


@dataclass(frozen=True, eq=False)
class ModelTests:
    """Tests of the alternatives of a model.

    Attributes
    ----------
    tests : score statistics, for σ0 = 1.
    restored : the groups whose rejected observations were used.
    """

    tests: AlternativeTests
    restored: tuple[RestoredGroup, ...]


def examined_model(
    block: Block,
    result: AdjustmentResult,
    alternatives: Sequence[ModelAlternative],
    options: AdjustmentOptions,
) -> ModelTests:
    """Test alternatives of the model a block was adjusted with.

    Raises
    ------
    DatumDefectError, DivergenceError : as of ``adjust_block``, where rejected observations come back.
    """
    others = result.groups[1:]
    system, solution = result.system, result.solution
    with one_thread():
        if any(is_restored(group) for group in others):
            rays = result.system.observations.image_points
            left = Observations(rays, tuple(_tested(group) for group in others))
            system = System.of(block, left, options.threads, options.free_network)
            solution = iterate(system, result.state, options.most_iterations)
        tests = alternative_tests(system, solution, alternatives)
    restored = tuple(_restored(group, solution.state) for group in others if is_restored(group))
    return ModelTests(tests, restored)


def _restored(group: GroupResult, state: State) -> RestoredGroup:
    model, present = group.group.stochastic, group.group.stochastic.present
    misclosure = np.where(present, group.group.linearize(state).misclosure, 0.0)
    left = np.isfinite(group.redundancy)
    part = group.redundancy_sum / max(int(left.sum()), 1) if left.any() else 1.0
    squares = float(np.sum(model.whitened(misclosure) ** 2))
    return RestoredGroup(
        group.group.name, squares, max(part, _LEAST_PART) * float(np.sum(present * model.shares))
    )


def _tested(group: GroupResult) -> ObservationGroup:
    return group.group if is_restored(group) else group.taking_part


def is_restored(group: GroupResult) -> bool:
    """Whether so much of a group was rejected that all of it is used in the tests."""
    count = int(group.group.stochastic.taking_part.sum())
    return group.rejected >= min(max(SEVERAL, MANY * count), max(_TWO, _THIRD * count))
