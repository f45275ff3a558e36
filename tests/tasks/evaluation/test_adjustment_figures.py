"""Figures of an adjustment in the units in which they are stated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from adjust.adjustment import adjust_block
from adjust.observations.image_point import ImagePoints
from adjust.options import AdjustmentOptions
from tasks.block.block_input import SurveyedPoints
from tasks.coordinates.crs import MapFrame
from tasks.evaluation.adjustment_figures import adjustment_figures
from tasks.evaluation.result_tables import AdjustedBlock
from tasks.settings.adjustment import AdjustmentSettings
from tasks.settings.coordinates import ELLIPSOIDAL
from tests.adjust.scenes import two_strips

NOTHING = np.zeros((0, 3))
NO_SURVEY = SurveyedPoints(
    (), np.zeros(0, dtype=bool), NOTHING, np.zeros(0), np.zeros((0, 3, 3)), NOTHING > 0.0
)


@pytest.fixture(scope="module")
def adjusted() -> AdjustedBlock:
    """Two strips, each with a camera of its own; the first one has more rays."""
    scene = two_strips(cameras=2, noise_seed=5)
    result = adjust_block(scene.block, scene.observations, AdjustmentOptions())
    frame = MapFrame.of("EPSG:32632", ELLIPSOIDAL)
    return AdjustedBlock(scene.block, result, frame, scene.block.frame, 1.0, NO_SURVEY, pd.DataFrame())


@pytest.mark.parametrize("first", [0, 1])
def test_sigma0_in_pixels_is_in_those_of_the_camera_of_each_ray(adjusted: AdjustedBlock, first: int) -> None:
    """Every coordinate has a σ of a quarter of a pixel of 12 or 3 µm, whichever camera is first."""
    block, pixels = adjusted.block, np.array([12e-6, 3e-6])
    order = [first, 1 - first]
    cameras = tuple(replace(block.cameras[k], pixel_size=float(pixels[k])) for k in order)
    block = replace(block, cameras=cameras, camera_of_image=np.array(order)[block.camera_of_image])
    rays = adjusted.result.groups[0]
    assert isinstance(rays.group, ImagePoints)
    of_ray = adjusted.block.camera_of_image[rays.group.image]
    assert 0.5 < (of_ray == 0).mean() < 1.0
    sigma = 0.25 * pixels[of_ray][:, None] * np.ones(2)
    result = replace(adjusted.result, groups=(replace(rays, sigma=sigma), *adjusted.result.groups[1:]))
    found = adjustment_figures(
        replace(adjusted, block=block, result=result), AdjustmentSettings(), pd.DataFrame()
    )
    assert found["sigma0_px"] == pytest.approx(0.25 * result.test.sigma0)
