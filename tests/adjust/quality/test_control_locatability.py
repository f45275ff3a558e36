"""Which control points may be rejected: those that no other one explains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.observations.control_point import ControlPoints
from adjust.options import AdjustmentOptions
from adjust.result import AdjustmentResult, ObservationStatus
from tests.adjust.scenes import Scene, two_strips


def with_errors(scene: Scene, errors: dict[int, float]) -> Scene:
    """The same block with errors of the heights of some control points, metres."""
    others = list(scene.observations.others)
    number = next(k for k, group in enumerate(others) if isinstance(group, ControlPoints))
    control = others[number]
    assert isinstance(control, ControlPoints)
    height = control.given_height.copy()
    height[list(errors)] += list(errors.values())
    others[number] = replace(control, given_height=height)
    return replace(scene, observations=replace(scene.observations, others=tuple(others)))


def snooped(scene: Scene, **options: object) -> AdjustmentResult:
    return adjust_block(
        scene.block,
        scene.observations,
        AdjustmentOptions(critical_value=4.13, **options),  # type: ignore[arg-type]
    )


def rejected_control(result: AdjustmentResult) -> set[int]:
    status = next(item.status for item in result.groups if isinstance(item.group, ControlPoints))
    return set(np.flatnonzero((status == ObservationStatus.REJECTED).any(axis=1)).tolist())


@pytest.mark.parametrize("robust", [None, "huber"])
@pytest.mark.parametrize("wrong", [0, 3])
def test_of_four_heights_without_positions_none_is_rejected_and_the_wrong_one_is_among_those_named(
    wrong: int, robust: str | None
) -> None:
    scene = two_strips(control=("full",) * 4, gnss=False, ins=False, noise_seed=3)
    result = snooped(with_errors(scene, {wrong: 4.0}), robust=robust)
    assert rejected_control(result) == set()
    control = next(item.group for item in result.groups if isinstance(item.group, ControlPoints))
    assert isinstance(control, ControlPoints)
    named = set(result.inseparable.tolist())
    assert int(control.point[wrong]) in named
    assert len(named) >= 3


@pytest.mark.parametrize("errors", [{1: 2.0}, {1: 2.0, 3: 2.0}])
def test_with_positions_the_wrong_ones_are_rejected(errors: dict[int, float]) -> None:
    """Two of equal errors explain as much as each other, but not the same."""
    scene = two_strips(control=("full",) * 5, noise_seed=3)
    result = snooped(with_errors(scene, errors))
    assert rejected_control(result) == set(errors)
    assert len(result.inseparable) == 0
