"""Additional parameters of a block from arrays: by a text or an own set; refused where they differ."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from adjust import AdjustmentOptions, ImagePoints, Observations, adjust_block, self_calibration
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.errors import InconsistentBlockError
from adjust.parameters import SystemParameters
from adjust.result import AdjustmentResult
from tests.adjust.camera.additional.test_own_forward_set import SHEET
from tests.adjust.scenes import two_strips

SCENE = two_strips(noise_seed=1, cameras=2)
BLOCK, RAYS = SCENE.block, SCENE.observations.image_points
MODEL, PARAMETERS = self_calibration(BLOCK.cameras, BLOCK.camera_of_image, "brown:K1,K2")


def adjusted(model: SelfCalibration, parameters: SystemParameters | None) -> AdjustmentResult:
    block = BLOCK if parameters is None else replace(BLOCK, system=(*BLOCK.system, parameters))
    rays = replace(RAYS, self_calibration=model)
    return adjust_block(block, Observations(rays, SCENE.observations.others), AdjustmentOptions())


def test_a_distortion_that_was_applied_is_found_with_either_way_of_selecting_it() -> None:
    k1 = -0.4  # 1/m²: 50 µm in the corner
    squares = np.sum(RAYS.xy**2, axis=1, keepdims=True)
    distorted = RAYS.xy * (1.0 - k1 * squares)
    model, parameters = self_calibration(BLOCK.cameras, BLOCK.camera_of_image, "brown:K1")
    block = replace(BLOCK, system=(*BLOCK.system, parameters))
    images, points = (
        [names[k] for k in index] for names, index in ((block.images, RAYS.image), (block.points, RAYS.point))
    )
    rays = ImagePoints.measured(block, images, points, distorted, RAYS.sigma, model)
    result = adjust_block(block, Observations(rays, SCENE.observations.others))
    found = result.to_dataframe("parameters").set_index(["parameter", "entity"])
    for camera in block.cameras:
        row = found.loc[("brown:K1", camera.name)]
        assert abs(row.value - k1) < 4.0 * row.sigma < 0.2 * abs(k1)


def test_a_set_of_ones_own_needs_no_package() -> None:
    model, parameters = self_calibration(BLOCK.cameras, BLOCK.camera_of_image, SHEET)
    assert model.names == parameters.family.components == ("sheet:bend", "sheet:bow")
    assert parameters.values.shape == parameters.free.shape == (2, 2)
    result = adjusted(model, parameters)
    assert {row.parameter for row in result.to_dataframe().itertuples()} == {"sheet:bend", "sheet:bow"}


def swapped(model: SelfCalibration) -> SelfCalibration:
    return replace(model, names=model.names[::-1])


WRONG: dict[str, tuple[Callable[[], Any], str]] = {
    "not of the block": (lambda: adjusted(MODEL, None), "additional parameters, and the block does not"),
    "another order": (
        lambda: adjusted(swapped(MODEL), PARAMETERS),
        "are brown:K2, brown:K1; those of the block are brown:K1, brown:K2",
    ),
    "other parameters": (
        lambda: adjusted(self_calibration(BLOCK.cameras, BLOCK.camera_of_image, "brown:K1")[0], PARAMETERS),
        "the same in the same order",
    ),
    "too few images": (
        lambda: adjusted(replace(MODEL, entity_of_image=MODEL.entity_of_image[1:]), PARAMETERS),
        "entity_of_image of the additional parameters has the shape",
    ),
    "no such entity": (
        lambda: adjusted(replace(MODEL, entity_of_image=MODEL.entity_of_image + 1), PARAMETERS),
        "additional parameters of 2 cameras; the image points have those of 2",
    ),
    "the other camera": (
        lambda: adjusted(replace(MODEL, entity_of_image=1 - MODEL.entity_of_image), PARAMETERS),
        "and has the additional parameters of",
    ),
}


@pytest.mark.parametrize(("make", "says"), WRONG.values(), ids=WRONG)
def test_those_of_image_points_and_block_must_be_the_same(make: Callable[[], Any], says: str) -> None:
    with pytest.raises(InconsistentBlockError, match=says):
        make()


def test_standard_deviations_before_anything_is_measured() -> None:
    exact = two_strips()
    result = adjust_block(exact.block, exact.observations)
    for table, sigma in (("points", "sigma_z"), ("images", "sigma_x")):
        stated = result.to_dataframe(table, sigma0=1.0)[sigma].to_numpy()
        usual = result.to_dataframe(table)[sigma].to_numpy()
        np.testing.assert_allclose(usual, result.sigma0 * stated, rtol=1e-9)
    heights = np.sqrt(result.cofactor.of_points[:, 2, 2])
    np.testing.assert_allclose(result.to_dataframe("points", sigma0=1.0)["sigma_z"], heights, rtol=1e-12)
