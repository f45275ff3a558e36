"""Blocks of an UltraCam X like those of the DGPF test, with errors of the camera that are known.

High: 2,875 m, 70 % × 70 %, 5 lines of 8 and 2 cross lines of 6. Low: 1,200 m, 4 lines of 10 and 1 cross
line. Nine control points, 101 check points, no GNSS and INS observations unless a test wants them.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from adjust.adjustment import adjust_block
from adjust.arrays import Floats
from adjust.block import Block
from adjust.camera.interior import FrameCamera
from adjust.parameters import State
from adjust.residual_grid.choice import CheckCoordinates
from adjust.residual_grid.format_cells import FormatCells, Seams
from adjust.result import AdjustmentResult
from adjust.simulate.block import SimulatedBlock, simulate_block
from adjust.simulate.flight_plan import LineGroup, base_of, spacing_of
from adjust.simulate.image_errors import ImageErrorSpecification
from adjust.simulate.noise import NoiseSpecification
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.survey import SurveyLayout
from adjust.simulate.terrain import TerrainShape
from adjust.simulate.truth import BlockSpecification
from adjust.solve.system import Observations

MICROMETRE = 1e-6
CAMERA = FrameCamera("UCX", 9420, 14430, 7.2e-6, 0.1005, (0.0, 0.0), "corner", 0)
SEAMS = Seams(*((-half / 3.0, half / 3.0) for half in CAMERA.half_format))
IMAGE_SIGMA = 0.8 * MICROMETRE
NOTHING = ImageErrorSpecification()
TILES = ImageErrorSpecification(tile_shift=0.8 * MICROMETRE)
RADIAL_AND_TILES = ImageErrorSpecification(radial=2.5 * MICROMETRE, tile_shift=0.8 * MICROMETRE)


@dataclass(frozen=True, eq=False)
class CameraTest:
    """A simulated block and its adjustment without any correction."""

    simulated: SimulatedBlock
    without: Collection[str]

    @cached_property
    def block(self) -> Block:
        return self.simulated.block()

    @cached_property
    def observations(self) -> Observations:
        return self.simulated.observations(self.block, without=self.without)

    @cached_property
    def result(self) -> AdjustmentResult:
        return adjust_block(self.block, self.observations)

    @cached_property
    def check(self) -> CheckCoordinates:
        truth = self.simulated.truth
        points = truth.surveyed[truth.is_check]
        return CheckCoordinates(points, truth.state.object_point[points])

    def check_rms(self, state: State) -> Floats:
        """Root mean square error (3,) at the check points, metres."""
        return np.asarray(
            np.sqrt(np.mean((state.object_point[self.check.point] - self.check.x_in_local) ** 2, axis=0))
        )

    def true_correction(self, xy: Floats) -> Floats:
        """What has to be added to measurements at (n, 2)."""
        return -self.simulated.truth.image_errors[0].error(xy)


def cells(number: int, seams: Seams | None = None) -> FormatCells:
    return FormatCells.of(CAMERA.half_format, number, seams)


def high_block(errors: ImageErrorSpecification, *, gnss: bool = False, seed: int = 3) -> CameraTest:
    return _test(2875.0, (0.7, 0.7), (5, 8), (2, 6), errors, 3, seed, gnss)


def low_block(errors: ImageErrorSpecification, *, gnss: bool = False, seed: int = 4) -> CameraTest:
    return _test(1200.0, (0.7, 0.6), (4, 10), (1, 5), errors, 3, seed, gnss)


def _test(
    height: float,
    overlap: tuple[float, float],
    lines: tuple[int, int],
    cross: tuple[int, int],
    errors: ImageErrorSpecification,
    camera_seed: int,
    noise_seed: int,
    gnss: bool,
) -> CameraTest:
    """The seed of the camera decides the directions of its errors, another one the noise."""
    base, spacing = base_of(CAMERA, height, overlap[0]), spacing_of(CAMERA, height, overlap[1])
    specification = BlockSpecification(
        cameras=(CAMERA,),
        flight=(
            LineGroup("E", "1", 0, np.pi / 2, height, (lines[1],) * lines[0], base, spacing),
            LineGroup("N", "1", 0, 0.0, height, (cross[1],) * cross[0], base, 3 * spacing),
        ),
        points=PointSpecification(count=1500),
        noise=NoiseSpecification(
            image=IMAGE_SIGMA,
            control=(0.02, 0.02, 0.03),
            gnss=(0.05, 0.05, 0.07),
            ins=(1e-4, 1e-4, 2e-4),
        ),
        survey=(SurveyLayout("grid", columns=10, rows=11, control=9),),
        terrain=TerrainShape(mean=300.0, relief=30.0),
        image_errors=errors,
        seed=camera_seed,
    )
    simulated = simulate_block(specification).measured_again(noise_seed)
    return CameraTest(simulated, ("ins_attitudes",) if gnss else ("gnss_positions", "ins_attitudes"))


def with_true_correction(test: CameraTest) -> AdjustmentResult:
    """Adjusted with the errors of the camera taken off exactly."""
    rays = test.observations.image_points
    known = replace(rays, offset=test.true_correction(rays.xy))
    return adjust_block(test.block, Observations(known, test.observations.others))
