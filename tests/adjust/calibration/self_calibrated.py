"""Simulated blocks of cameras with known errors: the UltraCam Eagle test field and a DMC II block."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Floats
from adjust.block import Block
from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.correction import measured_from_ideal
from adjust.camera.additional.effect import sigma_of_effect
from adjust.camera.additional.register import AdditionalParameters, additional_parameters
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.camera.interior import FrameCamera
from adjust.observations.base import StochasticModel
from adjust.observations.direct import DirectObservations
from adjust.parameters import INTERIOR_ORIENTATION, SystemParameters, additional_family
from adjust.simulate.block import SimulatedBlock
from adjust.simulate.flight_plan import LineGroup, base_of, spacing_of
from adjust.simulate.noise import NoiseSpecification
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.survey import SurveyLayout
from adjust.simulate.terrain import TerrainShape
from adjust.simulate.truth import BlockSpecification
from adjust.solve.system import Observations

EAGLE = FrameCamera("UCE", 13080, 20010, 5.2e-6, 0.08, (0.0, 0.0), "corner", 0)
LOW, HIGH = 780.0, 2340.0
EAST, NORTH = np.pi / 2, 0.0


def lines(name: str, height: float, heading: float, exposures: tuple[int, ...]) -> LineGroup:
    """Alternating lines of the Eagle with 60 % overlap both ways."""
    base, spacing = base_of(EAGLE, height, 0.6), spacing_of(EAGLE, height, 0.6)
    return LineGroup(name, "1", 0, heading, height, exposures, base, spacing)


LOW_FLIGHT = (
    lines("E", LOW, EAST, (15,) * 7),
    lines("N", LOW, NORTH, (11, 10, 11, 10, 11, 10, 11, 10, 11)),
)
HIGH_FLIGHT = (lines("HE", HIGH, EAST, (7, 7)), lines("HN", HIGH, NORTH, (7, 7)))


def eagle_test_field(**changes: object) -> BlockSpecification:
    """The test field of 228 images, 200 of 5 cm and 28 of 15 cm GSD, with 84 control points."""
    specification = BlockSpecification(
        cameras=(EAGLE,),
        flight=(*LOW_FLIGHT, *HIGH_FLIGHT),
        points=PointSpecification(count=5220, detection=0.3),
        noise=NoiseSpecification(
            1.05e-6, (0.02, 0.02, 0.02), (0.05, 0.05, 0.05), tuple(np.deg2rad([0.003, 0.003, 0.008]).tolist())
        ),
        survey=(SurveyLayout("grid", columns=12, rows=7),),
        terrain=TerrainShape(mean=100.0, relief=15.0),
        seed=1,
    )
    return replace(specification, **changes)  # type: ignore[arg-type]


DMC_II_140 = FrameCamera("DMC-II-140", 11200, 12096, 7.2e-6, 0.092, (0.0, 0.0), "corner", 0)


def dmc_ii_block(seed: int) -> BlockSpecification:
    """69 images of a DMC II 140 with 9 cm GSD, two cross strips and 9 control points."""
    height = 1150.0
    base, spacing = base_of(DMC_II_140, height, 0.6), spacing_of(DMC_II_140, height, 0.6)
    return eagle_test_field(
        cameras=(DMC_II_140,),
        flight=(
            LineGroup("E", "1", 0, EAST, height, (11,) * 5, base, spacing),
            LineGroup("N", "1", 0, NORTH, height, (7,) * 2, base, 3000.0),
        ),
        points=PointSpecification(count=3000, detection=0.5),
        survey=(SurveyLayout("grid", columns=6, rows=5, control=9),),
        seed=seed,
    )


def parameters_of(camera: FrameCamera, selection: str) -> AdditionalParameters:
    """Additional parameters of a camera whose columns lie along the flight."""
    half_x, half_y = camera.half_format
    return additional_parameters(selection, ImageFormat(float(half_x), float(half_y)))


@dataclass(frozen=True, eq=False)
class SelfCalibratedBlock:
    """A simulated block of one camera with known errors, and the parameters it is offered.

    Attributes
    ----------
    error, true_values : the camera's corrections, and the values (k,) of their parameters.
    offered : the parameters to estimate.
    """

    simulated: SimulatedBlock
    error: AdditionalParameters
    true_values: Floats
    offered: AdditionalParameters

    @classmethod
    def of(
        cls, simulated: SimulatedBlock, offered: AdditionalParameters, true: Mapping[str, float]
    ) -> SelfCalibratedBlock:
        """With the true values of some of the offered parameters; the others are zero."""
        values = np.array([true.get(name, 0.0) for name in offered.names])
        return cls(simulated, offered, values, offered)

    def block(self, free: Collection[str] = ()) -> Block:
        """The block to adjust, with all offered parameters and some other families free."""
        block = self.simulated.block(free)
        shape = (1, len(self.offered.names))
        family = additional_family(self.offered.names, self.offered.units)
        own = SystemParameters(family, (block.cameras[0].name,), np.zeros(shape), np.ones(shape, dtype=bool))
        return replace(block, system=(*block.system, own))

    def observations(
        self, block: Block, without: Collection[str] = (), prior_um: float | None = None
    ) -> Observations:
        """As simulated, but measured in images with the true errors; nothing is measured in seams.

        Parameters
        ----------
        without : names of groups that are left out.
        prior_um : standard deviation of the largest effect of each parameter, observed as zero.
        """
        given = self.simulated.observations(block, without)
        truth, measured = self.simulated.truth, self.simulated.measured
        principal_point = truth.state.system[INTERIOR_ORIENTATION][0, 1:]
        reduced, found = measured_from_ideal(self.error, self.true_values, truth.xy - principal_point)
        noise = measured.xy - truth.xy
        images = np.zeros(len(truth.plan.images), dtype=np.int64)
        rays = replace(
            given.image_points,
            xy=np.where(found[:, None], reduced + principal_point, truth.xy) + noise,
            self_calibration=SelfCalibration(self.offered.names, (self.offered,), images),
        )
        others = given.others
        if prior_um is not None:
            own = block.system[-1]
            sigma = sigma_of_effect(self.offered, prior_um * 1e-6)[None, :]
            model = StochasticModel.from_sigma(sigma)
            others = (*others, DirectObservations(own.family, np.zeros(1, dtype=np.int64), own.values, model))
        return Observations(rays.without(~found), others)
