"""The selection of additional parameters around real adjustments."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.observations.base import StochasticModel
from adjust.observations.direct import DirectObservations
from adjust.options import AdjustmentOptions
from adjust.parameters import (
    ADDITIONAL_PARAMETERS,
    BORESIGHT,
    SystemParameters,
    additional_family,
)
from adjust.selection.elimination import DEFAULT, Criterion
from adjust.selection.parameter_selection import adjust_with_selection, columns_of
from tests.adjust.scenes import Polynomials, Scene, two_strips

OPTIONS = AdjustmentOptions()
TRUE = {"test:square": 6.0, "test:radial": -5.0}


def scene_with(names: tuple[str, ...], free: dict[str, object] | None = None) -> Scene:
    """A block whose camera has the errors of TRUE and is offered the parameters named."""
    scene = two_strips(
        points_along=24, points_across=12, noise_seed=7, start_seed=8, free={BORESIGHT: True, **(free or {})}
    )
    rays = scene.observations.image_points
    basis = Polynomials(tuple(TRUE)).basis(rays.xy)
    # The parameters are corrections: what is measured shows the negative.
    xy = rays.xy - basis @ np.array(list(TRUE.values()))
    model = SelfCalibration(names, (Polynomials(names),), np.zeros(len(scene.block.images), dtype=np.int64))
    parameters = SystemParameters(
        additional_family(names, ("µm",) * len(names)),
        ("forward",),
        np.zeros((1, len(names))),
        np.ones((1, len(names)), dtype=bool),
    )
    return replace(
        scene,
        block=replace(scene.block, system=(*scene.block.system, parameters)),
        observations=replace(scene.observations, image_points=replace(rays, xy=xy, self_calibration=model)),
    )


ALL = ("test:square", "test:shear", "test:radial", "test:quarter")


def values(result_names: tuple[str, ...], state: np.ndarray) -> dict[str, float]:
    return dict(zip(result_names, state[0].tolist(), strict=True))


def test_the_true_parameters_stay_and_the_result_is_the_adjustment_with_them_alone() -> None:
    scene = scene_with(ALL)
    found = adjust_with_selection(scene.block, scene.observations, OPTIONS, DEFAULT)
    assert found.elimination is not None
    kept = [found.full.normals.names[k] for k in np.flatnonzero(found.elimination.kept)]
    assert kept == list(TRUE)
    alone = scene_with(tuple(TRUE))
    expected = adjust_block(alone.block, alone.observations, OPTIONS)
    estimated = values(ALL, found.result.state.system[ADDITIONAL_PARAMETERS])
    wanted = values(tuple(TRUE), expected.state.system[ADDITIONAL_PARAMETERS])
    for name, value in wanted.items():
        assert estimated[name] == pytest.approx(value, abs=1e-3)
    assert estimated["test:shear"] == estimated["test:quarter"] == 0.0
    assert found.result.test.redundancy == expected.test.redundancy
    assert found.result.test.sigma0 == pytest.approx(expected.test.sigma0, rel=1e-6)


def test_without_rules_all_parameters_stay() -> None:
    scene = scene_with(ALL)
    found = adjust_with_selection(scene.block, scene.observations, OPTIONS, None)
    expected = adjust_block(scene.block, scene.observations, OPTIONS)
    assert found.elimination is None
    np.testing.assert_array_equal(
        found.result.state.system[ADDITIONAL_PARAMETERS], expected.state.system[ADDITIONAL_PARAMETERS]
    )


class Twice:
    """A parameter, and the same again under another name."""

    names = (*ALL, "test:again")
    first = np.zeros(5, dtype=bool)

    def basis(self, xy: np.ndarray) -> np.ndarray:
        once = Polynomials(ALL).basis(xy)
        return np.concatenate([once, once[:, :, :1]], axis=2)


def test_parameters_that_cannot_be_told_apart_are_named_and_one_of_them_is_dropped() -> None:
    scene = scene_with(ALL)
    names = Twice.names
    parameters = SystemParameters(
        additional_family(names, ("µm",) * 5), ("forward",), np.zeros((1, 5)), np.ones((1, 5), dtype=bool)
    )
    rays = scene.observations.image_points
    model = SelfCalibration(names, (Twice(),), rays.self_calibration.entity_of_image)  # type: ignore[union-attr]
    block = replace(scene.block, system=(*scene.block.system[:-1], parameters))
    observations = replace(scene.observations, image_points=replace(rays, self_calibration=model))
    found = adjust_with_selection(block, observations, OPTIONS, DEFAULT)
    assert found.elimination is not None
    first = found.elimination.decisions[0]
    assert first.criterion is Criterion.DETERMINABILITY
    assert {first.name} < {"test:square", "test:again"}
    assert ("test:again" if first.name == "test:square" else "test:square") in first.reason
    assert found.elimination.kept.sum() == len(TRUE)


def test_the_pseudo_observation_of_a_dropped_parameter_goes_with_it() -> None:
    scene = scene_with(ALL)
    family = scene.block.system[-1].family
    prior = DirectObservations(
        family, np.array([0]), np.zeros((1, 4)), StochasticModel.from_sigma(np.full((1, 4), 50.0))
    )
    observed = replace(scene.observations, others=(*scene.observations.others, prior))
    found = adjust_with_selection(scene.block, observed, OPTIONS, DEFAULT)
    present = next(g for g in found.result.groups if isinstance(g.group, DirectObservations))
    assert np.isfinite(present.redundancy[0]).tolist() == [name in TRUE for name in ALL]


def test_the_columns_of_a_family_are_found() -> None:
    layout = scene_with(ALL).block.layout
    assert columns_of(layout, ADDITIONAL_PARAMETERS).tolist() == [False] * 3 + [True] * 4
    assert not columns_of(layout, "gnss_drift").any()
