"""Tests of the model of an adjusted block take back what was rejected because of an error of the model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.geometry import rotation
from adjust.model_tests import examined_model
from adjust.observations.gnss_position import GnssPositions
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT, GNSS_SHIFT
from adjust.quality.model_alternatives import ParameterAlternative
from adjust.solve.system import Observations
from tests.adjust.scenes import Scene, two_strips

OPTIONS = AdjustmentOptions(critical_value=3.29)
FREE = {BORESIGHT: True, GNSS_SHIFT: True}
SECOND = np.arange(30) >= 20
YAW = ParameterAlternative(BORESIGHT, 0, 2, SECOND)


def turned(scene: Scene, angles: np.ndarray) -> Scene:
    """Attitudes (n, 3) turned by small rotations in body axes."""
    others = list(scene.observations.others)
    number, ins = next((k, group) for k, group in enumerate(others) if group.name == "ins_attitudes")
    others[number] = replace(ins, observed=ins.observed @ rotation.exp(angles[ins.event]))
    return replace(scene, observations=replace(scene.observations, others=tuple(others)))


@pytest.fixture(scope="module")
def flight() -> Scene:
    return two_strips(
        strips=6,
        headings_deg=(0.0, 180.0, 90.0, 270.0, 0.0, 180.0),
        points_along=24,
        points_across=16,
        control=("full",) * 12,
        sigma_ins_rad=np.deg2rad(0.003),
        free=FREE,
        noise_seed=8,
    )


def test_attitudes_that_were_rejected_because_the_camera_was_remounted_come_back(flight: Scene) -> None:
    angle = np.deg2rad(0.04)
    scene = turned(flight, np.where(SECOND[:, None], [0.0, 0.0, angle], 0.0))
    result = adjust_block(scene.block, scene.observations, OPTIONS)
    ins = next(group for group in result.groups if group.group.name == "ins_attitudes")
    assert ins.rejected >= 8
    found = examined_model(scene.block, result, [YAW], OPTIONS)
    assert [group.name for group in found.restored] == ["ins_attitudes"]
    assert abs(found.tests.estimate[0]) == pytest.approx(angle, abs=4.0 * found.tests.sigma[0])
    assert abs(found.tests.t[0]) > 10.0
    # What the alternative explains leaves the group as its σ say; without it they would be blamed.
    (group,) = found.restored
    assert group.sigma0(0.0) > 2.0
    assert group.sigma0(float(found.tests.t[0] ** 2)) < 1.2


def test_attitudes_that_scatter_more_than_stated_are_not_explained_by_a_mounting(flight: Scene) -> None:
    noise = np.random.default_rng(1).normal(0.0, np.deg2rad(0.02), (30, 3))
    scene = turned(flight, noise)
    result = adjust_block(scene.block, scene.observations, OPTIONS)
    found = examined_model(scene.block, result, [YAW], OPTIONS)
    group = next(item for item in found.restored if item.name == "ins_attitudes")
    assert group.sigma0(float(found.tests.t[0] ** 2)) > 2.0


def test_of_a_good_block_nothing_comes_back(flight: Scene) -> None:
    result = adjust_block(flight.block, flight.observations, OPTIONS)
    found = examined_model(flight.block, result, [YAW], OPTIONS)
    assert found.restored == ()
    assert abs(found.tests.t[0]) < 4.0


@pytest.mark.parametrize(("control", "rejected"), [(2, 2), (3, 2)])
def test_two_of_few_control_points_come_back(control: int, rejected: int) -> None:
    """Against the positions they have one shift, which nothing shows when they are left out."""
    scene = two_strips(control=("full",) * control, points_along=12, points_across=9, noise_seed=8, free={})
    others = list(scene.observations.others)
    number, gnss = next((k, group) for k, group in enumerate(others) if isinstance(group, GnssPositions))
    others[number] = replace(gnss, observed=gnss.observed + np.array([0.0, 0.0, 0.5]))
    options = AdjustmentOptions(critical_value=4.13)
    result = adjust_block(scene.block, Observations(scene.observations.image_points, tuple(others)), options)
    assert [group.rejected for group in result.groups] == [0, rejected, 0, 0]
    up = ParameterAlternative(GNSS_SHIFT, 0, 2)
    found = examined_model(scene.block, result, [up], options)
    assert [group.name for group in found.restored] == ["control_points"]
    assert found.tests.t[0] > 7.0
    assert found.tests.estimate[0] == pytest.approx(0.5, abs=4.0 * found.tests.sigma[0])
