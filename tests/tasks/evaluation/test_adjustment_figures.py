"""Figures of an adjustment in the units in which they are stated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from adjust.adjustment import adjust_block
from adjust.observations.base import StochasticModel
from adjust.observations.image_point import ImagePoints
from adjust.observations.joint_prior import JointPrior
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT, INTERIOR_ORIENTATION, LEVER_ARM, ParameterPlace
from tasks.block.block_input import SurveyedPoints
from tasks.coordinates.crs import MapFrame
from tasks.evaluation.adjustment_figures import adjustment_figures, variance_figures
from tasks.evaluation.result_tables import AdjustedBlock
from tasks.evaluation.trust_map import new_sigma
from tasks.remarks.observation_sigmas import variance_sentences
from tasks.results.figures import ComponentFigure, VarianceFigures
from tasks.settings.adjustment import AdjustmentSettings
from tasks.settings.coordinates import ELLIPSOIDAL
from tasks.settings.trust_map import TrustMapSettings
from tests.adjust.scenes import two_strips, with_cameras_in_order

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
    system = with_cameras_in_order(block.system, np.array(order))
    block = replace(
        block, cameras=cameras, camera_of_image=np.array(order)[block.camera_of_image], system=system
    )
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


def test_of_image_points_of_unlike_sigmas_the_median_stands_for_all(adjusted: AdjustedBlock) -> None:
    """A third of them measured by hand, four times as badly: the mean would be twice as large."""
    rays = adjusted.result.groups[0]
    by_hand = np.where(np.arange(len(rays.sigma)) % 3 == 0, 4.0, 1.0)[:, None]
    result = replace(
        adjusted.result,
        groups=(replace(rays, sigma=3e-6 * by_hand * np.ones(2)), *adjusted.result.groups[1:]),
    )
    given = replace(adjusted, result=result, sigma0=1.5)
    found = adjustment_figures(given, AdjustmentSettings(), pd.DataFrame())
    pixel = adjusted.block.cameras[0].pixel_size
    assert found["sigma0_um"] == pytest.approx(3.0 * result.test.sigma0)
    assert found["sigma0_px"] == pytest.approx(3e-6 / pixel * result.test.sigma0)
    assert new_sigma(given, TrustMapSettings()) == pytest.approx(1.5 * 3e-6)


def test_values_of_several_units_have_no_common_median_sigma() -> None:
    """A calibration observed with c in m and boresight in rad: 35 µm was said of 0.002° and 50 µm."""
    scene = two_strips(noise_seed=5, free={BORESIGHT: True, INTERIOR_ORIENTATION: True, LEVER_ARM: True})
    places = tuple(
        ParameterPlace(family, 0, k) for family in (INTERIOR_ORIENTATION, BORESIGHT) for k in range(3)
    )
    values = {item.family.name: item.values for item in scene.block.system}
    given = np.array([[values[family][entity, k] for family, entity, k in places]])
    model = StochasticModel.from_sigma(np.array([[50e-6] * 3 + [35e-6] * 3]))
    prior = JointPrior("camera", ("p",) * 6, ("m",) * 3 + ("rad",) * 3, places, given, model)
    observations = replace(scene.observations, others=(*scene.observations.others, prior))
    result = adjust_block(scene.block, observations, AdjustmentOptions(variance_components=True))
    rows = {row["part"]: row for row in variance_figures(result)["components"]}  # type: ignore[index,call-overload]
    figure = ComponentFigure(**rows["prior:calibration:camera"])
    assert figure.unit == ""
    assert figure.sigma is None or np.isnan(figure.sigma)  # null when it is written
    assert rows["image_points"]["unit"] == "um"
    assert rows["image_points"]["sigma"] == pytest.approx(2.0 * rows["image_points"]["factor"])
    assert rows["ins_attitudes yaw"]["unit"] == "deg"
    changes = {"estimated": True, "factor": 2.0, "factor_lower": 1.5, "factor_upper": 2.5, "sigma": None}
    estimated = figure.model_copy(update=changes)
    figures = VarianceFigures(rounds=3, confidence=0.95, components=(estimated,))
    (sentence,) = variance_sentences(figures)
    assert "2.00 (1.50 to 2.50) times as large; the adjustment uses these." in sentence
