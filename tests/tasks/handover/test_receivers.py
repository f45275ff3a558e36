"""Programs' own libraries open what is written for them; a test is skipped where its library is missing."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
import rasterio
from rasterio import warp
from scipy import ndimage
from scipy.interpolate import RectBivariateSpline

from adjust.geometry.earth import CartesianFrame
from adjust.geometry.rotation import from_omega_phi_kappa
from tasks.formats.colmap import read_colmap_cameras, read_colmap_exposures
from tasks.handover.block_points import no_points
from tasks.handover.delivery import Delivery
from tasks.handover.formats.register import REGISTER
from tasks.handover.receiver import hand_over
from tests.tasks.handover.flown_block import GROUND, LOCAL, NAMES, Flight, delivered, flown
from tests.tasks.handover.test_ground_through_files import seen as seen_by

CASES = [Flight(), Flight(4000.0, 45.0)]
BINNED = 20
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
    exposures = read_colmap_exposures(tmp_path / "images.txt", "omega-phi-kappa")
    cameras = list(read_colmap_cameras(tmp_path / "cameras.txt").values())
    for image in found.images.values():
        for measured in image.points2D:
            seen = image.project_point(found.points3D[measured.point3D_id].xyz)
            # Image points have four decimals, points six decimals of a metre.
            assert np.abs(seen - measured.xy).max() < 2e-4
        k = exposures.image.to_pylist().index(image.name)
        ground = np.array([found.points3D[one.point3D_id].xyz for one in image.points2D])
        turn = from_omega_phi_kappa(np.radians(exposures.angles[k]))
        ours = seen_by(cameras[image.camera_id - 1], exposures.position[k], turn, ground)
        theirs = np.array([image.project_point(place) for place in ground])
        assert np.abs(ours - theirs).max() < 1e-6
    found.update_point_3d_errors()
    assert max(abs(point.error - stated[number]) for number, point in found.points3D.items()) < 1e-4


def test_errors_of_colmap_are_the_lengths_of_residuals_in_pixels():
    results, points = flown(Flight())
    xy = points.xy.copy()
    # Three pixels to the right and four up.
    xy[7] += np.array([3.0, 4.0]) * 4e-6
    written = REGISTER["colmap"].write(delivered(results, replace(points, xy=xy), "colmap"))
    lines = [line.split() for line in written["points3D.txt"].splitlines() if not line.startswith("#")]
    errors = np.array([float(cells[7]) for cells in lines])
    assert errors[7] == pytest.approx(5.0, abs=1e-3)
    assert np.delete(errors, 7).max() < 1e-3


def test_images_of_colmap_name_their_cameras_by_the_numbers_in_the_list():
    results, points = flown(Flight())
    written = REGISTER["colmap"].write(delivered(results, points, "colmap"))
    cameras = [line.split() for line in written["cameras.txt"].splitlines() if not line.startswith("#")]
    assert [cells[0] for cells in cameras] == ["1", "2"]
    # Every image has a second line, that of its points.
    images = [line for line in written["images.txt"].splitlines() if not line.startswith("#")][::2]
    assert [line.split(" ")[8] for line in images] == ["1", "2", "1", "2"]


@pytest.mark.parametrize(
    ("world", "refracted", "curvature", "refraction"),
    [
        ("map", False, "off", "off"),
        ("map", True, "off", "on"),
        ("map-cartesian", True, "off", "off"),
        ("map-cartesian-curved", True, "on", "off"),
    ],
)
def test_inpho_is_told_what_it_has_to_correct_and_the_height_of_the_ground(
    world, refracted, curvature, refraction
):
    results, _ = flown(Flight(refracted=refracted))
    results = replace(results, ground=results.ground + np.arange(4.0)[:, None])
    handed = hand_over(results, world, REGISTER["inpho"].freed)
    text = REGISTER["inpho"].write(Delivery(results, handed))["inpho.prj"]
    assert f"$CURV_CORR_DEFAULT : {curvature}\n" in text
    assert f"$REFRACT_CORR_DEFAULT : {refraction}\n" in text
    heights = [line.split()[-1] for line in text.splitlines() if "$TERRAIN_HEIGHT" in line]
    assert heights == ["400.000", "401.000", "402.000", "403.000"]


def test_photos_of_patb_have_their_focal_length_in_micrometres():
    results, points = flown(Flight())
    written = REGISTER["patb"].write(delivered(results, points, "patb"))["patb.im"]
    heads = [line.split() for line in written.splitlines() if len(line.split()) == 2]
    assert heads == [[str(k), "79800.000"] for k in range(1, 5)]


def test_openmvg_has_control_apart_and_check_points_in_its_structure():
    results, points = flown(Flight())
    written = REGISTER["openmvg"].write(delivered(results, points, "openmvg"))
    found = json.loads(written["sfm_data.json"])
    check = points.names.index("P80")
    assert [item["key"] for item in found["control_points"]] == [points.names.index("P 3")]
    (seen,) = (item["value"]["X"] for item in found["structure"] if item["key"] == check)
    np.testing.assert_allclose(seen, points.local[check])


def test_plan_of_blocks_exchange_is_as_accurate_as_its_worse_coordinate():
    results, points = flown(Flight())
    sigma = np.tile([0.02, 0.03, 0.05], (3, 1))
    points = replace(points, surveyed=replace(points.surveyed, sigma=sigma))
    written = REGISTER["blocks-exchange"].write(delivered(results, points, "blocks-exchange"))["block.xml"]
    accuracy = [line.strip() for line in written.splitlines() if "Accuracy>" in line]
    assert (
        accuracy
        == [
            "<HorizontalAccuracy>0.03</HorizontalAccuracy>",
            "<VerticalAccuracy>0.05</VerticalAccuracy>",
        ]
        * 2
    )


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
    cloud = project.calibration.tracks
    (node,) = cloud.nodes
    assert len(node) == 300 - 3
    turn = np.array(node.matrix)
    place = np.column_stack([node.position, np.ones(len(node))]) @ turn.T
    ties = points.local[~points.is_surveyed]
    np.testing.assert_allclose(place[:, :3], ties, atol=1e-4)
    seen = node.matches.image_points.pixelCoordinates
    measured = (points.xy * [1.0, -1.0] + (0.034008, 0.05292)) / 4e-6
    np.testing.assert_allclose(seen, measured[~points.is_surveyed], atol=2e-3)


def image_of_the_ground(results, path):
    """Write an image (2, rows, columns) of the first camera that shows where on the ground it is."""
    frame, one = results.cameras[0].frame, results.images.only(0)
    # The place is smooth: a spline through every eighth pixel has it to less than a thousandth of one.
    down, along = (np.linspace(0.5, side - 0.5, side // 8) for side in (frame.rows, frame.columns))
    row, column = np.meshgrid(down, along, indexing="ij")
    xy = (
        np.column_stack([column.ravel(), -row.ravel()]) * frame.pixel_size
        + np.array([-1.0, 1.0]) * frame.half_format
    )
    ideal = results.cameras[0].ideal(xy)
    ground = one.ground(ideal[None], np.full((1, len(xy)), GROUND))[0, :, :2]
    middle = ground.mean(axis=0)
    pixels = [np.arange(side) + 0.5 for side in (frame.rows, frame.columns)]
    coordinates = (ground - middle).T.reshape(2, len(down), len(along))
    image = np.array([RectBivariateSpline(down, along, part)(*pixels) for part in coordinates], np.float32)
    with rasterio.open(
        path, "w", driver="GTiff", width=frame.columns, height=frame.rows, count=2, dtype="float32"
    ) as file:
        file.write(image)
    return image, middle


@pytest.mark.filterwarnings("ignore:Dataset has no geotransform", "ignore::PendingDeprecationWarning")
@pytest.mark.parametrize(
    "case",
    [
        Flight(1000.0, 45.0, refracted=True, binned=BINNED),
        pytest.param(Flight(1000.0, refracted=True, binned=BINNED), marks=pytest.mark.slow),
        pytest.param(
            Flight(4000.0, refracted=True, longitude_deg=12.0, binned=BINNED), marks=pytest.mark.slow
        ),
    ],
)
def test_gdal_warps_an_image_by_its_polynomials_onto_the_rigorous_ground(case, tmp_path):
    results, points = flown(case)
    write(delivered(results, points, "rpc"), "rpc", tmp_path)
    frame, (image, middle) = results.cameras[0].frame, image_of_the_ground(results, tmp_path / "1 a.tif")
    with rasterio.open(tmp_path / "1 a.tif") as file:
        polynomials = file.rpcs
    # Squares of the ground of about a pixel, from the middle.
    pixel_m = case.above / np.cos(np.radians(case.tilt_deg)) * frame.pixel_size / frame.focal_length
    side = 301
    place = rasterio.transform.from_origin(
        *(middle + [-0.5, 0.5] * np.array(side * pixel_m)), pixel_m, pixel_m
    )
    warped = np.full((2, side, side), np.nan, np.float32)
    warp.reproject(
        image, warped, rpcs=polynomials, src_crs="EPSG:4979", dst_transform=place, dst_crs="EPSG:25832",
        dst_nodata=np.nan, resampling=warp.Resampling.bilinear, tolerance=0.0, RPC_HEIGHT=GROUND,
    )  # fmt: skip
    rows, columns = np.indices((side, side)) + 0.5
    expected = np.stack(place * (columns, rows)) - middle[:, None, None]
    away = np.hypot(*(warped - expected)) / pixel_m
    assert np.isfinite(away).mean() > 0.8
    assert np.nanmax(away) < 0.1


@pytest.mark.filterwarnings("ignore:Dataset has no geotransform", "ignore::PendingDeprecationWarning")
@pytest.mark.parametrize("above", [1000.0, 2000.0, 4000.0])
def test_orthority_rectifies_an_image_onto_the_rigorous_ground(above, tmp_path):
    """It is AGPL, never imported, and started as a program of an environment of its own."""
    program = os.environ.get("AEROCAL_ORTHORITY", shutil.which("oty"))
    if program is None:
        pytest.skip("orthority is not installed: AEROCAL_ORTHORITY names its program oty")
    results, _ = flown(Flight(above, refracted=True, binned=BINNED))
    write(delivered(results, no_points(), "orthority"), "orthority", tmp_path)
    _, middle = image_of_the_ground(results, tmp_path / "1 a.tif")
    frame = results.cameras[0].frame
    pixel_m, half = above * frame.pixel_size / frame.focal_length, 1.5 * above
    place = rasterio.transform.from_origin(middle[0] - half, middle[1] + half, half / 10.0, half / 10.0)
    with rasterio.open(
        tmp_path / "dem.tif", "w", driver="GTiff", width=20, height=20, count=1, dtype="float32",
        crs="EPSG:25832", transform=place,
    ) as file:  # fmt: skip
        file.write(np.full((1, 20, 20), GROUND, np.float32))
    command = [
        program, "frame", "--dem", "dem.tif", "--int-param", "interior.yaml", "--ext-param",
        "exterior.geojson", "--res", str(pixel_m), "--full-remap", "--interp", "bilinear",
        "--dem-interp", "nearest", "--compress", "deflate", "--dtype", "float32", "1 a.tif",
    ]  # fmt: skip
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    with rasterio.open(tmp_path / "1 a_ORTHO.tif") as file:
        found, valid, transform = file.read(), file.dataset_mask() > 0, file.transform
    rows, columns = np.indices(valid.shape) + 0.5
    expected = np.stack(transform * (columns, rows)) - middle[:, None, None]
    away = np.hypot(*(found - expected)) / pixel_m
    assert valid.mean() > 0.8
    # Beside the border of the image there is nothing to interpolate with.
    inside = ndimage.binary_erosion(valid, iterations=2)
    assert np.max(away[inside]) < 0.1


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
