"""A small block to simulate, and errors of an adjustment over their predicted standard deviations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Floats
from adjust.camera.interior import FrameCamera
from adjust.geometry import rotation
from adjust.geometry.earth import Ellipsoid, TopocentricFrame
from adjust.parameters import State
from adjust.result import AdjustmentResult
from adjust.simulate.flight_plan import LineGroup, base_of, spacing_of
from adjust.simulate.noise import NoiseSpecification
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.survey import SurveyLayout
from adjust.simulate.system import SystemSpecification
from adjust.simulate.terrain import TerrainShape
from adjust.simulate.trajectory import FlightVariation
from adjust.simulate.truth import BlockSpecification

HEIGHT = 1000.0
CAMERA = FrameCamera("C", 9000, 12000, 6e-6, 0.08, (0.0, 0.0), "corner", 0)
NOISE = NoiseSpecification(
    image=1.5e-6,
    control=(0.02, 0.02, 0.03),
    gnss=(0.05, 0.05, 0.07),
    ins=(np.deg2rad(0.003), np.deg2rad(0.003), np.deg2rad(0.008)),
)
GRS80 = Ellipsoid(6378137.0, 1.0 / 298.257222101)


def small_specification(**changes: object) -> BlockSpecification:
    """20 images: two lines east and west, two lines north and south, five exposures each."""
    base, spacing = base_of(CAMERA, HEIGHT, 0.6), spacing_of(CAMERA, HEIGHT, 0.6)
    exposures = (5, 5)
    specification = BlockSpecification(
        cameras=(CAMERA,),
        flight=(
            LineGroup("E", "1", 0, np.pi / 2, HEIGHT, exposures, base, spacing),
            LineGroup("N", "1", 0, 0.0, HEIGHT, exposures, base, spacing),
        ),
        points=PointSpecification(count=150),
        noise=NOISE,
        survey=(SurveyLayout("grid", columns=3, rows=3),),
        variation=FlightVariation(rate=(np.deg2rad(1.0),) * 3),
        terrain=TerrainShape(mean=200.0, relief=15.0),
        system=SystemSpecification(boresight=(2e-3, -1e-3, 4e-3), gnss_shift=(-0.26, 0.12, 0.29)),
        seed=5,
    )
    return replace(specification, **changes)  # type: ignore[arg-type]


def without_noise(specification: BlockSpecification) -> BlockSpecification:
    """The same block measured without noise, its stated standard deviations unchanged."""
    return replace(specification, noise=replace(specification.noise, level=0.0))


def on_the_earth(specification: BlockSpecification) -> BlockSpecification:
    """The same block in a topocentric frame."""
    frame = TopocentricFrame(GRS80, np.deg2rad(48.9), np.deg2rad(8.9))
    return replace(specification, frame=frame)


@dataclass(frozen=True, eq=False)
class Errors:
    """Estimated minus true: metres and radians, (n, 3), (n, 3), (m, 3); and their predicted variances."""

    positions: Floats
    attitudes: Floats
    points: Floats
    variance_of_positions: Floats
    variance_of_attitudes: Floats
    variance_of_points: Floats

    @property
    def normalized_squares(self) -> dict[str, Floats]:
        """Squares of error over standard deviation."""
        return {
            "positions": self.positions**2 / self.variance_of_positions,
            "attitudes": self.attitudes**2 / self.variance_of_attitudes,
            "points": self.points**2 / self.variance_of_points,
        }


def errors_of(result: AdjustmentResult, truth: State) -> Errors:
    """Errors of an adjustment with predicted variances for σ0 = 1."""
    turned = np.swapaxes(truth.local_from_camera, 1, 2) @ result.state.local_from_camera
    variance = np.diagonal(result.cofactor.reduced.of_exposures, axis1=1, axis2=2)
    return Errors(
        result.state.projection_centre - truth.projection_centre,
        rotation.log(turned),
        result.state.object_point - truth.object_point,
        variance[:, :3],
        variance[:, 3:],
        np.diagonal(result.cofactor.of_points, axis1=1, axis2=2),
    )
