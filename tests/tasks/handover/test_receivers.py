"""Programs' own libraries open what is written for them; a test is skipped where its library is missing."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from adjust.geometry.earth import CartesianFrame
from tasks.handover.block_points import no_points
from tasks.handover.formats.register import REGISTER
from tests.tasks.handover.flown_block import LOCAL, NAMES, Flight, delivered, flown

CASES = [Flight(), Flight(4000.0, 45.0)]
LAYERS = {
    "cameras": 4, "footprints": 4, "tie_points": 297, "control_points": 2, "check_points": 1,
    "residual_vectors": 3,
}  # fmt: skip


def write(delivery, name, folder):
    for file, content in REGISTER[name].write(delivery).items():
        (folder / file).write_bytes(content if isinstance(content, bytes) else content.encode())


@pytest.mark.parametrize("case", CASES)
def test_colmap_projects_the_points_where_they_were_measured(case, tmp_path):
    pycolmap = pytest.importorskip("pycolmap")
    results, points = flown(case)
    write(delivered(results, points, "colmap"), "colmap", tmp_path)
    found = pycolmap.Reconstruction(str(tmp_path))
    assert (len(found.images), len(found.points3D), found.num_reg_images()) == (4, 300, 4)
    stated = {number: point.error for number, point in found.points3D.items()}
    for image in found.images.values():
        for measured in image.points2D:
            seen = image.project_point(found.points3D[measured.point3D_id].xyz)
            # Image points have four decimals, points six decimals of a metre.
            assert np.abs(seen - measured.xy).max() < 2e-4
    found.update_point_3d_errors()
    assert max(abs(point.error - stated[number]) for number, point in found.points3D.items()) < 1e-4


def test_pyopf_reads_the_project(tmp_path):
    pytest.importorskip("pyopf")
    from pyopf.io import load
    from pyopf.resolve import resolve

    results, points = flown(Flight())
    write(delivered(results, points, "opf"), "opf", tmp_path)
    project = resolve(load(str(tmp_path / "project.opf")))
    cameras = project.calibration.calibrated_cameras
    centre = np.array([camera.position for camera in cameras.cameras])
    np.testing.assert_array_equal(centre, results.images.projection_centre)
    assert [camera.uri for camera in project.camera_list.cameras] == list(NAMES)
    assert cameras.sensors[0].internals.radial_distortion[0] == pytest.approx(-0.02)
    gcps = project.input_control_points.gcps
    assert [(gcp.id, gcp.is_checkpoint, len(gcp.marks)) for gcp in gcps] == [
        ("P 3", False, 1),
        ("P80", True, 1),
    ]
    assert [point.id for point in project.input_control_points.mtps] == ["P160"]


@pytest.mark.parametrize("local", [False, True])
def test_gdal_reads_all_layers_with_their_system(local, tmp_path):
    geopandas = pytest.importorskip("geopandas")
    results, points = flown(Flight())
    if local:
        results = replace(results, images=replace(results.images, map_frame=LOCAL, frame=CartesianFrame()))
    write(delivered(results, points, "geopackage"), "geopackage", tmp_path)
    for name, count in LAYERS.items():
        layer = geopandas.read_file(tmp_path / "block.gpkg", layer=name)
        assert len(layer) == count
        assert layer.geometry.has_z.all()
        assert layer.geometry.is_valid.all()
        assert layer.crs.is_engineering if local else layer.crs.to_epsg() == 25832


def test_stac_items_are_valid(tmp_path, test_data):
    pystac = pytest.importorskip("pystac")
    jsonschema = pytest.importorskip("jsonschema")
    results, _ = flown(Flight())
    write(delivered(results, no_points(), "stac"), "stac", tmp_path)
    schema = json.loads((test_data / "format_samples" / "more" / "stac" / "schema.json").read_text())
    collection = pystac.Collection.from_file(str(tmp_path / "collection.json"))
    collection.validate()
    items = list(collection.get_items())
    assert len(items) == 4
    for item in items:
        jsonschema.validate(item.to_dict(include_self_link=False), schema)
        # Its extension's schema would be fetched.
        item.stac_extensions = []
        item.validate()
