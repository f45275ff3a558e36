"""Heads of published rigs, corrected by collocation: as good as with their errors known, and within σ."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.arrays import Floats
from adjust.block import Block
from adjust.residual_grid.collocation import collocate
from adjust.residual_grid.format_cells import FormatCells
from adjust.residual_grid.image_correction import corrected
from adjust.residual_grid.image_sets import GridRule
from adjust.residual_grid.remaining_errors import remaining_errors, with_correction_errors
from adjust.result import AdjustmentResult
from adjust.result_columns import sigma_of_points
from adjust.simulate.block import SimulatedBlock, simulate_block
from adjust.solve.system import Observations
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulation_input import block_specification

#: Twice the noise of the image points, RMS.
_ERRORS = 5e-6
PLATFORM = ("dmc-heads", ("relative_rotation",))
PENTA = (
    "penta",
    ("boresight", "relative_rotation", "synchronisation_offset", "gnss_shift", "interior_orientation"),
)


def affine(xy: Floats, random: np.random.Generator) -> Floats:
    """Errors (n, 2) that grow with the distance from the middle."""
    return xy @ random.normal(size=(2, 2))


def waves(xy: Floats, random: np.random.Generator) -> Floats:
    """Smooth random errors (n, 2)."""
    length, errors = 0.6 * np.abs(xy).max(), np.zeros_like(xy)
    for _ in range(60):
        phase = xy @ random.normal(size=2) * np.sqrt(2.0) / length + random.uniform(0.0, 2.0 * np.pi)
        errors += np.cos(phase)[:, None] * random.normal(size=2)
    return errors


@dataclass(frozen=True, eq=False)
class HeadsTest:
    """A simulated block of a rig whose heads have errors."""

    simulated: SimulatedBlock
    block: Block
    observations: Observations
    errors: Floats

    def errors_of(self, result: AdjustmentResult) -> tuple[Floats, Floats]:
        """RMS (3,) of the errors of object points, metres, and over their σ."""
        used = result.active_point
        left = (result.state.object_point - self.simulated.truth.state.object_point)[used]
        over = left / sigma_of_points(result)[used]
        return np.sqrt(np.mean(left**2, axis=0)), np.sqrt(np.mean(over**2, axis=0))

    def exact(self) -> AdjustmentResult:
        """Adjusted with the errors known."""
        rays = replace(self.observations.image_points, offset=-self.errors)
        return adjust_block(self.block, replace(self.observations, image_points=rays))

    def by_collocation(self) -> AdjustmentResult:
        """Adjusted with the corrections that collocation finds, and with what they leave."""
        block, set_of_image = self.block, self.block.camera_of_image
        cells = [FormatCells.of(camera.half_format, 9) for camera in block.cameras]
        first = adjust_block(block, self.observations)
        fields = collocate(block, first, cells, set_of_image, GridRule(cross_validate=False)).fields
        rays = corrected(self.observations.image_points, fields, set_of_image, "bilinear")
        result = adjust_block(block, replace(self.observations, image_points=rays))
        left = remaining_errors(result, fields, set_of_image, "bilinear")
        return with_correction_errors(result, left)


def simulated_heads(preset: str, free: Collection[str], kind: str, seed: int) -> HeadsTest:
    simulated = simulate_block(block_specification(load_simulation(preset))).measured_again(100 + seed)
    block = simulated.block(free)
    observations, random = simulated.observations(block), np.random.default_rng(seed)
    rays, errors = observations.image_points, np.zeros_like(observations.image_points.xy)
    camera = block.camera_of_image[rays.image]
    for number in range(len(block.cameras)):
        rows = camera == number
        errors[rows] = {"affine": affine, "waves": waves}[kind](rays.xy[rows], random) if rows.any() else 0.0
    errors *= _ERRORS / np.sqrt(np.mean(errors**2))
    measured = replace(observations, image_points=replace(rays, xy=rays.xy + errors))
    return HeadsTest(simulated, block, measured, errors)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["affine", "waves"])
@pytest.mark.parametrize(("preset", "free"), [PLATFORM, PENTA], ids=["dmc-heads", "penta"])
def test_heads_are_corrected_as_if_their_errors_were_known(
    preset: str, free: Collection[str], kind: str
) -> None:
    tests = [simulated_heads(preset, free, kind, seed) for seed in (1, 2, 3)]
    found = np.array([test.errors_of(test.by_collocation()) for test in tests])
    exact = np.array([test.errors_of(test.exact()) for test in tests])
    size, known = (np.sqrt(np.mean(item**2, axis=0)) for item in (found, exact))
    # Before, rotations and synchronisation took what the means show for theirs: plan 3 to 5 times as large.
    assert np.all(size[0] < 1.2 * known[0])
    # Heights with five cameras 1.4, all others up to 1.2.
    assert np.all(size[1] < 1.45 * np.maximum(known[1], 1.0))
