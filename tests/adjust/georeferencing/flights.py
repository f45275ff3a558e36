"""Simulated flights, georeferenced directly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from adjust.approximate.intersection import intersect
from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.correction import measured_from_ideal
from adjust.camera.additional.register import additional_parameters
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.camera.interior import FrameCamera
from adjust.georeferencing.direct_orientation import DirectOrientations, direct_orientations
from adjust.georeferencing.error_sources import CalibrationErrors, ErrorSources
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.image_point import ImagePoints
from adjust.observations.ins_attitude import InsAttitudes
from adjust.parameters import (
    ADDITIONAL_PARAMETERS,
    BORESIGHT,
    GNSS_DRIFT,
    GNSS_SHIFT,
    GNSS_STRIP_BIAS,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    TIME_OFFSET,
)
from adjust.simulate.block import SimulatedBlock, simulate_block
from adjust.simulate.flight_plan import LineGroup, spacing_of
from adjust.simulate.noise import NoiseSpecification
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.system import SystemSpecification
from adjust.simulate.terrain import TerrainShape
from adjust.simulate.trajectory import FlightVariation
from tests.adjust.simulate.specifications import CAMERA, small_specification

SELECTION = "bluh:1-6"
#: A distortion of the ideal point of several millimetres in the corners.
FORWARD = "brown-forward:k1,p1,b1"
FORWARD_VALUES = (-0.05, 2e-3, -3e-3)
#: Families of one entity with a covariance, and how many parameters each has.
CALIBRATED = {BORESIGHT: 3, LEVER_ARM: 3, GNSS_SHIFT: 3, TIME_OFFSET: 1, INTERIOR_ORIENTATION: 3}
SYSTEM = SystemSpecification(
    interior_change=(-8e-6, 4e-6, -6e-6),
    boresight=(2e-3, -1e-3, 4e-3),
    lever_arm=(0.3, -0.1, -1.2),
    gnss_shift=(-0.26, 0.12, 0.29),
    time_offset=2e-3,
)


@dataclass(frozen=True, eq=False)
class Flight:
    """A flight with its orientations: exact in its calibration, as wrong as its GNSS and INS."""

    simulated: SimulatedBlock
    rays: ImagePoints
    gnss: GnssPositions
    ins: InsAttitudes
    system: Mapping[str, Floats]

    @property
    def orientations(self) -> DirectOrientations:
        return direct_orientations(self.gnss, self.ins, self.system)

    def with_system(self, name: str, change: Floats) -> Flight:
        """The flight with one family of its calibration changed (d,)."""
        return replace(self, system={**self.system, name: self.system[name] + change})

    def intersected(self) -> Floats:
        """Object points (m, 3)."""
        found = intersect(self.rays, self.orientations.state, len(self.simulated.truth.points))
        assert found.usable.all()
        return found.object_point

    def sources(
        self, calibration: CalibrationErrors | None = None, strip: Floats | None = None
    ) -> ErrorSources:
        return ErrorSources(
            self.orientations,
            self.simulated.truth.plan.strip,
            np.zeros(6) if strip is None else strip,
            calibration or CalibrationErrors({}, np.zeros((0, 0))),
        )


def simulated(**changes: object) -> SimulatedBlock:
    """The small block with a calibration and with no errors that are common to a strip."""
    settings: dict[str, object] = {"system": SYSTEM, **changes}
    return simulate_block(small_specification(**settings))


def fly(block: SimulatedBlock, with_additional: bool = False, distorted: bool = False) -> Flight:
    """Georeference a simulated block with its true calibration; strip biases and drifts stay unknown.

    Parameters
    ----------
    with_additional : with corrections of next to nothing.
    distorted : with a distortion besides, with which the image points are measured.
    """
    given = block.block()
    groups = {group.name: group for group in block.observations(given).groups}
    gnss, ins = groups["gnss_positions"], groups["ins_attitudes"]
    rays = groups["image_points"]
    assert isinstance(gnss, GnssPositions)
    assert isinstance(ins, InsAttitudes)
    assert isinstance(rays, ImagePoints)
    unknown = (GNSS_STRIP_BIAS, GNSS_DRIFT)
    system = {name: v * (name not in unknown) for name, v in block.truth.state.system.items()}
    if with_additional:
        (c, *principal_point), (half_x, half_y) = system[INTERIOR_ORIENTATION][0], CAMERA.half_format
        selection = f"{SELECTION}+{FORWARD}" if distorted else SELECTION
        parameters = additional_parameters(selection, ImageFormat(half_x, half_y, focal_length=float(c)))
        values = np.where(parameters.forward, 0.0, 1e-6)
        values[parameters.forward] = FORWARD_VALUES if distorted else ()
        reduced, _ = measured_from_ideal(
            parameters.only("forward"), values[parameters.forward], rays.xy - principal_point
        )
        images = np.zeros(len(given.images), dtype=np.int64)
        model = SelfCalibration.of(parameters.names, (parameters,), images)
        rays = replace(rays, xy=reduced + principal_point, self_calibration=model)
        system[ADDITIONAL_PARAMETERS] = values[None, :]
    return Flight(block, rays, gnss, ins, system)


def calibration_errors(families: Mapping[str, int], sigma: float = 1.0, seed: int = 3) -> CalibrationErrors:
    """A full covariance of the parameters of families with one entity, correlations drawn at random."""
    columns, following = {}, 0
    for name, count in families.items():
        columns[name] = np.arange(following, following + count)[None, :]
        following += count
    mixed = np.random.default_rng(seed).normal(size=(following, following + 2)) * sigma
    return CalibrationErrors(columns, mixed @ mixed.T)


def vertical_strip(
    camera: FrameCamera, height: float, base: float, noise: NoiseSpecification
) -> SimulatedBlock:
    """Two level images over flat ground, exactly as planned, in a Cartesian frame."""
    line = LineGroup("S", "1", 0, np.pi / 2, height, (2,), base, spacing_of(camera, height, 0.6))
    specification = small_specification(
        cameras=(camera,),
        flight=(line,),
        variation=FlightVariation((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0),
        terrain=TerrainShape(mean=0.0, relief=0.0),
        points=PointSpecification(count=400),
        survey=(),
        system=SystemSpecification(),
        noise=noise,
    )
    return simulate_block(specification)
