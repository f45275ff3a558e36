"""What a written file, read again, projects: rigorous ground points fall on their measured pixels.

The world of these formats is Cartesian, and they take distortion. Heights 1, 2 and 4 km, vertical and 45°
oblique.
"""

from __future__ import annotations

import json
import re
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyproj
import pytest

from adjust.geometry.earth import CartesianFrame
from adjust.geometry.rotation import from_omega_phi_kappa
from tasks.errors import InputError
from tasks.formats.records import CameraRecord, PixelCamera
from tasks.formats.register import CAMERA_FORMATS, CONTROL_FORMATS, EXPOSURE_FORMATS, IMAGE_POINT_FORMATS
from tasks.handover.block_points import no_points
from tasks.handover.formats.register import REGISTER
from tasks.handover.formats.short_names import without_blanks
from tasks.handover.lens import lens_models
from tasks.handover.statement import statement
from tests.grids import diagonal_daily, pairs_daily
from tests.tasks.handover.flown_block import GROUND, LOCAL, NAMES, Flight, delivered, flown

ORDER = "omega-phi-kappa"
#: Format → files with orientations, cameras, image points; name of a reader of each.
FILES = {
    "colmap": (("images.txt", "cameras.txt", "images.txt"), "colmap"),
    "opensfm": (("reconstruction.json", "reconstruction.json", "tracks.csv"), "opensfm"),
    "blocks-exchange": (("block.xml", "block.xml", "block.xml"), "blocks-exchange"),
    "openmvg": (("sfm_data.json", "sfm_data.json", "sfm_data.json"), "openmvg"),
    "metashape-xml": (("metashape_cameras.xml", "metashape_cameras.xml", ""), "metashape"),
}
heights_and_tilts = pytest.mark.parametrize(
    ("above", "tilt"), diagonal_daily((1000.0, 2000.0, 4000.0), (0.0, 45.0))
)
flights = pytest.mark.parametrize(
    ("name", "tilt", "above"), pairs_daily(tuple(FILES), (0.0, 45.0), (1000.0, 2000.0, 4000.0))
)


def write(delivery, name, folder):
    for file, content in REGISTER[name].write(delivery).items():
        (folder / file).write_bytes(content if isinstance(content, bytes) else content.encode())


def poses(results, records):
    """Positions and rotations in the local frame, of records that may be geographic."""
    turn = from_omega_phi_kappa(np.radians(records.angles))
    frame = results.images.frame
    if records.states.crs == "local":
        return records.position, turn
    geodetic = np.column_stack([np.radians(records.position[:, 1::-1]), records.position[:, 2]])
    local = frame.from_geodetic(geodetic)
    return local, np.asarray(frame.local_from_enu(local)) @ turn


def seen(camera: PixelCamera, centre, turn, ground):
    """Pixels (n, 2) from the corner of the first one, of local points, as the format's own formula has it."""
    x, y, z = np.einsum("ji,nj->ni", turn, ground - centre).T
    u, v = x / -z, y / z
    known = {name.split(":")[1]: value for name, value in camera.additional_parameters.items()}
    k1, k2, k3, p1, p2, b1 = (known.get(name, 0.0) for name in ("k1", "k2", "k3", "p1", "p2", "b1"))
    square = u * u + v * v
    radial = 1 + k1 * square + k2 * square**2 + k3 * square**3
    u, v = (
        u * radial + 2 * p1 * u * v + p2 * (square + 2 * u * u),
        v * radial + p1 * (square + 2 * v * v) + 2 * p2 * u * v,
    )
    c, (x0, y0) = camera.focal_length_px, camera.principal_point_px
    return np.column_stack(
        [0.5 * camera.columns + x0 + c * (1 + b1) * u, 0.5 * camera.rows - y0 + c * v]
    )  # fmt: skip


def in_pixels(camera: CameraRecord | PixelCamera) -> PixelCamera:
    """A camera whose file knows how large its pixels are, as the others."""
    if isinstance(camera, PixelCamera):
        return camera
    pixel_mm, (x0, y0) = 1e-3 * camera.pixel_um, camera.principal_point_mm
    return PixelCamera(
        camera.columns, camera.rows, camera.focal_length_mm / pixel_mm, (x0 / pixel_mm, y0 / pixel_mm),
        camera.additional_parameters,
    )  # fmt: skip


def pixels(results, points, k):
    frame = results.cameras[results.images.camera[k]].frame
    xy = points.xy[points.image == k]
    return (xy * [1.0, -1.0] + frame.half_format) / frame.pixel_size


def largest_miss(results, points, name, folder):
    """Pixels, over all image points."""
    files, reader = FILES[name]
    records = EXPOSURE_FORMATS[reader](folder / files[0], ORDER)
    cameras = [in_pixels(one) for one in CAMERA_FORMATS[reader](folder / files[1]).values()]
    centre, turn = poses(results, records)
    listed = records.image.to_pylist()
    away = []
    for k, name_of_image in enumerate(without_blanks(NAMES) if name == "colmap" else NAMES):
        row, camera = listed.index(name_of_image), cameras[results.images.camera[k]]
        ground = points.local[points.point[points.image == k]]
        away.append(np.abs(seen(camera, centre[row], turn[row], ground) - pixels(results, points, k)).max())
    return max(away)


@flights
def test_a_cartesian_receiver_sees_the_ground_to_a_millimetre(name, tilt, above, tmp_path):
    results, points = flown(Flight(above, tilt))
    delivery = delivered(results, points, name)
    write(delivery, name, tmp_path)
    metres_per_pixel = above / np.cos(np.radians(tilt)) * 4e-6 / 0.0798
    miss = largest_miss(results, points, name, tmp_path)
    assert miss * metres_per_pixel < 1e-3
    assert delivery.lenses.misfit_px.max() < 1e-6


@flights
def test_refraction_and_corrections_are_in_the_camera_to_the_stated_misfit(name, tilt, above, tmp_path):
    results, points = flown(Flight(above, tilt, refracted=True, corrections=True))
    delivery = delivered(results, points, name)
    write(delivery, name, tmp_path)
    miss = largest_miss(results, points, name, tmp_path)
    misfit = delivery.lenses.misfit_px.max()
    assert miss < 1.05 * misfit + 2e-3
    assert misfit < 0.3


def test_a_distortion_that_copies_no_coefficient_is_the_same_to_a_tenth_of_a_micrometre():
    results, _ = flown(Flight(corrections=True))
    assert results.cameras[0].largest_distortion > 40e-6
    lenses = lens_models(results, ("k1", "k2", "k3", "p1", "p2"))
    assert lenses.misfit_px.max() * 4.0 < 0.1


@pytest.mark.parametrize("name", [name for name, (files, _) in FILES.items() if files[2]])
def test_image_points_are_read_as_they_were_measured(name, tmp_path):
    results, points = flown(Flight())
    write(delivered(results, points, name), name, tmp_path)
    files, reader = FILES[name]
    records = IMAGE_POINT_FORMATS[reader](tmp_path / files[2])
    found = {
        "colmap": lambda xy: xy,
        "blocks-exchange": lambda xy: xy + 0.5,
        "openmvg": lambda xy: xy,
        "opensfm": lambda xy: xy * [1.0, -1.0] * 26460 + [0.5 * 17004, 0.5 * 26460],
    }[name]
    images = np.array(records.image.to_pylist())
    for k, image in enumerate(without_blanks(NAMES) if name == "colmap" else NAMES):
        ours = pixels(results, points, k)
        theirs = found(records.xy[images == image])
        # Control points come first in some formats.
        nearest = np.linalg.norm(ours[:, None] - theirs[None], axis=2).min(axis=1)
        assert len(theirs) == len(ours) == 75
        assert nearest.max() < 1e-4


def test_names_that_a_format_cuts_are_listed(tmp_path):
    results, points = flown(Flight())
    write(delivered(results, points, "colmap"), "colmap", tmp_path)
    assert (tmp_path / "images.csv").read_text() == (
        "image_there,image\n1_a.tif,1 a.tif\n0002.tif,0002.tif\nIII_3,III_3\n4,4\n"
    )
    rows = (tmp_path / "points.csv").read_text().splitlines()
    assert rows[4] == "4,P 3,control"
    assert rows[81] == "81,P80,check"
    assert without_blanks(["a b", "a_b", "a  b"]) == ["a_b_2", "a_b", "a__b"]


def test_control_points_of_an_exchanged_block_are_surveyed_ones(tmp_path):
    results, points = flown(Flight())
    write(delivered(results, points, "blocks-exchange"), "blocks-exchange", tmp_path)
    text = (tmp_path / "block.xml").read_text()
    assert text.count("<ControlPoint>") == 2
    assert text.count("<CheckPoint>true</CheckPoint>") == 1
    assert text.count("<TiePoint>") == 300 - 2


@pytest.mark.parametrize("local", [False, True])
def test_markers_of_metashape_are_surveyed_points_with_their_measurements(local, tmp_path):
    results, points = flown(Flight())
    if local:
        images = replace(results.images, map_frame=LOCAL, frame=CartesianFrame())
        results = replace(results, images=images)
    write(delivered(results, points, "metashape-xml"), "metashape-xml", tmp_path)
    file = tmp_path / "metashape_markers.xml"
    control = CONTROL_FORMATS["metashape-markers"](file)
    assert control.point.to_pylist() == ["P 3", "P80"]
    assert control.role.to_pylist() == ["control", "check"]
    where = control.position
    if not local:
        frame = results.images.frame
        where = frame.from_geodetic(np.column_stack([np.radians(where[:, 1::-1]), where[:, 2]]))
    np.testing.assert_allclose(where, points.surveyed.local[:2], atol=1e-7)
    marks = IMAGE_POINT_FORMATS["metashape-markers"](file)
    # A point without a surveyed height is measured all the same.
    assert marks.point.to_pylist() == ["P 3", "P80", "P160"]
    assert marks.image.to_pylist() == [NAMES[0], NAMES[1], NAMES[2]]
    for xy, point in zip(marks.xy, (3, 80, 160), strict=True):
        ray = int(np.flatnonzero(points.point == point)[0])
        image = int(points.image[ray])
        ours = pixels(results, points, image)[ray - np.searchsorted(points.image, image)]
        np.testing.assert_allclose(xy, ours, atol=0.6e-4)


def test_nerfstudio_matrices_are_ours_about_the_middle():
    results, points = flown(Flight(2000.0, 45.0))
    delivery = delivered(results, no_points(), "nerfstudio")
    found = json.loads(REGISTER["nerfstudio"].write(delivery)["transforms.json"])
    for k, frame in enumerate(found["frames"]):
        matrix = np.array(frame["transform_matrix"])
        camera = PixelCamera(
            frame["w"], frame["h"], frame["fl_y"],
            (frame["cx"] - 0.5 * frame["w"], 0.5 * frame["h"] - frame["cy"]),
            {f"brown-forward:{key}": frame[key] for key in ("k1", "k2", "k3", "p1", "p2")},
        )  # fmt: skip
        ground = points.local[points.point[points.image == k]]
        centre = matrix[:3, 3] + found["aerocal_offset"]
        away = seen(camera, centre, matrix[:3, :3], ground) - pixels(results, points, k)
        assert np.abs(away).max() < 1e-4
        assert np.abs(matrix[:3, 3]).max() < 2_000.0


#: As programs write them for SURE.
TITLES = """\
$ImageID___________________________________________________(ORI_Ver_1.0)
$IntOri_FocalLength_________________________________________________[mm]
$IntOri_PixelSize______(x|y)________________________________________[mm]
$IntOri_SensorSize_____(x|y)_____________________________________[pixel]
$IntOri_PrincipalPoint_(x|y)_____________________________________[pixel]
$IntOri_CameraMatrix_____________________________(ImageCoordinateSystem)
$ExtOri_RotationMatrix____________________(World->ImageCoordinateSystem)
$ExtOri_TranslationVector________________________(WorldCoordinateSystem)
$IntOri_Distortion_____(Model|ParameterCount|(Parameters))______________"""


def sections(text):
    """Lines of each section of a file of SURE by its name."""
    found = {}
    assert [line for line in text.splitlines() if line[0] == "$"] == TITLES.splitlines()
    for line in text.splitlines():
        if line[0] == "$":
            lines = found.setdefault(re.split("_{5,}|_\\(x", line)[0], [])
        else:
            lines.append(line.split())
    return found


@heights_and_tilts
def test_sure_sees_the_ground_in_undistorted_images(above, tilt):
    results, points = flown(Flight(above, tilt))
    files = REGISTER["sure"].write(delivered(results, no_points(), "sure"))
    for k, name in enumerate(NAMES):
        found = sections(files[f"{name.rpartition('.')[0] or name}.ori"])
        assert found["$ImageID"] == [name.split()]
        assert found["$IntOri_Distortion"] == [["NONE", "0"]]
        matrix, turn, centre = (
            np.array(found[key], dtype=float)
            for key in ("$IntOri_CameraMatrix", "$ExtOri_RotationMatrix", "$ExtOri_TranslationVector")
        )
        assert found["$IntOri_PrincipalPoint"] == [[row[2] for row in found["$IntOri_CameraMatrix"][:2]]]
        ground = points.local[points.point[points.image == k]]
        column, row, depth = matrix @ turn @ (ground - centre).T
        camera = results.cameras[results.images.camera[k]]
        frame = camera.frame
        ideal = camera.ideal(points.xy[points.image == k]) + frame.principal_point
        expected = (ideal * [1.0, -1.0] + frame.half_format) / frame.pixel_size - 0.5
        assert (depth > 0.0).all()
        np.testing.assert_allclose(np.column_stack([column, row]) / depth[:, None], expected, atol=1e-6)


@heights_and_tilts
def test_stac_items_hold_the_true_orientation_in_the_map(above, tilt):
    results, _ = flown(Flight(above, tilt))
    files = REGISTER["stac"].write(delivered(results, no_points(), "stac"))
    pose = results.images.map_pose
    for k in range(len(NAMES)):
        item = json.loads(files[f"item_{k + 1}.json"])
        known = item["properties"]
        np.testing.assert_allclose(known["pers:perspective_center"], pose.centre[k], atol=6e-5)
        matrix = np.array(known["pers:rotation_matrix"]).reshape(3, 3).T
        np.testing.assert_allclose(matrix, pose.map_from_camera[k], atol=1e-12)
        angles = np.radians([known[f"pers:{name}"] for name in ("omega", "phi", "kappa")])
        np.testing.assert_allclose(from_omega_phi_kappa(angles), matrix, atol=3e-9)
        assert (known["pers:crs"], known["datetime"]) == (25832, None)
        assert known["start_datetime"] == "2026-05-24T00:00:00Z"
        ring = np.array(item["geometry"]["coordinates"][0])
        assert ring[0].tolist() == ring[-1].tolist()
        assert (ring[:, 0] > 9.2).all()
        assert (ring[:, 0] < 9.5).all()
    links = [link["href"] for link in json.loads(files["collection.json"])["links"]]
    assert links == ["./collection.json", *(f"./item_{k}.json" for k in (1, 2, 3, 4))]


@heights_and_tilts
def test_layers_of_a_geopackage(above, tilt, tmp_path):
    results, points = flown(Flight(above, tilt))
    write(delivered(results, points, "geopackage"), "geopackage", tmp_path)
    with closing(sqlite3.connect(tmp_path / "block.gpkg")) as connection:
        layers = [row[0] for row in connection.execute("SELECT table_name FROM gpkg_contents ORDER BY rowid")]
        cameras = connection.execute("SELECT * FROM cameras").fetchall()
        rings = connection.execute("SELECT geom, ground_m FROM footprints").fetchall()
        (check,) = connection.execute("SELECT geom, dx_m, dy_m, dz_m FROM check_points").fetchall()
        control = connection.execute("SELECT point, geom, dz_m FROM control_points").fetchall()
        vectors = connection.execute("SELECT geom, enlarged FROM residual_vectors").fetchall()
        count = connection.execute("SELECT count(*) FROM tie_points").fetchone()
    assert layers == [
        "cameras", "footprints", "tie_points", "control_points", "check_points", "residual_vectors"
    ]  # fmt: skip
    pose = results.images.map_pose
    for k, row in enumerate(cameras):
        np.testing.assert_array_equal(np.frombuffer(row[1][13:], "<f8"), pose.centre[k])
        turn = from_omega_phi_kappa(np.radians(row[5:8]))
        np.testing.assert_allclose(turn, pose.map_from_camera[k], atol=1e-12)
    # A footprint's corner is where the first measured corner sees the ground.
    half = np.array(results.cameras[0].frame.half_format)
    corner = results.images.only(0).ground(results.cameras[0].ideal(-half[None])[None], np.array([[GROUND]]))
    np.testing.assert_allclose(np.frombuffer(rings[0][0][21:], "<f8")[:3], corner[0, 0], atol=1e-8)
    np.testing.assert_allclose(check[1:], [0.02, -0.01, 0.03], atol=1e-9)
    assert [row[0] for row in control] == ["P 3", "P160"]
    # A height that was not surveyed is the adjusted one, and moves no vector.
    assert np.frombuffer(control[1][1][13:], "<f8")[2] == points.in_map[160, 2]
    assert control[1][2] is None
    line = np.frombuffer(vectors[0][0][17:], "<f8").reshape(2, 3)
    np.testing.assert_allclose(line[1] - line[0], vectors[0][1] * np.array([0.02, -0.01, 0.03]), atol=1e-6)
    assert count == (297,)


def test_a_local_block_has_an_engineering_crs(tmp_path):
    results, _ = flown(Flight())
    local = replace(results, images=replace(results.images, map_frame=LOCAL, frame=CartesianFrame()))
    write(delivered(local, no_points(), "geopackage"), "geopackage", tmp_path)
    with closing(sqlite3.connect(tmp_path / "block.gpkg")) as connection:
        names = connection.execute("SELECT srs_id, definition_12_063 FROM gpkg_spatial_ref_sys").fetchall()
        (used,) = connection.execute("SELECT DISTINCT srs_id FROM gpkg_contents").fetchone()
    definition = dict(names)[used]
    assert definition.startswith('ENGCRS["local flown"')
    assert pyproj.CRS.from_wkt(definition).is_engineering


def test_formats_that_need_more_than_a_block_has_refuse_it():
    results, _ = flown(Flight())
    for name in ("stac", "opf"):
        with pytest.raises(InputError, match="date of the flight"):
            REGISTER[name].write(delivered(replace(results, flown=None), no_points(), name))
    level, _ = flown(Flight(1000.0, 80.0))
    with pytest.raises(InputError, match="sees the horizon"):
        REGISTER["stac"].write(delivered(level, no_points(), "stac"))


@pytest.mark.parametrize("name", [name for name, form in REGISTER.items() if form.lens])
def test_every_format_with_distortion_says_how_well_it_is_fitted(name):
    results, points = flown(Flight(corrections=True))
    delivery = delivered(results, points, name)
    assert all(0.0 < model.misfit_um < 0.1 for model in delivery.lenses.models)
    text = " ".join(statement(delivery, REGISTER[name]).split())
    assert f"fitted over the format to {delivery.lenses.models[0].misfit_um:.3f} µm" in text
    assert "more than 0.1 µm" not in text


def test_a_distortion_that_a_format_cannot_hold_is_remarked_on():
    results, points = flown(Flight(corrections=True))
    delivery = delivered(results, points, "blocks-exchange")
    without = replace(delivery, lenses=lens_models(results, ("k1",)))
    assert without.lenses.models[0].misfit_um > 0.1
    text = " ".join(statement(without, REGISTER["blocks-exchange"]).split())
    assert "more than 0.1 µm: compare corrected image points" in text


def test_the_precision_of_every_format_stands_in_the_documentation():
    page = (Path(__file__).parents[3] / "docs" / "export.md").read_text()
    for form in REGISTER.values():
        assert f"| `{form.name}` | {form.precision} |" in page
