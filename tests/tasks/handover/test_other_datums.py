"""Programs that know WGS 84 only get a block of another datum where it is on WGS 84.

The Swiss datum CH1903+ has Bessel's ellipsoid, some 180 m and 50 m in height from WGS 84. Expected places are
those of PROJ, from the map at once to geocentric coordinates.
"""

from __future__ import annotations

import json
import re
import tomllib
import zipfile

import numpy as np
import pyproj
import pytest

from adjust.geometry.earth import ecef_from_geodetic
from adjust.geometry.rotation import from_omega_phi_kappa
from tasks.errors import InputError
from tasks.formats.earth_poses import WGS84
from tasks.formats.register import CONTROL_FORMATS, EXPOSURE_FORMATS
from tasks.handover.formats.register import REGISTER
from tasks.handover.recognised import project_text, recognised
from tasks.handover.statement import statement
from tests.tasks.formats.test_classical_formats import ANGLES, BLOCKS
from tests.tasks.handover.flown_block import GROUND, Flight, delivered, flown
from tests.tasks.handover.test_ground_through_files import write

SWISS = Flight(2000.0, longitude_deg=8.0, crs="EPSG:2056")
#: Format → its files of orientations, and of complete surveyed points with their reader.
FILES = {
    "opensfm": ("reconstruction.json", "gcp_list.txt", "odm-gcp"),
    "metashape-xml": ("metashape_cameras.xml", "metashape_markers.xml", "metashape-markers"),
    "blocks-exchange": ("block.xml", "block.xml", "blocks-exchange"),
}
READERS = {"metashape-xml": "metashape"}


def on_earth(in_map):
    """Geocentric coordinates (n, 3) of WGS 84 of Swiss map coordinates with ellipsoidal heights."""
    to_earth = pyproj.Transformer.from_crs(
        pyproj.CRS("EPSG:2056").to_3d(), "EPSG:4978", always_xy=True, allow_ballpark=False
    )
    return np.column_stack(to_earth.transform(*in_map.T))


def of_degrees(place):
    """Geocentric coordinates (n, 3) of longitude, latitude (degrees) and height."""
    radians = np.column_stack([np.radians(place[:, 1]), np.radians(place[:, 0]), place[:, 2]])
    return ecef_from_geodetic(WGS84, radians)


@pytest.mark.parametrize("name", FILES)
def test_cameras_and_surveyed_points_are_where_proj_has_them(name, tmp_path):
    results, points = flown(SWISS)
    write(delivered(results, points, name), name, tmp_path)
    cameras, control, reader = FILES[name]
    read = EXPOSURE_FORMATS[READERS.get(name, name)](tmp_path / cameras, "omega-phi-kappa")
    order = [read.image.to_pylist().index(image) for image in results.images.names]
    expected = on_earth(results.images.map_pose.centre)
    np.testing.assert_allclose(of_degrees(read.position)[order], expected, rtol=0, atol=2e-3)
    surveyed = CONTROL_FORMATS[reader](tmp_path / control)
    assert len(surveyed.position)
    rows = [points.surveyed.names.index(point) for point in surveyed.point.to_pylist()]
    np.testing.assert_allclose(
        of_degrees(surveyed.position), on_earth(points.surveyed.in_map[rows]), rtol=0, atol=2e-3
    )


@pytest.mark.parametrize("name", FILES)
def test_rotations_are_those_of_the_axes_of_wgs_84(name, tmp_path):
    """A point 1 km in front of each camera is where PROJ has it: 15″ of the vertical would be 7 cm."""
    results, points = flown(SWISS)
    write(delivered(results, points, name), name, tmp_path)
    read = EXPOSURE_FORMATS[READERS.get(name, name)](tmp_path / FILES[name][0], "omega-phi-kappa")
    order = [read.image.to_pylist().index(image) for image in results.images.names]
    images = results.images
    ahead = images.projection_centre - 1000.0 * images.local_from_camera[:, :, 2]
    expected = on_earth(images.map_frame.from_geodetic(images.frame.to_geodetic(ahead)))
    place, turn = read.position[order], from_omega_phi_kappa(np.radians(read.angles[order]))
    sine, cosine = np.sin(np.radians(place[:, :2])), np.cos(np.radians(place[:, :2]))
    east = np.column_stack([-sine[:, 0], cosine[:, 0], np.zeros(len(place))])
    up = np.column_stack([cosine[:, 1] * cosine[:, 0], cosine[:, 1] * sine[:, 0], sine[:, 1]])
    axes = np.stack([east, np.cross(up, east), up], axis=-1)
    found = of_degrees(place) - 1000.0 * (axes @ turn)[:, :, 2]
    np.testing.assert_allclose(found, expected, rtol=0, atol=3e-3)


def test_maps_of_the_globe_have_longitude_and_latitude_of_wgs_84(tmp_path):
    results, points = flown(SWISS)
    expected = on_earth(results.images.map_pose.centre)
    write(delivered(results, points, "geojson"), "geojson", tmp_path)
    features = json.loads((tmp_path / "cameras.geojson").read_text())["features"]
    found = np.array([one["geometry"]["coordinates"] for one in features])
    np.testing.assert_allclose(of_degrees(found), expected, rtol=0, atol=2e-3)
    write(delivered(results, points, "kmz"), "kmz", tmp_path)
    with zipfile.ZipFile(tmp_path / "block.kmz") as packed:
        text = packed.read("doc.kml").decode()
    first = re.findall(r"<coordinates>([^<]+)</coordinates>", text)[:4]
    found = np.array([[float(value) for value in one.split(",")] for one in first])
    np.testing.assert_allclose(of_degrees(found), expected, rtol=0, atol=2e-3)


def test_footprints_of_stac_are_about_the_places_below_their_cameras(tmp_path):
    results, points = flown(SWISS)
    write(delivered(results, points, "stac"), "stac", tmp_path)
    ring = np.array(json.loads((tmp_path / "item_1.json").read_text())["geometry"]["coordinates"][0])
    middle = np.column_stack([ring[:4].mean(axis=0)[None], [GROUND + 50.0]])
    below = on_earth(results.images.map_pose.centre[:1] * [1.0, 1.0, 0.0] + [0.0, 0.0, GROUND])
    # The principal point and the distortion move it by metres, the datum by 180.
    assert np.linalg.norm(of_degrees(middle) - below) < 10.0


def test_polynomials_are_of_wgs_84():
    results, points = flown(SWISS)
    handed = delivered(results, points, "rpc").handed
    images = results.images
    ahead = images.ground(np.zeros((4, 1, 2)), np.full((4, 1), GROUND))[:, 0]
    to_degrees = pyproj.Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True)
    longitude, latitude, height = to_degrees.transform(*on_earth(ahead).T)
    for k, one in enumerate(handed.polynomials):
        frame = results.cameras[images.camera[k]].frame
        row, column = one.project(np.array([[latitude[k], longitude[k], height[k]]]))[0]
        x0, y0 = np.array(frame.principal_point) / frame.pixel_size
        expected = [0.5 * (frame.columns - 1) + x0, 0.5 * (frame.rows - 1) - y0]
        # The stated misfit is 0.1 px with this distortion; the datum moved it by 1,800.
        np.testing.assert_allclose([column, row], expected, rtol=0, atol=0.05)


@pytest.mark.parametrize("name", ["geojson", "kmz", "rpc"])
def test_the_statement_says_that_coordinates_are_of_wgs_84(name):
    delivery = delivered(*flown(SWISS), name)
    text = " ".join(statement(delivery, REGISTER[name]).split())
    assert "Coordinates: latitude, longitude of WGS 84, ellipsoidal height, from" in text
    assert "CH1903+ / LV95), ellipsoidal heights, metres" not in text


@pytest.mark.parametrize("name", [*FILES, "geojson", "rpc"])
def test_a_datum_without_a_way_to_wgs_84_is_refused(name, tmp_path):
    """PROJ needs a grid for OSGB36, which it does not come with."""
    results, points = flown(Flight(longitude_deg=-2.0, crs="EPSG:27700"))
    with pytest.raises(InputError, match="OSGB36 to WGS 84"):
        write(delivered(results, points, name), name, tmp_path)


@pytest.mark.parametrize("version", [None, "WKT1_GDAL", "WKT2_2019"])
def test_a_block_in_a_crs_with_heights_is_declared_in_its_horizontal_part(version, tmp_path):
    """A project file has no other CRS; that the heights are above the sea is a remark of the import."""
    name = "EPSG:25832+7837"
    text = name if version is None else pyproj.CRS(name).to_wkt(version)
    file = tmp_path / "block.xml"
    file.write_text(BLOCKS.format(srs=text, axes="XRightYUp", rotation=ANGLES))
    block = recognised(file)
    assert block is not None
    found = tomllib.loads(project_text(block, "block", 5.0))
    declared = [found["project"], found["inputs"]["exposures"], found["inputs"]["control"]]
    assert [one["crs"] for one in declared] == ["EPSG:25832"] * 3
