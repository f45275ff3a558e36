"""Every published sample is read, or recognised and named for what it is; a further one fails until it is."""

from __future__ import annotations

import re
import shutil
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pyproj
import pytest

from adjust.geometry.rotation import from_omega_phi_kappa, ned_from_body
from tasks.deliveries.cameras import camera_record
from tasks.errors import InputError
from tasks.formats.applanix import read_applanix
from tasks.formats.colmap import read_colmap_exposures
from tasks.formats.json_value import json_value
from tasks.formats.native_csv import read_csv_exposures
from tasks.formats.opensfm import read_opensfm_cameras, read_opensfm_exposures
from tasks.formats.opensfm_control import read_opensfm_control, read_opensfm_measurements
from tasks.formats.opf import read_opf_cameras, read_opf_distances, read_opf_exposures
from tasks.formats.opf_project import tracks_of
from tasks.formats.ossim import read_ossim_camera
from tasks.formats.rtklib import read_rtklib
from tasks.formats.stac import read_stac_cameras, read_stac_exposures
from tasks.formats.table_layout import TableLayout
from tasks.formats.trajectory_records import SOLUTIONS
from tasks.inventory.recognition import recognised, rows_of
from tasks.settings.cameras import CameraInput
from tests.command_line import aerocal
from tests.tasks.formats.test_exchanged_blocks import NED, ORDER

#: Sample → what is read from it: kind, format, rows.
READ = {
    "applanix_eo/applanix_ecef_eo_example.txt": [("exposures", "applanix", 121)],
    "applanix_eo/applanix_utm_eo_example.txt": [("exposures", "applanix", 72)],
    "eo_csv/bc_patb_georef_ultracam_xp.csv": [("exposures", "csv", 6)],
    "eo_csv/ngi_xyz_opk.csv": [("exposures", "csv", 4)],
    "eo_csv/odm_lla_rpy.csv": [("exposures", "csv", 4)],
    "eo_csv/odm_xyz_opk.csv": [("exposures", "csv", 4)],
    "more/colmap/kapture_maupertuis_txt/cameras.txt": [("camera", "colmap", 1)],
    "more/colmap/kapture_maupertuis_txt/images.txt": [
        ("exposures", "colmap", 4),
        ("image_points", "colmap", 3345),
    ],
    "more/colmap/kapture_t265_rig/images.txt": [("exposures", "colmap", 6)],
    "more/colmap/sbcv_sceaux_bin/cameras.bin": [("camera", "colmap", 1)],
    "more/colmap/sbcv_sceaux_bin/images.bin": [
        ("exposures", "colmap", 11),
        ("image_points", "colmap", 36805),
    ],
    "more/metashape/geograypher_M3M_excerpt.xml": [("camera", "metashape", 1), ("exposures", "metashape", 1)],
    "more/openmvg/kapture_maupertuis_sfm_data.json": [
        ("camera", "openmvg", 1),
        ("exposures", "openmvg", 4),
        ("image_points", "openmvg", 1228),
    ],
    "more/opensfm/berlin/ground_control_points.json": [
        ("image_points", "opensfm-gcp", 5),
        ("control", "opensfm-gcp", 2),
    ],
    "more/opensfm/berlin/reconstruction_example.json": [
        ("camera", "opensfm", 1),
        ("exposures", "opensfm", 3),
    ],
    "more/opensfm/berlin/tracks_example.csv": [("image_points", "opensfm", 3219)],
    "more/rtklib_pos/rtklibpy_demo5_b34f_f.pos": [("trajectory", "rtklib", 4521)],
    "more/stac/collection.json": [("camera", "stac", 1)],
    "more/stac/item.json": [("camera", "stac", 1), ("exposures", "stac", 1)],
    "odm_gcp/bellus_gcp_list.txt": [("image_points", "odm-gcp", 4), ("control", "odm-gcp", 4)],
    "odm_gcp/boruszyn_gcp_list.txt": [("image_points", "odm-gcp", 18), ("control", "odm-gcp", 7)],
    "odm_gcp/copr_gcp_list.txt": [("image_points", "odm-gcp", 27), ("control", "odm-gcp", 10)],
    "opensfm/reconstruction.json": [("camera", "opensfm", 1), ("exposures", "opensfm", 4)],
    "opensfm/tracks_head200.csv": [("image_points", "opensfm", 199)],
    "sbet/2-points.sbet": [("trajectory", "sbet", 2)],
    "sbet/smrmsg_first100.out": [("accuracy", "smrmsg", 100)],
}
_PACK = "give the folder of the project as one zip file"
#: Samples that are no delivery by themselves → words of what `aerocal init` says of them.
NAMED = {
    # Both have a misprint, and are read without it.
    "applanix_eo/applanix_ecef_camera_file_sn0056.kwl": "line 35: The radius 12 mm of d12 is not larger",
    "applanix_eo/applanix_utm_camera_file_sn0085D.kwl": "line 67: The distortion at 29 mm is -396.728 µm",
    "calibration/camera_formats_from_certificates.csv": "a table of cameras (key, key_type, camera,",
    "eo_csv/ngi_xyz_opk.prj": "a CRS: +proj=tmerc +lat_0=0 +lon_0=25",
    "geoparquet/example.parquet": "GeoParquet with Polygon, MultiPolygon, 5 rows",
    "geoparquet/example_metadata.json": "the description of a GeoParquet file",
    "geoparquet/example_metadata_point.json": "the description of a GeoParquet file",
    "more/colmap/kapture_maupertuis_txt/points3D.txt": "object points of COLMAP",
    "more/colmap/kapture_t265_rig/cameras.txt": "OPENCV_FISHEYE",
    "more/colmap/kapture_t265_rig/colmap.db": "OPENCV_FISHEYE",
    "more/colmap/kapture_t265_rig/points3D.txt": "object points of COLMAP",
    "more/colmap/kapture_t265_rig/rigs.json": "rigs of COLMAP's rig_configurator",
    "more/colmap/sbcv_sceaux_bin/points3D.bin": "object points of COLMAP",
    "more/opensfm/berlin/config.yaml": "settings of OpenSfM",
    "more/opensfm/berlin/rig_assignments_example.json": "instances of OpenSfM's rigs",
    "more/opensfm/berlin/rig_cameras_example.json": "cameras of OpenSfM's rigs",
    "more/opf/arbitrary-scene-reference-frame.json": "(scene reference frame)",
    "more/opf/auxiliary_objects/calibrated-rig-relatives.json": _PACK,
    "more/opf/auxiliary_objects/crs-definition-epsg.json": _PACK,
    "more/opf/auxiliary_objects/crs-definition-geoid_height.json": _PACK,
    "more/opf/auxiliary_objects/geolocation-epsg.json": _PACK,
    "more/opf/auxiliary_objects/input-rig-relatives.json": _PACK,
    "more/opf/control_points/calibrated-control-points.json": "(calibrated control points)",
    "more/opf/control_points/constraints.json": "(constraints)",
    "more/opf/control_points/projected-control-points.json": "(projected control points)",
    "more/opf/partial/calibration.json": _PACK,
    "more/opf/partial/scene_reference_frame.json": _PACK,
    "more/stac/schema.json": "a JSON schema",
    "opf/calibrated-cameras.json": "(calibrated cameras)",
    "opf/camera-list.json": "(camera list)",
    "opf/control_points/input-control-points.json": "(input control points)",
    "opf/gps-bias.json": "(gps bias)",
    "opf/input-cameras.json": "(input cameras)",
    "opf/point_cloud/matchCameraIds.bin": "values of 'sparse.gltf'",
    "opf/point_cloud/matchPixelCoordinates.bin": "values of 'sparse.gltf'",
    "opf/point_cloud/matchPointIndexRanges.bin": "values of 'sparse.gltf'",
    "opf/point_cloud/positions.bin": "values of 'sparse.gltf'",
    "opf/point_cloud/sparse.gltf": "tie points of an OPF project (glTF)",
    "opf/project.opf": "(project)",
    "opf/projected-input-cameras.json": "(projected input cameras)",
    "opf/scene-reference-frame.json": "(scene reference frame)",
    "sbet/smrmsg_first100.csv": "a table, of whose columns too few are known (GpsTime,",
}
NOTES = re.compile(r"(README|LICENSE)[^/]*$")


@pytest.fixture(scope="module")
def samples(test_data: Path) -> Path:
    return test_data / "format_samples"


def test_every_sample_is_listed(samples: Path) -> None:
    files = {path.relative_to(samples).as_posix() for path in samples.rglob("*") if path.is_file()}
    assert files - READ.keys() - NAMED.keys() == {name for name in files if NOTES.search(name)}
    assert READ.keys() | NAMED.keys() <= files


@pytest.mark.parametrize("name", READ)
def test_a_sample_is_recognised_and_read(samples: Path, name: str) -> None:
    found = recognised(samples / name)
    assert [(one.kind, one.format, rows_of(one.records)) for one in found.contents] == READ[name]


@pytest.mark.parametrize("name", NAMED)
def test_a_sample_that_is_no_delivery_is_named(samples: Path, name: str) -> None:
    found = recognised(samples / name)
    assert found.contents == ()
    assert NAMED[name] in found.remark


def mended(samples: Path, folder: Path, name: str, old: str, new: str) -> Path:
    path = folder / "camera.kwl"
    text = (samples / "applanix_eo" / name).read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    return path


@pytest.mark.parametrize(
    ("name", "old", "new", "row", "focal", "principal_point", "size"),
    [
        (
            "applanix_ecef_camera_file_sn0056.kwl", "d12: 12 ", "d12: 13 ", (26.0, -349.886),
            55.03, (-0.31, 0.012), (4077, 4092),
        ),
        (
            "applanix_utm_camera_file_sn0085D.kwl", "-396.728", "-396.009", (31.0, -466.713),
            60.145, (-0.207, -0.09), (5436, 4092),
        ),
    ],
)  # fmt: skip
def test_the_distortion_of_a_camera_file_is_its_table_subtracted(
    samples, tmp_path, name, old, new, row, focal, principal_point, size
):
    (camera,) = read_ossim_camera(mended(samples, tmp_path, name, old, new)).values()
    assert (camera.columns, camera.rows) == size
    assert (camera.pixel_um, camera.focal_length_mm) == (9.0, focal)
    assert camera.principal_point_mm == principal_point
    radius, distortion_um = row
    values = camera.additional_parameters
    correction = sum(values[f"brown_mm:K{k}"] * radius ** (2 * k + 1) for k in (1, 2, 3))
    assert 1e3 * correction == pytest.approx(-distortion_um, abs=0.1)


def test_kappa_of_the_applanix_sample_follows_the_track_as_it_was_found(samples):
    """κ + azimuth over the 68 legs within lines: median 0.13°, median deviation 0.16°."""
    records = read_applanix(samples / "applanix_eo" / "applanix_utm_eo_example.txt", ORDER)
    leg = np.diff(records.position[:, :2], axis=0)
    within = np.argsort(np.hypot(*leg.T))[:-3]
    both = (records.angles[:-1, 2] + np.degrees(np.arctan2(leg[:, 0], leg[:, 1])) + 180.0) % 360.0 - 180.0
    assert len(within) == 68
    assert np.median(both[within]) == pytest.approx(0.13, abs=0.005)
    assert np.median(np.abs(both[within] - np.median(both[within]))) == pytest.approx(0.16, abs=0.005)


def test_the_crs_beside_a_table_is_declared_and_right(samples, tmp_path):
    for ending in ("csv", "prj"):
        shutil.copy(samples / "eo_csv" / f"ngi_xyz_opk.{ending}", tmp_path)
    assert aerocal("init", tmp_path).returncode == 0
    (exposures,) = tomllib.loads((tmp_path / "project.toml").read_text())["inputs"]["exposures"]
    assert exposures["crs"].startswith("+proj=tmerc +lat_0=0 +lon_0=25 +k=1")
    layout = TableLayout(columns={"image": "filename"}, elsewhere=("camera", "strip"))
    records = read_csv_exposures(tmp_path / "ngi_xyz_opk.csv", ORDER, layout)
    transform = pyproj.Transformer.from_crs(exposures["crs"], "EPSG:4326", always_xy=True)
    longitude, latitude = transform.transform(*records.position[:, :2].T)
    # The images are called after their map sheet, 3324C: 33.5° to 34° south, 24° to 24.5° east.
    assert ((longitude > 24.0) & (longitude < 24.5) & (latitude > -34.0) & (latitude < -33.5)).all()


def test_the_same_exposures_in_two_tables_agree(samples):
    """Heading, pitch, roll of the drone, and ω, φ, κ adjusted in UTM 51: within some degrees."""
    geographic = TableLayout(
        separator="blank",
        columns={"image": "filename", "x": "longitude", "y": "latitude", "z": "altitude", "heading": "yaw"},
        elsewhere=("strip",),
    )
    mapped = TableLayout(separator="blank", quote="'", columns={"image": "filename"}, elsewhere=("strip",))
    folder = samples / "eo_csv"
    drone = read_csv_exposures(folder / "odm_lla_rpy.csv", "heading-pitch-roll", geographic)
    adjusted = read_csv_exposures(folder / "odm_xyz_opk.csv", ORDER, mapped)
    row = [adjusted.image.to_pylist().index(name.removesuffix(".tif")) for name in drone.image.to_pylist()]
    projection = pyproj.Proj("EPSG:32651")
    east_north = np.column_stack(projection(*drone.position[:, :2].T))
    assert np.abs(east_north - adjusted.position[row, :2]).max() < 5.0
    # The top of the image points forward: T = R_z(90°) of the rotation chain.
    image = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    for k, angles in enumerate(drone.angles):
        convergence = projection.get_factors(*drone.position[k, :2]).meridian_convergence
        grid_from_enu = from_omega_phi_kappa(np.radians([0.0, 0.0, convergence]))
        turn = grid_from_enu @ NED @ ned_from_body(np.radians(angles)) @ image
        apart = turn.T @ from_omega_phi_kappa(np.radians(adjusted.angles[row[k]]))
        assert np.degrees(np.arccos(min(1.0, (np.trace(apart) - 1.0) / 2.0))) < 1.5


def test_the_table_of_certificates_is_a_table_of_cameras(samples):
    path = samples / "calibration" / "camera_formats_from_certificates.csv"
    lines = path.read_text().splitlines()[1:]
    assert len(lines) == 14
    for line in lines:
        key = line.split('"')[1]
        camera = CameraInput(
            file=path, format="csv", name_in_file=key, principal_point_mm=(0.0, 0.0), pixel_origin="corner",
            mount_deg=90,
            table={
                "columns": {
                    "camera": "key", "columns": "px_cross", "rows": "px_along", "pixel_um": "pitch_um",
                    "focal_length_mm": "focal_mm",
                },
                "unused": ["camera"],
            },
        )  # fmt: skip
        found = camera_record(camera)
        # Pixels times their size are the millimetres of the certificate, which the reader compares, too.
        assert f"{found.columns * found.pixel_um * 1e-3:.7g}" in line
        assert f"{found.rows * found.pixel_um * 1e-3:.7g}" in line
    assert found.focal_length_mm == 92.0


def test_the_stac_example_looks_where_its_matrix_and_angles_say(samples):
    records = read_stac_exposures(samples / "more" / "stac" / "item.json", ORDER)
    assert records.image.to_pylist() == ["file.xyz"]
    assert records.camera.to_pylist() == ["camera1"]
    assert records.position.tolist() == [[574271.56, 6223944.96, 996.12]]
    # The matrix is (Rx Ry Rz)ᵀ of the angles, which stand beside it with four decimals.
    np.testing.assert_allclose(records.angles, [[-0.0721, -34.9835, -90.0566]], rtol=0, atol=1e-9)
    assert (records.states.crs, records.states.reference) == ("EPSG:25832", "grid")
    assert "5799" in records.remarks[0]
    for name in ("item.json", "collection.json"):
        (camera,) = read_stac_cameras(samples / "more" / "stac" / name).values()
        assert (camera.columns, camera.rows, camera.pixel_um) == (7788, 10336, 5.2)
        assert (camera.focal_length_mm, camera.principal_point_mm) == (83.0, (0.0, 0.0))


def test_the_fisheye_rig_of_colmap_is_read_as_far_as_its_poses(samples):
    folder = samples / "more" / "colmap" / "kapture_t265_rig"
    records = read_colmap_exposures(folder / "images.txt", ORDER)
    names = records.image.to_pylist()
    for k in (1, 2, 3):
        right, left = (names.index(f"{side}raw/frame_00000000{k}.jpg") for side in ("right", "left"))
        np.testing.assert_allclose(records.angles[right], records.angles[left], rtol=0, atol=1e-9)
        # The two eyes of a T265 are 64 mm apart.
        assert np.linalg.norm(records.position[right] - records.position[left]) == pytest.approx(0.064)


def test_ground_control_of_opensfm_is_seen_where_it_was_measured(samples):
    folder = samples / "more" / "opensfm" / "berlin"
    control = read_opensfm_control(folder / "ground_control_points.json")
    points = read_opensfm_measurements(folder / "ground_control_points.json")
    assert control.point.to_pylist() == ["0", "3"]
    assert control.position[0].tolist() == [13.400703631118825, 52.51926834404209, 14.946108041331172]
    assert points.xy[0].tolist() == [-0.015689, 0.0625362]
    # Seen where it was measured, but for its height: heights of the reconstruction are those of telephones.
    exposures = read_opensfm_exposures(folder / "reconstruction_example.json", ORDER)
    (camera,) = read_opensfm_cameras(folder / "reconstruction_example.json").values()
    metres = np.array([111_320.0 * np.cos(np.radians(control.position[0, 1])), 111_277.0, 1.0])
    names = zip(points.point.to_pylist(), points.image.to_pylist(), points.xy[:, 0], strict=True)
    for name, image, x in names:
        if name in control.point.to_pylist():
            k = exposures.image.to_pylist().index(image)
            way = (control.position[control.point.to_pylist().index(name)] - exposures.position[k]) * metres
            way[2] = 0.0
            right, _, back = from_omega_phi_kappa(np.radians(exposures.angles[k])).T @ way
            focal = camera.focal_length_px / max(camera.columns, camera.rows)
            assert abs(focal * right / -back - x) < 0.07


def test_the_solution_of_rtklib_has_both_qualities_and_one_sample_a_second(samples):
    records = read_rtklib(next((samples / "more" / "rtklib_pos").glob("*.pos")))
    assert {SOLUTIONS[number] for number in np.unique(records.solution)} == {"fixed", "float"}
    assert np.median(np.diff(records.time_s)) == 1.0


def opf_example(samples: Path, folder: Path, **changed: str) -> Path:
    """The published parts of an OPF project as one zip file, some of them changed."""
    path = folder / "opf.zip"
    opf, more = samples / "opf", samples / "more" / "opf"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for root in (opf, more):
            for file in sorted(root.rglob("*.*")):
                name = file.relative_to(root).as_posix()
                if file.suffix in (".json", ".opf", ".gltf", ".bin") and name not in archive.namelist():
                    content = file.read_bytes()
                    archive.writestr(name, changed.get(file.name.partition(".")[0], content))
    return path


def test_the_parts_of_the_opf_example_say_what_they_are(samples, tmp_path):
    path = opf_example(samples, tmp_path)
    distances = read_opf_distances(path)
    assert distances.point.to_pylist() == ["gcp0"]
    assert distances.other_point.to_pylist() == ["gcp1"]
    assert (distances.distance.tolist(), distances.sigma.tolist()) == ([1.23], [0.1])
    # Its arbitrary frame is left-handed (x north, y east) and says that it is not.
    scene = (samples / "more" / "opf" / "arbitrary-scene-reference-frame.json").read_text()
    cameras = (samples / "opf" / "camera-list.json").read_text()
    # Its list of cameras lacks the second one of a capture.
    listed = cameras.replace("28436394", "57282923")
    with pytest.raises(InputError, match="swap_xy"):
        read_opf_exposures(opf_example(samples, tmp_path, **{"camera-list": listed}), ORDER)
    right = {
        "camera-list": listed,
        "arbitrary-scene-reference-frame": scene.replace('"swap_xy": false', '"swap_xy": true'),
        "calibrated-cameras": (samples / "opf" / "calibrated-cameras.json")
        .read_text()
        .replace("57282113", "65728243"),
    }
    records = read_opf_exposures(opf_example(samples, tmp_path, **right), ORDER)
    assert records.states.crs == "local"
    assert records.position[0].tolist() == [483.054, 13.957, 28.12]
    np.testing.assert_allclose(records.angles[2], [1.4753, 10.5839, -2.94832])
    assert "shift 5.302, 3.089, -35.246 m" in records.remarks[0]
    # Two rigs; what is said of their mountings is not what their cameras have, or missing.
    assert records.event is None
    assert [remark.partition(":")[0][-14:] for remark in records.remarks[1:]] == 2 * ["single cameras"]
    with pytest.raises(InputError, match="Only perspective"):
        read_opf_cameras(opf_example(samples, tmp_path, **right))


def test_the_matches_of_the_opf_cloud_have_their_pixels(samples):
    folder = samples / "opf" / "point_cloud"
    cloud = json_value(folder / "sparse.gltf", (folder / "sparse.gltf").read_bytes())
    tracks = tracks_of(cloud, lambda uri: (folder / uri).read_bytes())
    pixels = np.frombuffer((folder / "matchPixelCoordinates.bin").read_bytes(), "<f4").reshape(-1, 2)
    assert len(np.frombuffer((folder / "positions.bin").read_bytes(), "<f4")) == 3 * 3074
    ranges = np.frombuffer((folder / "matchPointIndexRanges.bin").read_bytes(), "<u8")
    assert len(tracks.point) == int((ranges >> np.uint64(40)).sum())
    assert {tuple(xy) for xy in tracks.xy.tolist()} <= {tuple(xy) for xy in pixels.astype(float).tolist()}
    assert set(tracks.camera) <= {0, 1, 2, 3}
