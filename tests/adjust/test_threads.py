"""Threads change the time an adjustment takes, and nothing else."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from adjust.adjustment import adjust_block, estimate_block
from adjust.options import AdjustmentOptions, available_threads
from adjust.solve.lanes import lanes
from adjust.solve.system import System
from tests.adjust.scenes import ALL_FREE, Scene, two_strips


def block_of_several_lanes(**switches: object) -> Scene:
    scene = two_strips(
        strips=8, images_per_strip=24, points_along=120, points_across=48, cameras=2, flights=2,
        noise_seed=1, start_seed=2, **{"free": ALL_FREE, **switches},
    )  # fmt: skip
    assert len(lanes(System.of(scene.block, scene.observations).point_start)) > 2
    return scene


def digest(scene: Scene, threads: int, **options: Any) -> str:
    """Of everything an adjustment returns in arrays."""
    result = adjust_block(scene.block, scene.observations, AdjustmentOptions(threads=threads, **options))
    found = hashlib.sha256()
    for array in (
        result.state.projection_centre,
        result.state.local_from_camera,
        result.state.object_point,
        *result.state.system.values(),
        result.cofactor.reduced.blocks,
        result.cofactor.reduced.border,
        result.cofactor.reduced.corner,
        result.cofactor.of_points,
        result.cofactor.hat_of_rays,
        *(array for group in result.groups for array in (group.residual, group.redundancy)),
    ):
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


def test_one_two_and_five_threads_give_the_same_bytes() -> None:
    scene = block_of_several_lanes()
    assert len({digest(scene, threads) for threads in (1, 2, 5)}) == 1


def test_a_free_network_has_the_same_bytes_too() -> None:
    scene = block_of_several_lanes(control=(), gnss=False, ins=False, free={})
    assert len({digest(scene, threads, free_network="both") for threads in (1, 3)}) == 1


def test_an_estimate_without_statistics_has_the_same_bytes_too() -> None:
    scene = block_of_several_lanes()
    found = {
        estimate_block(
            scene.block, scene.observations, AdjustmentOptions(threads=threads)
        ).state.object_point.tobytes()
        for threads in (1, 3)
    }
    assert len(found) == 1


def test_all_threads_of_the_process_are_used_unless_told_otherwise() -> None:
    assert AdjustmentOptions().threads == available_threads() >= 1
