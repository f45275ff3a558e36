from __future__ import annotations

import numpy as np
import pyproj
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasks.coordinates.crs import MapFrame
from tasks.errors import InputError
from tasks.settings.coordinates import ELLIPSOIDAL, Heights, LinearAlteration

LAMBERT93 = MapFrame.of("EPSG:2154", ELLIPSOIDAL)
#: Frames with the area (west, south, east, north in degrees) in which they are tried.
FRAMES = {
    "EPSG:2154": (-4.0, 42.0, 8.0, 51.0),
    "EPSG:32618": (-78.0, 1.0, -72.0, 83.0),
    "EPSG:27572": (-4.0, 43.0, 8.0, 51.0),
    "EPSG:21781": (6.0, 46.0, 10.0, 47.5),
    "EPSG:2193": (167.0, -47.0, 178.0, -34.5),
    "EPSG:4326": (-179.0, -89.0, 179.0, 89.0),
}


def raf20(test_data):
    return test_data / "ign_borea_uce_m3" / "fr_ign_RAF20.tif"


@pytest.mark.parametrize("name", FRAMES)
@settings(max_examples=60, deadline=None)
@given(east=st.floats(0.0, 1.0), north=st.floats(0.0, 1.0), height=st.floats(-100.0, 9000.0))
def test_map_and_geodetic_coordinates_are_inverse(name, east, north, height):
    west, south, east_end, north_end = FRAMES[name]
    frame = MapFrame.of(name, ELLIPSOIDAL)
    geodetic = np.array(
        [
            [
                np.radians(south + north * (north_end - south)),
                np.radians(west + east * (east_end - west)),
                height,
            ]
        ]
    )
    back = frame.to_geodetic(frame.from_geodetic(geodetic))
    np.testing.assert_allclose(back[:, :2], geodetic[:, :2], rtol=0, atol=1e-12)
    in_map = frame.from_geodetic(geodetic)
    # 1e-9 m and the rounding of coordinates of 10⁷ m; the Swiss oblique projection is solved by iteration.
    tolerance = 1e-8 if name == "EPSG:21781" else 1e-9
    np.testing.assert_allclose(frame.from_geodetic(back), in_map, rtol=2e-15, atol=tolerance)


def test_lambert_93_agrees_with_its_published_worked_constants():
    # The projection's origin: 46.5° N, 3° E lies at (700000, 6600000) by definition.
    origin = LAMBERT93.from_geodetic(np.radians([[46.5, 3.0, 0.0]]))
    np.testing.assert_allclose(origin, [[700000.0, 6600000.0, 0.0]], atol=1e-6)
    # The scale is 1 on the standard parallels 44° and 49°.
    scale = LAMBERT93.point_scale(np.radians([44.0, 49.0]), np.radians([3.0, 1.0]))
    np.testing.assert_allclose(scale, 1.0, atol=1e-9)


def test_point_scale_and_height_of_the_ign_block():
    latitude, longitude, _ = LAMBERT93.to_geodetic(np.array([[521565.58, 6459960.99, 0.0]]))[0]
    np.testing.assert_allclose(
        LAMBERT93.point_scale(np.array([latitude]), np.array([longitude])), 0.999307, atol=5e-7
    )


def test_grid_kappa_is_true_kappa_plus_convergence_east_of_the_meridian():
    frame = MapFrame.of("EPSG:32618", ELLIPSOIDAL)
    place = frame.from_geodetic(np.radians([[40.13, -74.94, 0.0]]))
    np.testing.assert_allclose(np.degrees(frame.convergence(place)), 0.03867, atol=5e-6)


def test_convergence_of_the_angle_test_vector():
    frame = MapFrame.of("EPSG:32633", ELLIPSOIDAL)
    place = frame.from_geodetic(np.radians([[48.0, 12.0, 0.0]]))
    np.testing.assert_allclose(np.degrees(frame.convergence(place)), -2.230355, atol=1e-6)
    np.testing.assert_allclose(frame.point_scale(np.radians([48.0]), np.radians([12.0])), 1.000215, atol=5e-7)


@settings(max_examples=50, deadline=None)
@given(latitude=st.floats(42.0, 51.0), longitude=st.floats(-4.0, 8.0))
def test_convergence_of_a_conical_projection_is_closed(latitude, longitude):
    # In a conformal conic projection γ = n (λ − λ0), with n of the two standard parallels.
    e = np.sqrt(LAMBERT93.ellipsoid.eccentricity_squared)

    def isometric(phi):
        return np.arctanh(np.sin(phi)) - e * np.arctanh(e * np.sin(phi))

    def parallel(phi):
        return np.cos(phi) / np.sqrt(1.0 - (e * np.sin(phi)) ** 2)

    first, second = np.radians([44.0, 49.0])
    n = np.log(parallel(first) / parallel(second)) / (isometric(second) - isometric(first))
    place = LAMBERT93.from_geodetic(np.radians([[latitude, longitude, 0.0]]))
    expected = n * np.radians(longitude - 3.0)
    np.testing.assert_allclose(LAMBERT93.convergence(place), expected, atol=2e-10)


def test_the_geoid_lies_above_the_ellipsoid_in_france(test_data):
    frame = MapFrame.of("EPSG:2154", Heights(geoid=raf20(test_data)))
    undulation = frame.geoid_undulation(np.radians([45.2159, 43.6423]), np.radians([0.7265, 4.4324]))
    # About 47.4 m in the Dordogne and 49.3 m in the Camargue.
    assert np.all((undulation > 46.0) & (undulation < 51.0))


def test_the_undulation_is_the_bilinear_value_between_the_nodes_of_the_grid(test_data):
    frame = MapFrame.of("EPSG:2154", Heights(geoid=raf20(test_data)))
    corners = np.radians(
        [[44.0, 2.0], [44.0, 2.0 + 1 / 60], [44.0 + 1 / 80, 2.0], [44.0 + 1 / 80, 2.0 + 1 / 60]]
    )
    middle = frame.geoid_undulation(corners[:, 0].mean(keepdims=True), corners[:, 1].mean(keepdims=True))
    around = frame.geoid_undulation(corners[:, 0], corners[:, 1])
    assert around.min() - 0.02 < middle[0] < around.max() + 0.02


def test_heights_above_the_geoid_go_there_and_back(test_data):
    heights = Heights(geoid=raf20(test_data), linear_alteration=LinearAlteration(ground_m=205.0))
    frame = MapFrame.of("EPSG:2154", heights)
    place = np.array([[521565.58, 6459960.99, 6694.844], [815000.0, 6284000.0, 3.0]])
    np.testing.assert_allclose(frame.from_geodetic(frame.to_geodetic(place)), place, atol=2e-9)


def test_the_linear_alteration_divides_the_height_above_ground_by_the_point_scale(test_data):
    plain = MapFrame.of("EPSG:2154", Heights(geoid=raf20(test_data)))
    altered = MapFrame.of(
        "EPSG:2154", Heights(geoid=raf20(test_data), linear_alteration=LinearAlteration(ground_m=205.0))
    )
    place = np.array([[521565.58, 6459960.99, 6705.0]])
    latitude, longitude, height = plain.to_geodetic(place)[0]
    scale = plain.point_scale(np.array([latitude]), np.array([longitude]))[0]
    lifted = altered.to_geodetic(place)[0, 2] - height
    # h = Zg + (Z − Zg)/k + N: 6500 m above ground become 4.5 m more.
    np.testing.assert_allclose(lifted, 6500.0 / scale - 6500.0, atol=1e-9)
    assert 4.4 < lifted < 4.6


def test_outside_the_geoid_grid_there_is_no_undulation(test_data):
    frame = MapFrame.of("EPSG:2154", Heights(geoid=raf20(test_data)))
    assert np.isnan(frame.geoid_undulation(np.radians([60.0]), np.radians([3.0])))[0]


def test_a_grid_in_a_folder_with_a_blank_is_found(test_data, tmp_path):
    folder = tmp_path / "geoid grids"
    folder.mkdir()
    (folder / "raf.tif").write_bytes(raf20(test_data).read_bytes())
    frame = MapFrame.of("EPSG:2154", Heights(geoid=folder / "raf.tif"))
    assert 47.0 < frame.geoid_undulation(np.radians([45.2]), np.radians([0.73]))[0] < 48.0


def test_a_missing_grid_is_never_an_undulation_of_zero(tmp_path):
    with pytest.raises(InputError, match="geoid grid is missing"):
        MapFrame.of("EPSG:2154", Heights(geoid=tmp_path / "raf.tif"))


@pytest.mark.parametrize(
    ("crs", "what"),
    [
        ("EPSG:999999", "not known"),
        ("nonsense", "not known"),
        ("EPSG:4978", "includes heights"),
        ("EPSG:4979", "includes heights"),
        ("EPSG:2154+5720", "includes heights"),
        ("EPSG:2272", "US survey foot"),
        ("EPSG:2048", "do not point east and north"),
        ("EPSG:5720", "neither a map projection nor geographic"),
    ],
)
def test_a_crs_that_cannot_be_used_is_refused(crs, what):
    with pytest.raises(InputError, match=what) as raised:
        MapFrame.of(crs, ELLIPSOIDAL)
    assert raised.value.remedy


def test_axes_of_the_crs_in_another_order_do_not_matter():
    # EPSG:31467 is defined as northing, easting.
    frame = MapFrame.of("EPSG:31467", ELLIPSOIDAL)
    x, y, _ = frame.from_geodetic(np.radians([[50.0, 9.0, 0.0]]))[0]
    assert 3_499_000 < x < 3_501_000
    assert 5_500_000 < y < 5_600_000


def test_a_prime_meridian_other_than_greenwich_is_taken_off():
    frame = MapFrame.of("EPSG:27572", ELLIPSOIDAL)
    # The central meridian is that of Paris, 2°20'14.025" east of Greenwich.
    geodetic = frame.to_geodetic(np.array([[600000.0, 2200000.0, 0.0]]))[0]
    np.testing.assert_allclose(np.degrees(geodetic[1]), 2 + 20 / 60 + 14.025 / 3600, atol=1e-9)
    np.testing.assert_allclose(np.degrees(geodetic[0]), 46.8, atol=1e-9)


def test_the_area_of_use_knows_zones_and_swapped_axes():
    inside = LAMBERT93.inside_area_of_use(
        np.array([[521565.0, 6459960.0, 0.0], [6459960.0, 521565.0, 0.0], [0.0, 0.0, 0.0]])
    )
    assert inside.tolist() == [True, False, False]


def test_a_block_beyond_its_zone_is_practice_and_one_far_away_is_not():
    frame = MapFrame.of("EPSG:25832", ELLIPSOIDAL)  # 6° E to 12° E
    places = frame.from_geodetic(np.radians([[55.1, 14.9, 0.0], [55.1, 20.0, 0.0]]))
    assert frame.inside_area_of_use(places).tolist() == [True, False]


def test_an_area_across_the_date_line_is_one_area():
    frame = MapFrame.of("EPSG:32601", ELLIPSOIDAL)  # 180° W to 174° W
    places = frame.from_geodetic(np.radians([[10.0, -177.0, 0.0], [10.0, 179.8, 0.0]]))
    assert frame.inside_area_of_use(places).tolist() == [True, True]


def test_a_local_frame_has_no_place_on_the_earth():
    frame = MapFrame.of("local", ELLIPSOIDAL)
    assert frame.convergence(np.zeros((2, 3))).tolist() == [0.0, 0.0]
    with pytest.raises(ValueError, match="no location on the earth"):
        frame.to_geodetic(np.zeros((1, 3)))


def test_the_description_names_grids_but_no_paths(test_data):
    text = MapFrame.of("EPSG:2154", Heights(geoid=raf20(test_data))).description
    assert text == "EPSG:2154 (RGF93 v1 / Lambert-93), heights above the geoid fr_ign_RAF20.tif"


@pytest.mark.parametrize(
    "crs",
    [
        "+proj=utm +zone=32 +ellps=bessel +nadgrids=/etc/hostname +type=crs",
        "+proj=utm +zone=32 +datum=WGS84 +geoidgrids=/etc/hostname +type=crs",
        "+init=/etc/hostname:x",
        "bound, as WKT",
        "bound, as JSON",
    ],
)
def test_a_crs_that_names_a_file_is_refused_before_proj_opens_it(crs: str) -> None:
    if crs.startswith("bound"):
        bound = pyproj.CRS("+proj=utm +zone=32 +ellps=bessel +nadgrids=/etc/hostname +type=crs")
        crs = bound.to_wkt() if "WKT" in crs else bound.to_json()
    with pytest.raises(InputError, match="refers to a file"):
        MapFrame.of(crs, ELLIPSOIDAL)


def test_a_crs_with_a_datum_shift_by_numbers_is_taken() -> None:
    crs = "+proj=utm +zone=32 +ellps=bessel +towgs84=598.1,73.7,418.2,0.202,0.045,-2.455,6.7 +type=crs"
    assert MapFrame.of(crs, ELLIPSOIDAL).is_projected
