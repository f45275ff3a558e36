"""Kernels are compiled for one layout of their arrays; each further one would cost seconds of a first run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numba.core.types import Array

from adjust.adjustment import adjust_block
from adjust.parameters import ADDITIONAL_PARAMETERS
from adjust.quality.cofactor_kernel import point_cofactors
from adjust.solve.front_kernel import assemble, disassemble
from adjust.solve.reduction_kernel import reduce_points, substitute_back
from tests.adjust.scenes import two_strips


@pytest.mark.parametrize("kernel", [reduce_points, substitute_back, point_cofactors, assemble, disassemble])
def test_whatever_the_layout_of_the_observations_that_of_the_kernels_is_one(kernel: object) -> None:
    terms = two_strips(additional=True).truth.system[ADDITIONAL_PARAMETERS].shape[1]
    some = {ADDITIONAL_PARAMETERS: np.arange(terms) < 2}
    scene = two_strips(additional=True, free=some, noise_seed=1)
    rays = scene.observations.image_points
    every_second = {name: np.repeat(getattr(rays, name), 2)[::2] for name in ("image", "point")}
    assert not every_second["image"].flags.c_contiguous
    observations = replace(scene.observations, image_points=replace(rays, **every_second))
    adjust_block(scene.block, observations)
    signatures = kernel.signatures  # type: ignore[attr-defined]
    assert signatures
    for signature in signatures:
        assert {argument.layout for argument in signature if isinstance(argument, Array)} == {"C"}
