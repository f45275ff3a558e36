"""What a Cartesian reading of the map costs: the magnitudes of an independent computation.

A camera of 26,460 × 17,004 pixels of 4 µm and 79.8 mm over ground at 400 m, UTM at 48° north, on the central
meridian and at the edge of the zone; largest error in plan of an image, and in metres.
"""

from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.geometry.earth import TopocentricFrame
from adjust.geometry.rotation import about_x
from adjust.handover.cartesian_map import CartesianMap, Pose, on_ground
from adjust.handover.rational import fit_rational_polynomials
from adjust.handover.refit import Freed, refit
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import local_from_map
from tasks.handover.rigorous import OrientedImages
from tasks.settings.coordinates import Heights

GROUND, C, PIXEL = 400.0, 0.0798, 4e-6
FLAT, CURVED = CartesianMap(), CartesianMap(6.371e6)
UTM = MapFrame.of("EPSG:25832", Heights.model_validate("ellipsoidal"))


def image(longitude_deg: float, above: float, tilt_deg: float = 0.0) -> OrientedImages:
    """One image, level or tilted about its x axis."""
    latitude, longitude = np.deg2rad([48.0, longitude_deg])
    frame = TopocentricFrame(UTM.ellipsoid, float(latitude), float(longitude))
    in_map = UTM.from_geodetic(np.array([[latitude, longitude, GROUND + above]]))
    centre = local_from_map(UTM, frame, in_map)
    local_from_camera = np.asarray(frame.local_from_enu(centre)) @ about_x(np.deg2rad(tilt_deg))
    half, c, pixel = ((0.034008, 0.05292), C, PIXEL) if tilt_deg == 0.0 else ((0.0265, 0.02), 0.123, 3.76e-6)
    return OrientedImages(
        ("1",), np.array([0]), UTM, frame, centre, local_from_camera, np.array([c]), np.array([half]),
        np.array([pixel]),
    )  # fmt: skip


def error_in_plan(images: OrientedImages, world: CartesianMap, pose: Pose, heights: list[float]) -> float:
    ideal, height = sampled(images, heights)
    away = on_ground(world, pose, ideal, height) - images.ground(ideal, height)
    return float(np.linalg.norm(away[..., :2], axis=-1).max())


def sampled(images: OrientedImages, heights: list[float]) -> tuple[Floats, Floats]:
    grid = images.grid_of_image_points(9)
    return np.tile(grid, (1, len(heights), 1)), np.repeat([heights], grid.shape[1], axis=1)


def relief(above: float) -> list[float]:
    return [GROUND - 0.1 * above, GROUND, GROUND + 0.1 * above]


@pytest.mark.parametrize(
    ("above", "longitude", "centimetres"),
    [(1000, 9.0, 32.6), (2000, 9.0, 57.6), (4000, 9.0, 86.6), (1000, 12.0, 16.0), (2000, 12.0, 40.0),
     (4000, 12.0, 112.0)],
)  # fmt: skip
def test_true_orientations_read_as_cartesian(above: float, longitude: float, centimetres: float) -> None:
    images = image(longitude, above)
    found = error_in_plan(images, FLAT, images.map_pose, [GROUND])
    assert 100.0 * found == pytest.approx(centimetres, rel=0.02)


@pytest.mark.parametrize(
    ("above", "longitude", "flat", "with_relief"),
    [(1000, 9.0, 1.5, 3.2), (2000, 9.0, 6.1, 7.1), (4000, 9.0, 24.4, 43.0), (1000, 12.0, 1.6, 4.8),
     (2000, 12.0, 6.2, 16.8), (4000, 12.0, 25.0, 62.0)],
)  # fmt: skip
def test_orientations_fitted_alone(above: float, longitude: float, flat: float, with_relief: float) -> None:
    images = image(longitude, above)
    for heights, centimetres in (([GROUND], flat), (relief(above), with_relief)):
        ideal, height = sampled(images, heights)
        ground = images.ground(ideal, height)
        pose = refit(FLAT, images.map_pose, images.camera, ideal, ground, Freed()).pose
        found = error_in_plan(images, FLAT, pose, heights)
        assert 100.0 * found == pytest.approx(centimetres, rel=0.1)


@pytest.mark.parametrize(("above", "centimetres"), [(1000, 0.3), (2000, 1.2), (4000, 4.6)])
@pytest.mark.parametrize("longitude", [9.0, 12.0])
@pytest.mark.parametrize(
    ("world", "freed"),
    [(CURVED, Freed(focal_length=True)), (FLAT, Freed(focal_length=True, radial=True))],
)
def test_orientations_fitted_with_the_camera(
    above: float, centimetres: float, longitude: float, world: CartesianMap, freed: Freed
) -> None:
    images = image(longitude, above)
    ideal, height = sampled(images, relief(above))
    ground = images.ground(ideal, height)
    fitted = refit(world, images.map_pose, images.camera, ideal, ground, freed)
    assert 100.0 * error_in_plan(images, world, fitted.pose, relief(above)) < 1.05 * centimetres
    assert fitted.largest.max() < 0.25 * PIXEL
    # These are no positions of the camera: some decimetres at 1 km, metres at 4 km.
    lowered = fitted.pose.centre[0, 2] - images.map_pose.centre[0, 2]
    assert lowered == pytest.approx(-(above**2) / 6.371e6 * 1.1, rel=0.2)


@pytest.mark.parametrize("longitude", [9.0, 12.0])
@pytest.mark.parametrize(("above", "tilt"), [(1000, 0.0), (2000, 0.0), (4000, 0.0), (1000, 45.0)])
def test_rational_polynomials_stand_for_the_camera(above: float, tilt: float, longitude: float) -> None:
    images = image(longitude, above, tilt)
    heights = list(np.linspace(*relief(above)[::2], 5))
    grid = images.grid_of_image_points(15)
    ideal, height = np.tile(grid, (1, 5, 1)), np.repeat([heights], grid.shape[1], axis=1)
    polynomials = fit_rational_polynomials(in_degrees(images.ground(ideal, height)), ideal[0])
    random = np.random.default_rng(4)
    elsewhere = random.uniform(-1.0, 1.0, (1, 400, 2)) * images.half_format[0]
    level = random.uniform(heights[0], heights[-1], (1, 400))
    away = polynomials.project(in_degrees(images.ground(elsewhere, level))) - elsewhere[0]
    assert np.abs(away).max() < 1e-3 * PIXEL


def in_degrees(in_map: Floats) -> Floats:
    geodetic = UTM.to_geodetic(in_map[0])
    geodetic[:, :2] = np.rad2deg(geodetic[:, :2])
    return geodetic
