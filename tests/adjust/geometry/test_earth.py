"""The ellipsoid and the local frames."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adjust.geometry import rotation
from adjust.geometry.earth import (
    CartesianFrame,
    Ellipsoid,
    TopocentricFrame,
    ecef_from_enu,
    ecef_from_geodetic,
    geodetic_from_ecef,
)

GRS80 = Ellipsoid(6378137.0, 1.0 / 298.257222101)
ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
latitudes = st.floats(-90.0, 90.0)
longitudes = st.floats(-180.0, 180.0)


def topocentric(latitude_deg: float, longitude_deg: float, height_m: float = 0.0) -> TopocentricFrame:
    return TopocentricFrame(GRS80, np.deg2rad(latitude_deg), np.deg2rad(longitude_deg), height_m)


def test_axes_of_the_ellipsoid_stand_where_they_should() -> None:
    b = GRS80.semi_major_m * (1.0 - GRS80.flattening)
    geodetic = np.array([[0.0, 0.0, 10.0], [0.0, 0.5 * np.pi, 20.0], [0.5 * np.pi, 0.0, 30.0]])
    expected = [[GRS80.semi_major_m + 10.0, 0, 0], [0, GRS80.semi_major_m + 20.0, 0], [0, 0, b + 30.0]]
    np.testing.assert_allclose(ecef_from_geodetic(GRS80, geodetic), expected, atol=1e-8)


@given(latitudes, longitudes, st.floats(-500.0, 100_000.0))
@settings(max_examples=200, deadline=None)
def test_geodetic_coordinates_return_from_geocentric_ones(
    latitude: float, longitude: float, height: float
) -> None:
    given_point = np.array([[np.deg2rad(latitude), np.deg2rad(longitude), height]])
    geocentric = ecef_from_geodetic(GRS80, given_point)
    found = geodetic_from_ecef(GRS80, geocentric)
    np.testing.assert_allclose(ecef_from_geodetic(GRS80, found), geocentric, atol=5e-9)
    assert abs(found[0, 2] - height) < 5e-9
    assert abs(found[0, 0] - given_point[0, 0]) * GRS80.semi_major_m < 5e-9


@given(latitudes, longitudes)
@settings(max_examples=50, deadline=None)
def test_up_is_the_gradient_of_the_height(latitude: float, longitude: float) -> None:
    point = ecef_from_geodetic(GRS80, np.deg2rad([[latitude, longitude, 0.0]]))[0]
    step = 10.0
    numeric = np.array(
        [
            (geodetic_from_ecef(GRS80, point + d)[2] - geodetic_from_ecef(GRS80, point - d)[2]) / (2 * step)
            for d in step * np.eye(3)
        ]
    )
    found = geodetic_from_ecef(GRS80, point)
    np.testing.assert_allclose(ecef_from_enu(found[0], found[1])[:, 2], numeric, atol=1e-8)


@pytest.mark.parametrize(("distance_m", "drop_m"), [(1000.0, 0.0785), (3000.0, 0.71), (6000.0, 2.83)])
def test_the_earth_falls_away_by_half_the_squared_distance_over_its_radius(
    distance_m: float, drop_m: float
) -> None:
    frame = topocentric(48.0, 11.0)
    for direction in ([1.0, 0.0, 0.0], [0.0, -1.0, 0.0]):
        height = frame.height(distance_m * np.array([direction]))[0]
        # At 48° the radii of curvature are 6371 km (meridian) and 6390 km (across).
        radius = 6_389_960.0 if direction[0] else 6_370_900.0
        assert height == pytest.approx(distance_m**2 / (2.0 * radius), rel=1e-4)
        # The values of the reference are for some mean radius, rounded to two or three digits.
        assert height == pytest.approx(drop_m, rel=1e-2)


@given(st.floats(-20_000.0, 20_000.0), st.floats(-20_000.0, 20_000.0), st.floats(-200.0, 8000.0))
@settings(max_examples=100, deadline=None)
def test_local_coordinates_return_from_geodetic_ones(x: float, y: float, z: float) -> None:
    frame = topocentric(-33.0, 151.0, 250.0)
    given_point = np.array([[x, y, z]])
    np.testing.assert_allclose(frame.from_geodetic(frame.to_geodetic(given_point)), given_point, atol=5e-9)


def test_distances_are_true_in_the_local_frame() -> None:
    frame = topocentric(48.0, 11.0)
    geodetic = np.array([[0.84, 0.19, 100.0], [0.841, 0.1915, 900.0]])
    local = frame.from_geodetic(geodetic)
    geocentric = ecef_from_geodetic(GRS80, geodetic)
    assert np.linalg.norm(local[1] - local[0]) == pytest.approx(
        np.linalg.norm(geocentric[1] - geocentric[0]), abs=1e-8
    )


def test_vertical_eight_kilometres_away_is_tilted_as_computed_independently() -> None:
    frame = topocentric(48.0, 11.0)
    east_north_up = frame.local_from_enu(np.array([[5968.403, 5556.221, 2334.787]]))[0]
    assert np.linalg.det(east_north_up) == pytest.approx(1.0)
    tilt_east, tilt_north = np.rad2deg(np.arctan2(east_north_up[:2, 2], east_north_up[2, 2]))
    assert (tilt_east, tilt_north) == pytest.approx((5968.4 / 111_500, 5556.2 / 111_200), rel=0.01)
    twist = np.rad2deg(np.arctan2(east_north_up[1, 0], east_north_up[0, 0]))
    # Convergence: difference of longitude times the sine of the latitude.
    longitude = np.rad2deg(frame.to_geodetic(np.array([[5968.403, 5556.221, 2334.787]]))[0, 1]) - 11.0
    assert twist == pytest.approx(longitude * np.sin(np.deg2rad(48.0)), rel=0.01)


def test_published_attitude_in_a_fixed_frame_some_kilometres_away() -> None:
    # formats.md 16.3, last row: exposure at 48°/12°, frame at 47.9°/12.3°.
    frame = topocentric(47.9, 12.3)
    centre = frame.from_geodetic(np.array([[np.deg2rad(48.0), np.deg2rad(12.0), 1000.0]]))
    body = rotation.ned_from_body(np.deg2rad([87.5, -0.8, 1.2]))
    installation = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    matrix = frame.local_from_enu(centre)[0] @ ENU_FROM_NED @ body @ installation
    np.testing.assert_allclose(
        np.rad2deg(rotation.to_omega_phi_kappa(matrix)), [1.066952, 0.646175, -87.735860], atol=6e-7
    )


def test_a_cartesian_project_has_one_vertical_everywhere() -> None:
    points = np.array([[0.0, 0.0, 5.0], [1e5, -2e5, 7.0]])
    frame = CartesianFrame()
    np.testing.assert_array_equal(frame.height(points), [5.0, 7.0])
    np.testing.assert_array_equal(frame.local_from_enu(points), np.stack([np.eye(3)] * 2))
