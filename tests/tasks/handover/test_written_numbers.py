"""Single numbers of written files against closed forms: their unit, sign, order and axis."""

from __future__ import annotations

import csv
import json
import re
import sqlite3
import zipfile
from contextlib import closing, nullcontext
from dataclasses import replace
from io import BytesIO, StringIO

import numpy as np
import pandas as pd
import pytest

from adjust.residual_grid.format_cells import FormatCells
from tasks.handover.block_points import block_points
from tasks.handover.delivery import Angles
from tasks.handover.distortion_grid import DistortionGrid, _with_misfit
from tasks.handover.export import DeliveryRefusedError, Wanted, write_block
from tasks.handover.footprint import footprints
from tasks.handover.formats.camera_axes import camera_from_world
from tasks.handover.formats.geopackage import _vectors
from tasks.handover.formats.register import REGISTER
from tasks.handover.formats.rigs import written_rigs
from tasks.handover.formats.rpc import rpc_text
from tasks.handover.receiver import hand_over
from tasks.handover.results import _mean_residuals
from tests.tasks.handover.flown_block import Flight, delivered, flown


def files_of(name, case=None, **changed):
    results, points = flown(case or Flight())
    return REGISTER[name].write(replace(delivered(results, points, name), **changed))


def rows_of(text):
    return list(csv.DictReader(StringIO(text)))


def test_mean_residuals_of_a_table_are_those_of_their_cells_in_micrometres():
    cells = FormatCells.of((0.04, 0.03), 4)
    row, column = np.divmod(np.arange(16), 4)
    value = np.column_stack([np.arange(16.0), -2.0 * np.arange(16.0)])
    table = pd.DataFrame(
        {
            "camera": "A", "row": row, "column": column,
            "x_mm": 1e3 * cells.middles[:, 0], "y_mm": 1e3 * cells.middles[:, 1],
            "width_mm": 20.0, "height_mm": 15.0, "tile_x": 0, "tile_y": 0,
            "correction_x_um": value[:, 0], "correction_y_um": value[:, 1],
        }
    ).sample(frac=1.0, random_state=2)  # fmt: skip
    found = _mean_residuals("A", pd.concat([table, table.assign(camera="B", correction_x_um=99.0)]))
    at = np.array([[-0.03, -0.0225], [0.03, -0.0225], [-0.03, 0.0225]])
    expected = 1e-6 * value[[0, 3, 12]]
    np.testing.assert_allclose(found.cells.interpolate(found.value, at, "cell"), expected, atol=1e-15)


def test_image_points_of_a_table_have_their_coordinates_and_sigmas_in_millimetres():
    results, _ = flown(Flight())
    objects = pd.DataFrame({"point": ["P"], "x_m": [5e5], "y_m": [5e6], "z_m": [400.0]})
    measured = pd.DataFrame(
        {"image": ["4", "1 a.tif"], "point": ["P", "P"], "x_mm": [-7.0, 3.0], "y_mm": [8.0, -4.0],
         "sigma_x_mm": [0.003, 0.001], "sigma_y_mm": [0.004, 0.002]}
    )  # fmt: skip
    surveyed = ["point", "role", "x_m", "y_m", "z_m", "sigma_x_m", "sigma_y_m", "sigma_z_m"]
    found = block_points(results, objects, measured, pd.DataFrame(columns=surveyed))
    assert [results.images.names[k] for k in found.image] == ["1 a.tif", "4"]
    np.testing.assert_allclose(found.xy, [[3e-3, -4e-3], [-7e-3, 8e-3]])
    np.testing.assert_allclose(found.sigma_xy, [[1e-6, 2e-6], [3e-6, 4e-6]])


@pytest.mark.parametrize(("unit", "factor"), [("deg", 1.0), ("gon", 10 / 9), ("rad", np.pi / 180.0)])
def test_sigmas_of_angles_have_the_unit_of_the_angles(unit, factor):
    results, _ = flown(Flight())
    sigma = results.orientations["sigma_kappa_deg"].to_numpy()
    rows = rows_of(files_of("eo-csv", angles=Angles("omega-phi-kappa", unit))["eo.csv"])
    found = [float(row[f"sigma_kappa_{unit}"]) for row in rows]
    np.testing.assert_allclose(found, factor * sigma, atol=1e-7)


def test_covariances_of_angles_are_written_in_the_system_of_the_adjustment_only():
    results, points = flown(Flight())
    known = {f"correlation_{one}": 0.25 for one in ("x_y", "x_z", "y_z", "x_omega", "phi_kappa")}
    block = replace(results, orientations=results.orientations.assign(**known))
    delivery = replace(delivered(results, points, "eo-csv"), results=block)
    heads = {}
    for order in ("omega-phi-kappa", "phi-omega-kappa"):
        text = REGISTER["eo-csv"].write(replace(delivery, angles=Angles(order, "deg")))["eo.csv"]
        heads[order] = set(rows_of(text)[0])
    angles = {f"sigma_{angle}_deg" for angle in ("omega", "phi", "kappa")}
    of_angles = {*angles, "correlation_x_omega", "correlation_phi_kappa"}
    assert heads["omega-phi-kappa"] - heads["phi-omega-kappa"] == of_angles
    assert {"correlation_x_y", "sigma_x_m"} <= heads["phi-omega-kappa"]


def test_lengths_of_cameras_have_the_unit_of_the_format():
    results, points = flown(Flight())
    frame = results.cameras[0].frame
    x0, y0 = frame.principal_point
    item = json.loads(files_of("stac")["item_1.json"])["properties"]["pers:interior_orientation"]
    np.testing.assert_allclose(item["pixel_spacing"], [frame.pixel_size * 1e3] * 2)
    np.testing.assert_allclose(item["principal_point_offset"], [x0 * 1e3, y0 * 1e3])
    lines = files_of("sure")["1 a.ori"].splitlines()
    after = next(k for k, line in enumerate(lines) if line.startswith("$IntOri_PixelSize"))
    np.testing.assert_allclose([float(one) for one in lines[after + 1].split()], [frame.pixel_size * 1e3] * 2)
    sensors = json.loads(files_of("opf")["input-cameras.json"])["sensors"]
    assert sensors[0]["pixel_size_um"] == pytest.approx(frame.pixel_size * 1e6)
    rows = rows_of(files_of("corrected-csv")["image_points.csv"])
    np.testing.assert_allclose(float(rows[0]["sx"]), 1e3 * points.sigma_xy[0, 0])


def test_the_affine_transformation_leads_from_pixels_to_the_film():
    frame = flown(Flight())[0].cameras[0].frame
    row = list(csv.reader(StringIO(files_of("esri")["cameras.csv"])))[1]
    a0, a1, a2, b0, b1, b2 = (float(one) for one in row[4:10])
    for column, line in ((0, 0), (frame.columns - 1, 0), (100, 7)):
        # The centre of the first pixel is 0, 0.
        x, y = (np.array([column + 0.5, line + 0.5]) - 0.5 * np.array([frame.columns, frame.rows])) * [1, -1]
        found = [a0 + a1 * column + a2 * line, b0 + b1 * column + b2 * line]
        np.testing.assert_allclose(found, np.array([x, y]) * frame.pixel_size * 1e6, atol=0.01)
    assert row[10:12] == [str(frame.rows), str(frame.columns)]


def test_rational_polynomials_are_named_by_their_axes_and_state_their_misfit():
    results, _ = flown(Flight())
    handed, frame = hand_over(results, "rpc", REGISTER["rpc"].freed), results.cameras[0].frame
    found = dict(line.split(": ") for line in rpc_text(handed.polynomials[0], 0.0625).splitlines())
    assert float(found["ERR_RAND"]) == 0.0625
    assert float(found["LINE_OFF"]) == pytest.approx(0.5 * frame.rows, rel=0.01)
    assert float(found["SAMP_OFF"]) == pytest.approx(0.5 * frame.columns, rel=0.01)
    # 1000 m above the ground, on which a pixel has 5 cm.
    pixel_m = frame.pixel_size / frame.focal_length * 1000.0
    np.testing.assert_allclose(handed.misfit_m[::2], handed.misfit_px[::2] * pixel_m, rtol=1e-3)


def test_rational_polynomials_of_a_block_on_the_antimeridian_are_those_of_any_other():
    results, _ = flown(Flight(longitude_deg=180.0, crs="EPSG:32660"))
    handed = hand_over(results, "rpc", REGISTER["rpc"].freed)
    assert handed.misfit_px.max() < 0.5
    for one in handed.polynomials:
        found = dict(line.split(": ") for line in rpc_text(one, 0.0).splitlines())
        assert 179.9 < abs(float(found["LONG_OFF"])) <= 180.0
        assert float(found["LONG_SCALE"]) < 0.1


def test_footprints_on_the_antimeridian_are_cut_there():
    """RFC 7946, 3.1.9: both parts within ±180°, and together as large as the whole; KML counts on."""
    across = Flight(longitude_deg=180.0, crs="EPSG:32660")
    results, points = flown(across)
    features = json.loads(
        REGISTER["geojson"].write(delivered(results, points, "geojson"))["footprints.geojson"]
    )["features"]
    packed = REGISTER["kmz"].write(delivered(results, points, "kmz"))["block.kmz"]
    text = zipfile.ZipFile(BytesIO(packed)).read("doc.kml").decode()
    whole = [
        np.array([corner.split(",") for corner in ring.split()], dtype=float)
        for ring in re.findall(r"<LinearRing><coordinates>([^<]+)<", text)
    ]
    assert len(whole) == len(features) > 0
    cut = 0
    for feature, ring in zip(features, whole, strict=True):
        assert np.ptp(ring[:, 0]) < 0.1
        kind, coordinates = feature["geometry"]["type"], feature["geometry"]["coordinates"]
        rings = [np.array(one) for (one,) in (coordinates if kind == "MultiPolygon" else [coordinates])]
        cut += kind == "MultiPolygon"
        for one in rings:
            assert np.abs(one[:, 0]).max() <= 180.0
            assert np.ptp(one[:, 0]) < 0.1
            assert (one[0] == one[-1]).all()
            assert area(one) > 0.0
        assert sum(area(one) for one in rings) == pytest.approx(area(ring), rel=1e-4)
    assert cut > 0


def test_the_box_of_an_item_on_the_antimeridian_begins_in_the_west():
    """RFC 7946, 5.2."""
    files = files_of("stac", Flight(longitude_deg=180.0, crs="EPSG:32660"))
    crossing = [
        item for name, text in files.items() if (item := json.loads(text)).get("geometry")
        and item["geometry"]["type"] == "MultiPolygon"
    ]  # fmt: skip
    assert crossing
    for item in crossing:
        west, south, east, north = item["bbox"]
        assert 179.9 < west <= 180.0
        assert -180.0 <= east < -179.9
        assert south < north
    west, _, east, _ = json.loads(files["collection.json"])["extent"]["spatial"]["bbox"][0]
    assert east < 0.0 < west


def area(ring: np.ndarray) -> float:
    """Of a closed ring in longitude and latitude, square degrees; positive if counter-clockwise."""
    x, y = ring[:, 0] - ring[0, 0], ring[:, 1] - ring[0, 1]
    return float(0.5 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))


def test_the_misfit_on_the_ground_is_that_in_the_image_seen_from_the_height():
    """Of vertical images: in any direction in plan."""
    results, _ = flown(Flight(above=4000.0))
    handed = hand_over(results, "map-cartesian", REGISTER["bingo"].freed)
    images = results.images
    pixel_m = images.pixel_size[images.camera] / images.focal_length[images.camera] * 4000.0
    np.testing.assert_allclose(handed.misfit_m, handed.misfit_px * pixel_m, rtol=0.1)


def test_a_delivery_that_is_wrong_by_a_pixel_is_refused(tmp_path):
    """By 1.6 pixels from 4000 m, by 0.4 from 1000 m."""
    for above, refused in ((4000.0, True), (1000.0, False)):
        results, points = flown(Flight(above=above))
        wanted = Wanted(REGISTER["patb"], "map-cartesian", Angles())
        with pytest.raises(DeliveryRefusedError, match=r"1\.6 pixels") if refused else nullcontext():
            write_block(results, lambda known=points: known, wanted, tmp_path / str(above))
        assert (tmp_path / str(above)).exists() is not refused


def test_places_are_longitude_and_latitude():
    features = json.loads(files_of("orthority")["exterior.geojson"])["features"]
    np.testing.assert_allclose(features[0]["geometry"]["coordinates"][:2], [9.3, 48.0], atol=0.01)


def test_the_rig_of_an_event_stands_where_its_reference_head_does():
    results, points = flown(Flight(rig=True))
    delivery = delivered(results, points, "colmap")
    rigs, (rotation, translation) = written_rigs(delivery), camera_from_world(delivery)
    for image in range(len(delivery.names)):
        reference = image - image % 2
        np.testing.assert_allclose(rigs.rig_turn[image], rotation[reference], atol=1e-12)
        np.testing.assert_allclose(rigs.rig_shift[image], translation[reference], atol=1e-6)


def test_tie_points_of_opf_are_turned_to_y_up_and_back_by_their_matrix():
    results, points = flown(Flight())
    delivery, files = delivered(results, points, "opf"), files_of("opf")
    ties = delivery.points.local[~delivery.points.is_surveyed]
    matrix = np.array(json.loads(files["tie-points.gltf"])["nodes"][0]["matrix"]).reshape(4, 4).T
    y_up = np.frombuffer(files["positions.bin"], "<f4").reshape(-1, 3).astype(np.float64)
    np.testing.assert_allclose(y_up @ matrix[:3, :3].T + matrix[:3, 3], ties, atol=1e-3)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1.0)
    # Up is the second axis.
    assert np.ptp(y_up[:, 1]) < 0.2 * np.ptp(y_up[:, 0])


def test_vectors_have_the_length_of_their_difference_in_plan():
    with closing(sqlite3.connect(":memory:")) as connection:
        connection.deserialize(next(iter(files_of("geopackage").values())))
        lengths = [
            plan
            for (table,) in connection.execute("SELECT table_name FROM gpkg_contents").fetchall()
            if "plan_m" in {row[1] for row in connection.execute(f'PRAGMA table_info("{table}")')}
            for (plan,) in connection.execute(f'SELECT plan_m FROM "{table}"')
        ]
    np.testing.assert_allclose(lengths, np.hypot(0.02, 0.01), rtol=1e-6)


def test_vectors_begin_at_the_surveyed_point_and_are_a_small_part_of_the_block():
    """A coordinate that was not surveyed is the adjusted one, and the vector has no part along it."""
    results, points = flown(Flight())
    delivery = delivered(results, points, "geopackage")
    surveyed, layer = points.surveyed, _vectors(delivery)
    begin, end = np.stack(layer.vertices).swapaxes(0, 1)
    expected = surveyed.in_map.copy()
    expected[2, 2] = points.in_map[points.names.index(surveyed.names[2]), 2]
    np.testing.assert_allclose(begin, expected)
    enlarged = layer.rows[0][-1]
    np.testing.assert_allclose(end - begin, enlarged * np.nan_to_num(surveyed.difference), atol=1e-6)
    extent = np.linalg.norm(np.ptp(delivery.handed.pose.centre[:, :2], axis=0))
    assert 0.02 * extent < enlarged * np.hypot(0.02, 0.01) <= 0.05 * extent


def test_images_have_a_footprint_until_a_ray_goes_down_by_a_tenth_of_its_length():
    """The upper border of this camera looks 9.2° past its axis; the limit is at 84.3° from the vertical."""
    for tilt, has in ((60.0, True), (73.0, True), (76.0, False)):
        _, below = footprints(flown(Flight(tilt_deg=tilt))[0])
        assert below.all() if has else not below.any(), tilt


def test_the_misfit_of_a_grid_is_its_largest_difference_and_their_root_mean_square():
    x = np.linspace(-0.02, 0.02, 3)
    grid = DistortionGrid(x, x, np.stack(np.meshgrid(x, x), axis=-1))
    at = np.array([[0.001, 0.013], [-0.007, 0.002]])
    found = _with_misfit(grid, at, np.add(at, [[1e-6, 0.0], [0.0, -7e-6]]))
    assert found.misfit == pytest.approx(7e-6)
    assert found.rms == pytest.approx(5e-6)
