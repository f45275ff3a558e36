"""RealityScan, Orthority, GeoJSON, KMZ: what is written leads to the pixel, or the place on the earth."""

from __future__ import annotations

import csv
import io
import json
import re
import xml.etree.ElementTree as ElementTree
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from adjust.geometry.earth import CartesianFrame
from adjust.geometry.rotation import from_omega_phi_kappa
from tasks.coordinates.crs import MapFrame
from tasks.errors import InputError
from tasks.formats.realityscan import read_realityscan_exposures
from tasks.formats.records import PixelCamera
from tasks.handover.block_points import no_points
from tasks.handover.delivery import Delivery
from tasks.handover.export import lenses_of
from tasks.handover.formats.register import REGISTER
from tasks.handover.receiver import hand_over
from tasks.settings.coordinates import Heights
from tests.tasks.coordinates import test_geoid_grid
from tests.tasks.handover.flown_block import GROUND, LOCAL, NAMES, Flight, delivered, flown
from tests.tasks.handover.test_ground_through_files import pixels, seen

CASES = [Flight(), Flight(4000.0, 45.0, refracted=True)]
XCR = "{http://www.capturingreality.com/ns/xcr/1.1#}"


@pytest.mark.parametrize("world", ["map", "local"])
def test_realityscan_reads_angles_about_true_north_and_matrices_about_grid_north(world, tmp_path):
    results, points = flown(Flight(2000.0, 45.0, longitude_deg=11.5))
    form = REGISTER["realityscan"]
    handed = hand_over(results, world, form.freed)
    files = form.write(Delivery(results, handed, lenses=lenses_of(results, handed, form.lens)))
    path = tmp_path / "realityscan.csv"
    path.write_text(files["realityscan.csv"])
    records = read_realityscan_exposures(path, "omega-phi-kappa")
    images = results.images
    np.testing.assert_allclose(records.position, handed.pose.centre, atol=6e-5)
    enu = np.asarray(images.frame.local_from_enu(images.projection_centre))
    expected = (
        images.local_from_camera if world == "local" else np.swapaxes(enu, 1, 2) @ images.local_from_camera
    )
    np.testing.assert_allclose(from_omega_phi_kappa(np.radians(records.angles)), expected, atol=3e-9)
    row = next(csv.DictReader(io.StringIO(files["realityscan.csv"])))
    for k, name in enumerate(NAMES):
        stem = {"1 a.tif": "1 a", "0002.tif": "0002"}.get(name, name)
        text = ElementTree.fromstring(files[f"{stem}.xmp"])
        found = next(iter(text.iter("{http://www.w3.org/1999/02/22-rdf-syntax-ns#}Description")))
        turn = np.array(found.findtext(f"{XCR}Rotation").split(), dtype=float).reshape(3, 3)
        np.testing.assert_allclose(turn.T @ np.diag([1, -1, -1]), handed.pose.map_from_camera[k], atol=1e-12)
        lens = [float(value) for value in found.findtext(f"{XCR}DistortionCoeficients").split()]
        camera = in_pixels(results, k, float(found.get(f"{XCR}FocalLength35mm")), lens, found)
        if world == "local":
            place = np.array(found.findtext(f"{XCR}Position").split(), dtype=float)
            ground = points.local[points.point[points.image == k]]
            away = seen(camera, place, turn.T @ np.diag([1, -1, -1]), ground) - pixels(results, points, k)
            # Positions have 0.1 mm.
            assert np.abs(away).max() < 3e-3
    assert float(row["t1"]) == pytest.approx(0.0, abs=1e-12)
    assert float(row["t2"]) == pytest.approx(2e-4)


def in_pixels(results, k, f35, lens, found):
    frame = results.cameras[results.images.camera[k]].frame
    longer = max(frame.columns, frame.rows)
    k1, k2, k3, k4, t1, t2 = lens
    assert k4 == 0.0
    u, v = (float(found.get(f"{XCR}PrincipalPoint{axis}")) for axis in "UV")
    values = {"k1": k1, "k2": k2, "k3": k3, "p1": t2, "p2": t1}
    return PixelCamera(
        frame.columns, frame.rows, f35 / 36.0 * longer, (u * longer, -v * longer),
        {f"brown-forward:{name}": value for name, value in values.items()},
    )  # fmt: skip


@pytest.mark.parametrize("longitude", [9.0, 12.0])
@pytest.mark.parametrize("above", [1000.0, 2000.0, 4000.0])
def test_orthority_sees_the_ground_to_the_stated_misfit(above, longitude):
    results, points = flown(Flight(above, refracted=True, longitude_deg=longitude))
    delivery = delivered(results, points, "orthority")
    files = REGISTER["orthority"].write(delivery)
    cameras = interior(files["interior.yaml"])
    exterior = json.loads(files["exterior.geojson"])
    assert exterior["world_crs"] == "EPSG:25832"
    for k, feature in enumerate(exterior["features"]):
        known = feature["properties"]
        assert known["filename"] == NAMES[k]
        camera = cameras[known["camera"]]
        ground = points.in_map[points.point[points.image == k]]
        turn = from_omega_phi_kappa(np.array(known["opk"]))
        away = seen(camera, np.array(known["xyz"]), turn, ground) - pixels(results, points, k)
        # In the corner distortion enlarges what the fit leaves.
        assert np.abs(away).max() < 1.2 * delivery.misfit_px[k] + 2e-3
        assert delivery.misfit_px[k] < 0.25


def interior(text):
    """Cameras of the YAML, as orthority has them: x right, y down, parts of the longer side."""
    found, name = {}, ""
    for line in text.splitlines():
        if line and not line.startswith(" "):
            name = json.loads(line[:-1])
            found[name] = {}
        elif line:
            key, _, value = line.strip().partition(": ")
            found[name][key] = value if key == "type" else json.loads(value)
    cameras = {}
    for name, one in found.items():
        columns, rows = one["im_size"]
        longer = max(columns, rows)
        c = one["focal_len"] / (max(one["sensor_size"]) / longer)
        lens = {f"brown-forward:{key}": one[key] for key in ("k1", "k2", "k3", "p1", "p2")}
        assert one["type"] == "brown"
        cameras[name] = PixelCamera(columns, rows, c, (one["cx"] * longer, -one["cy"] * longer), lens)
    return cameras


@pytest.mark.parametrize("case", CASES)
def test_geojson_and_kmz_hold_the_block_on_the_earth(case):
    results, points = flown(case)
    files = REGISTER["geojson"].write(delivered(results, points, "geojson"))
    layers = {name: json.loads(text)["features"] for name, text in files.items()}
    assert {name: len(found) for name, found in layers.items()} == {
        "cameras.geojson": 4, "footprints.geojson": 4, "surveyed_points.geojson": 2,
    }  # fmt: skip
    place = results.images.map_frame
    for k, feature in enumerate(layers["cameras.geojson"]):
        x, y, z = feature["geometry"]["coordinates"]
        back = place.from_geodetic(np.array([[np.radians(y), np.radians(x), z]]))
        np.testing.assert_allclose(back, results.images.map_pose.centre[k : k + 1], atol=2e-4)
        assert feature["properties"]["name"] == NAMES[k]
    ring = np.array(layers["footprints.geojson"][0]["geometry"]["coordinates"][0])
    assert ring[0].tolist() == ring[-1].tolist()
    assert (ring[:, 2] == pytest.approx(GROUND)) or np.ptp(ring[:, 2]) < 1e-3
    # Outer rings run counter-clockwise.
    x, y = ring[:, :2].T
    assert np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) > 0.0
    (packed,) = REGISTER["kmz"].write(delivered(results, points, "kmz")).values()
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        text = ElementTree.fromstring(archive.read("doc.kml"))
    kml = "{http://www.opengis.net/kml/2.2}"
    names = [mark.findtext(f"{kml}name") for mark in text.iter(f"{kml}Placemark")]
    assert names == [*NAMES, *NAMES, "P 3", "P80"]
    given = text.findtext(f".//{kml}Point/{kml}coordinates").split(",")
    first = layers["cameras.geojson"][0]["geometry"]["coordinates"]
    np.testing.assert_allclose([float(value) for value in given], first, atol=1e-3)


def test_kmz_has_heights_above_the_sea_where_the_project_has_a_geoid(monkeypatch, tmp_path):
    """KML counts absolute heights from the sea, GeoJSON heights from the ellipsoid."""
    monkeypatch.setattr(test_geoid_grid, "WEST", 9.0)
    monkeypatch.setattr(test_geoid_grid, "NORTH", 48.5)
    side = test_geoid_grid.SIDE
    geoid = test_geoid_grid.geotiff(tmp_path / "geoid.tif", np.full((side, side), 45.0, np.float32))
    results, _ = flown(Flight())
    place = MapFrame.of("EPSG:25832", Heights(geoid=geoid))
    results = replace(results, images=replace(results.images, map_frame=place))
    (packed,) = REGISTER["kmz"].write(delivered(results, no_points(), "kmz")).values()
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        text = archive.read("doc.kml").decode()
    first = re.findall(r"<coordinates>([^<]+)</coordinates>", text)[: len(NAMES)]
    above_sea = results.images.map_pose.centre[:, 2]
    np.testing.assert_allclose([float(one.split(",")[2]) for one in first], above_sea, atol=6e-4)
    files = REGISTER["geojson"].write(delivered(results, no_points(), "geojson"))
    features = json.loads(files["cameras.geojson"])["features"]
    found = [one["geometry"]["coordinates"][2] for one in features]
    np.testing.assert_allclose(found, above_sea + 45.0, atol=1e-4)


@pytest.mark.parametrize("name", ["geojson", "kmz", "orthority"])
def test_formats_on_the_earth_refuse_a_local_block(name):
    results, points = flown(Flight())
    local = replace(results, images=replace(results.images, map_frame=LOCAL, frame=CartesianFrame()))
    with pytest.raises(InputError, match="is local"):
        REGISTER[name].write(delivered(local, points, name))
