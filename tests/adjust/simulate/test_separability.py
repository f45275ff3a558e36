"""What a flight pattern can separate: standard deviations and correlations of a camera system.

Nine hundred tie points, 84 control points, 60/60 per cent, relief 15 m, σ 1.2 µm, 5 cm, 0.003/0.003/0.008°.
The expected figures come from an independent program with a block of the same description; headings
separate the principal point from the GNSS shift, a second height the focal length from its height
component.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.camera.interior import FrameCamera
from adjust.parameters import BORESIGHT, GNSS_SHIFT, INTERIOR_ORIENTATION
from adjust.simulate.block import simulate_block
from adjust.simulate.flight_plan import LineGroup, LinePattern, base_of, spacing_of
from adjust.simulate.noise import NoiseSpecification
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.survey import SurveyLayout
from adjust.simulate.terrain import TerrainShape
from adjust.simulate.trajectory import FlightVariation
from adjust.simulate.truth import BlockSpecification

CAMERA = FrameCamera("UCE", 13080, 20010, 5.2e-6, 0.08, (0.0, 0.0), "corner", 0)
LOW, HIGH = 780.0, 2340.0
EAST, NORTH = np.pi / 2, 0.0
NOISE = NoiseSpecification(
    1.2e-6, (0.02, 0.02, 0.02), (0.05, 0.05, 0.05), tuple(np.deg2rad([0.003, 0.003, 0.008]).tolist())
)
CRAB = FlightVariation(attitude=(np.deg2rad(1.0), np.deg2rad(1.0), 0.0), crab=np.deg2rad(4.0))


def _lines(
    name: str, height: float, heading: float, exposures: tuple[int, int], pattern: LinePattern
) -> LineGroup:
    base, spacing = base_of(CAMERA, height, 0.6), spacing_of(CAMERA, height, 0.6)
    lines, images = exposures
    return LineGroup(name, "1", 0, heading, height, (images,) * lines, base, spacing, pattern)


def _low(pattern: LinePattern) -> LineGroup:
    return _lines("L", LOW, EAST, (6, 14), pattern)


def _high(pattern: LinePattern) -> LineGroup:
    return _lines("H", HIGH, EAST, (2, 6), pattern)


def _crossing(pattern: LinePattern) -> LineGroup:
    return _lines("C", LOW, NORTH, (9, 10), pattern)


@dataclass(frozen=True)
class Expected:
    """A row of the table.

    Attributes
    ----------
    images : number of images.
    with_shift : correlations of x0, y0, c with the GNSS shift along x, y, z.
    sigma_um : of c, x0, y0.  shift_cm : of the GNSS shift.  boresight_mdeg : roll, pitch, yaw.
    """

    images: int
    with_shift: tuple[float, float, float]
    sigma_um: tuple[float, float, float]
    shift_cm: tuple[float, float, float]
    boresight_mdeg: tuple[float, float, float]


PATTERNS: dict[str, tuple[tuple[LineGroup, ...], Expected]] = {
    "single direction, one height": (
        (_low("single"),),
        Expected(84, (-0.99, -0.99, -1.00), (9.72, 4.85, 4.82), (4.76, 4.73, 9.48), (0.41, 0.41, 0.88)),
    ),
    "alternating, one height": (
        (_low("alternating"),),
        Expected(84, (0.00, 0.00, -1.00), (9.85, 0.57, 0.58), (0.65, 0.66, 9.61), (0.37, 0.37, 0.88)),
    ),
    "forward and reverse, one height": (
        (_low("both"),),
        Expected(168, (0.00, 0.00, -1.00), (6.68, 0.39, 0.38), (0.49, 0.49, 6.52), (0.24, 0.25, 0.63)),
    ),
    "crossing, one height": (
        (_low("alternating"), _crossing("alternating")),
        Expected(174, (0.00, -0.01, -1.00), (6.63, 0.39, 0.38), (0.48, 0.49, 6.48), (0.25, 0.26, 0.61)),
    ),
    "single direction, two heights": (
        (_low("single"), _high("single")),
        Expected(96, (-0.85, -0.83, -0.85), (0.82, 0.94, 0.95), (1.23, 1.21, 1.13), (0.39, 0.37, 0.82)),
    ),
    "alternating, two heights": (
        (_low("alternating"), _high("alternating")),
        Expected(96, (0.00, 0.00, -0.84), (0.82, 0.41, 0.40), (0.63, 0.64, 1.13), (0.34, 0.34, 0.82)),
    ),
    "forward and reverse, two heights": (
        (_low("both"), _high("both")),
        Expected(192, (0.00, 0.00, -0.82), (0.59, 0.28, 0.27), (0.47, 0.48, 0.82), (0.23, 0.23, 0.59)),
    ),
    "crossing, forward and reverse, two heights": (
        (_low("both"), _crossing("both"), _high("both"), _lines("K", HIGH, NORTH, (2, 5), "both")),
        Expected(392, (0.00, 0.00, -0.79), (0.44, 0.20, 0.19), (0.37, 0.38, 0.60), (0.16, 0.17, 0.41)),
    ),
}


@pytest.mark.parametrize("name", list(PATTERNS))
def test_a_flight_pattern_separates_what_it_should(name: str) -> None:
    flight, expected = PATTERNS[name]
    specification = BlockSpecification(
        cameras=(CAMERA,),
        flight=flight,
        points=PointSpecification(910),
        noise=NOISE,
        survey=(SurveyLayout("grid", columns=12, rows=7),),
        terrain=TerrainShape(relief=15.0),
        variation=CRAB,
    )
    simulated = simulate_block(specification)
    assert len(simulated.truth.plan.images) == expected.images
    block = simulated.block((INTERIOR_ORIENTATION, BORESIGHT, GNSS_SHIFT))
    result = adjust_block(block, simulated.observations(block))

    names = [parameter for parameter, _, _ in result.layout.border_names()]
    cofactor = result.cofactor.reduced.corner
    sigma = dict(zip(names, np.sqrt(np.diagonal(cofactor)), strict=True))
    found_um = [1e6 * sigma[n] for n in ("focal_length", "principal_point_x", "principal_point_y")]
    found_cm = [1e2 * sigma[f"gnss_shift_{axis}"] for axis in "xyz"]
    found_mdeg = [np.rad2deg(1e3 * sigma[f"boresight_{angle}"]) for angle in ("roll", "pitch", "yaw")]
    # Another terrain, other tilts and other points: ten per cent and the last digit printed.
    np.testing.assert_allclose(found_um, expected.sigma_um, rtol=0.1, atol=0.005)
    np.testing.assert_allclose(found_cm, expected.shift_cm, rtol=0.1, atol=0.005)
    np.testing.assert_allclose(found_mdeg, expected.boresight_mdeg, rtol=0.1, atol=0.005)

    pairs = (
        ("principal_point_x", "gnss_shift_x"),
        ("principal_point_y", "gnss_shift_y"),
        ("focal_length", "gnss_shift_z"),
    )
    correlation = [
        cofactor[names.index(one), names.index(other)] / (sigma[one] * sigma[other]) for one, other in pairs
    ]
    np.testing.assert_allclose(correlation, expected.with_shift, atol=0.03)
