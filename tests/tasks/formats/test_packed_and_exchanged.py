"""OPF, OpenMVG, MicMac, BAL and COLMAP's database: known values, published files, damage."""

from __future__ import annotations

import json
import sqlite3
import struct
import zipfile
from contextlib import closing

import numpy as np
import pytest

from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.correction import measured_from_ideal
from adjust.camera.additional.register import additional_parameters
from adjust.geometry.rotation import exp, from_omega_phi_kappa
from tasks.errors import InputError
from tasks.formats import colmap_database
from tasks.formats.bal import read_bal_exposures, read_bal_image_points
from tasks.formats.colmap_database import (
    read_colmap_database_cameras,
    read_colmap_database_exposures,
    read_colmap_database_image_points,
)
from tasks.formats.micmac import (
    read_micmac_cameras,
    read_micmac_control,
    read_micmac_exposures,
    read_micmac_image_points,
)
from tasks.formats.openmvg import read_openmvg_cameras, read_openmvg_exposures, read_openmvg_image_points
from tasks.formats.opf import read_opf_cameras, read_opf_control, read_opf_exposures, read_opf_image_points
from tasks.formats.pix4d import read_pix4d_cameras
from tasks.handover.formats.register import REGISTER
from tests.tasks.formats import packed_files as small
from tests.tasks.formats.sound_files import PIX4D_CAMERAS
from tests.tasks.formats.test_exchanged_blocks import residuals_px
from tests.tasks.handover.flown_block import NAMES, Flight, delivered, flown
from tests.tasks.handover.test_ground_through_files import pixels, seen

ORDER = "omega-phi-kappa"


def test_a_database_with_more_cameras_than_any_block_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(colmap_database, "_MOST_CAMERAS", 1_000)
    path = saved(tmp_path, small.colmap_database())
    values = struct.pack("<8d", 200, 201, 50, 40, 0.1, 0, 0.001, 0)
    with closing(sqlite3.connect(path)) as connection:
        rows = ((number, values) for number in range(100, 1_100))
        connection.executemany("INSERT INTO cameras VALUES (?, 4, 100, 80, ?, 1)", rows)
        connection.commit()
    with pytest.raises(InputError, match="more than 1,000 cameras"):
        read_colmap_database_cameras(path)


def saved(folder, content, name="file"):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def test_an_opf_project_in_a_map(tmp_path):
    path = saved(tmp_path, small.packed(small.OPF))
    exposures = read_opf_exposures(path, ORDER)
    assert exposures.image.to_pylist() == ["IMG 1.tif"]
    assert exposures.camera.to_pylist() == ["S"]
    np.testing.assert_allclose(exposures.position, [[500010.5, 5300020.25, 900.0]], atol=1e-9)
    np.testing.assert_allclose(exposures.angles, [[1.0, -2.0, 30.0]], atol=1e-12)
    assert "25832" in exposures.states.crs
    assert "not true camera positions" in exposures.remarks[0]
    (camera,) = read_opf_cameras(path).values()
    assert (camera.columns, camera.rows, camera.focal_length_px) == (100, 80, 201.0)
    assert camera.principal_point_px == (1.5, 1.0)
    assert camera.additional_parameters == {"brown-forward:k1": 0.1, "brown-forward:p2": 0.001}
    control = read_opf_control(path)
    assert (control.point.to_pylist(), control.role.to_pylist()) == (["G1"], ["check"])
    assert control.position.tolist() == [[500000.0, 5300000.0, 12.0]]
    points = read_opf_image_points(path)
    assert points.point.to_pylist() == ["G1", "M1"]
    assert points.xy.tolist() == [[1.5, 2.5], [3.0, 4.0]]


def test_coordinates_of_an_opf_control_point_are_in_the_order_of_its_crs(tmp_path):
    text = small.OPF["p/input-control-points.json"]
    text = text.replace("EPSG:25832", "EPSG:4326").replace("500000, 5300000", "48.5, 9.25")
    path = saved(tmp_path, small.packed({**small.OPF, "p/input-control-points.json": text}))
    assert read_opf_control(path).position.tolist() == [[9.25, 48.5, 12.0]]


def test_captures_are_read_where_nothing_is_calibrated(tmp_path):
    project = json.loads(small.OPF["p/project.opf"])
    project["items"] = project["items"][:4]
    cameras = json.loads(small.OPF["p/input-cameras.json"])
    cameras["captures"] = [
        {
            "id": 1, "cameras": [{"id": 7, "sensor_id": 3}], "reference_camera_id": 7,
            "geolocation": {
                "crs": {"definition": "EPSG:4326+5773"}, "coordinates": [46.5, 6.5, 531.0],
                "sigmas": [1.5, 1.75, 2.5],
            },
            "orientation": {"type": "yaw_pitch_roll", "angles_deg": [117, 9, 9], "sigmas_deg": [5, 5, 5]},
        }
    ]  # fmt: skip
    changed = {"p/project.opf": json.dumps(project), "p/input-cameras.json": json.dumps(cameras)}
    found = read_opf_exposures(saved(tmp_path, small.packed({**small.OPF, **changed})), ORDER)
    assert found.position.tolist() == [[6.5, 46.5, 531.0]]
    assert found.sigma_position.tolist() == [[1.75, 1.5, 2.5]]
    assert np.isnan(found.angles).all()


def test_the_published_opf_example_is_read_as_far_as_it_is_one(test_data, tmp_path):
    folder = test_data / "format_samples" / "opf"
    path = tmp_path / "opf.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in folder.rglob("*"):
            if file.is_file():
                archive.write(file, f"example/{file.relative_to(folder)}")
    # Its camera list repeats a number and lacks another, and its sensors are fisheyes.
    with pytest.raises(InputError, match="no camera or sensor 57282923"):
        read_opf_exposures(path, ORDER)
    with pytest.raises(InputError, match="Only perspective"):
        read_opf_cameras(path)
    with pytest.raises(InputError, match="no camera or sensor 10000000"):
        read_opf_image_points(path)
    control = read_opf_control(path)
    # EPSG:4265 counts latitude first.
    assert control.position.tolist() == [[2.0, 1.0, 3.0]]
    assert control.role.to_pylist() == ["check"]


def test_our_own_opf_project_sees_the_ground(tmp_path):
    results, points = flown(Flight(2000.0, 45.0))
    path = saved(tmp_path, small.packed(REGISTER["opf"].write(delivered(results, points, "opf"))))
    exposures = read_opf_exposures(path, ORDER)
    assert exposures.states.crs == "local"
    cameras, turn = read_opf_cameras(path), from_omega_phi_kappa(np.radians(exposures.angles))
    for k, name in enumerate(NAMES):
        assert exposures.image[k].as_py() == name
        camera = cameras[exposures.camera[k].as_py()]
        ground = points.local[points.point[points.image == k]]
        away = seen(camera, exposures.position[k], turn[k], ground) - pixels(results, points, k)
        assert np.abs(away).max() < 1e-5
    control = read_opf_control(path)
    np.testing.assert_array_equal(control.position, points.surveyed.local[:2])
    marks = read_opf_image_points(path)
    assert marks.point.to_pylist()[:4] == ["P 3", "P80", "P160", "tie1"]
    assert len(marks.point) == len(points.xy)
    image = np.array(marks.image.to_pylist())
    for k, name in enumerate(NAMES):
        # Pixels of matches are float32; marks of surveyed points come first.
        read, ours = marks.xy[image == name], pixels(results, points, k)
        away = np.linalg.norm(read[:, None] - ours[None], axis=2)
        assert away.min(axis=0).max() < 2e-3


@pytest.mark.parametrize(
    ("member", "change", "says"),
    [
        ("matchCameraIds.bin", lambda content: content[:-4], "are inconsistent"),
        ("matchCameraIds.bin", lambda content: content[:-4] + b"\xff" * 4, "are inconsistent"),
        ("matchPointIndexRanges.bin", lambda content: b"\xff" * len(content), "are inconsistent"),
        ("tie-points.gltf", lambda text: text.replace("5126", "5123"), "are inconsistent"),
        (
            "tie-points.gltf",
            lambda text: text.replace('"cameraIds": 1', '"cameraIds": 99'),
            "are inconsistent",
        ),
        ("tie-points.gltf", lambda text: text.replace("positions.bin", "../../etc/passwd"), None),
        ("tie-points.gltf", lambda text: text.replace("matchCameraIds", "no"), "lacks a file"),
    ],
)
def test_damaged_tie_points_of_opf_are_refused(member, change, says, tmp_path):
    results, points = flown(Flight())
    files = dict(REGISTER["opf"].write(delivered(results, points, "opf")))
    files[member] = change(files[member])
    path = saved(tmp_path, small.packed(files))
    if says is None:
        # Positions of tie points are not read, nor their file.
        assert len(read_opf_image_points(path).point) == len(points.xy)
        return
    with pytest.raises(InputError, match=says):
        read_opf_image_points(path)


@pytest.mark.parametrize(
    ("member", "old", "new", "says"),
    [
        ("p/scene-reference-frame.json", "[1, 1, 1]", "[0.3048, 0.3048, 1]", "is not metres"),
        ("p/scene-reference-frame.json", "EPSG:25832", "+proj=utm +init=/etc/hosts", "refers to a file"),
        ("p/camera-list.json", '"id": 7', '"id": 8', "no camera or sensor 7"),
        ("p/calibrated-cameras.json", "[1.0, -2.0, 30.0]", "[1.0, -2.0]", "2 numbers, but 3"),
        ("p/project.opf", "camera-list.json", "../../etc/passwd", "lacks a file"),
    ],
)
def test_damaged_opf_projects_are_refused(member, old, new, says, tmp_path):
    assert old in small.OPF[member]
    changed = {**small.OPF, member: small.OPF[member].replace(old, new)}
    with pytest.raises(InputError, match=says):
        read_opf_exposures(saved(tmp_path, small.packed(changed)), ORDER)


def test_what_is_no_packed_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match="not a zip file"):
        read_opf_exposures(saved(tmp_path, small.OPF["p/project.opf"]), ORDER)
    with pytest.raises(InputError, match=r"0 files \*\.opf"):
        read_opf_exposures(saved(tmp_path, small.packed({"a.txt": "a"})), ORDER)
    # A small file that would be a large one.
    path = tmp_path / "bomb.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("project.opf", b" " * 50_000_000)
    with pytest.raises(InputError, match="more than the 20 MB"):
        read_opf_exposures(path, ORDER)


def test_openmvg_sees_its_own_points(test_data):
    path = test_data / "format_samples" / "more" / "openmvg" / "kapture_maupertuis_sfm_data.json"
    exposures, points = read_openmvg_exposures(path, ORDER), read_openmvg_image_points(path)
    (camera,) = read_openmvg_cameras(path).values()
    given = json.loads(path.read_text())
    objects = {str(one["key"]): one["value"]["X"] for one in given["structure"]}
    assert len(exposures.image) == len(given["extrinsics"])
    assert len(points.image) == sum(len(one["value"]["observations"]) for one in given["structure"])
    assert (camera.columns, camera.rows, camera.focal_length_px) == (1600, 1200, 1668.7938300915465)
    away = residuals_px(exposures, camera, points, objects)
    rms = np.sqrt((away**2).sum(axis=1).mean())
    # An independent computation on this file: 0.67 px.
    assert rms == pytest.approx(0.67, abs=0.005)
    assert np.abs(away.mean(axis=0)).max() < 1e-3


def test_orientations_of_micmac_are_those_of_a_published_pair(tmp_path):
    """Its angles and the first line of its matrix are known."""
    matrix = from_omega_phi_kappa(np.radians([-5.819826, -7.058795, -12.262634])) @ np.diag([1.0, -1.0, -1.0])
    np.testing.assert_allclose(matrix[0], [0.969777798578, -0.210783330506, 0.122887790141], atol=1e-8)
    second, third = (" ".join(f"{value:.12f}" for value in row) for row in matrix[1:])
    text = small.ORIENTATION.format(second=second, third=third)
    path = saved(tmp_path, small.packed({"Ori-X/Orientation-I 1.tif.xml": text, "Ori-X/AutoCal.xml": "<a/>"}))
    found = read_micmac_exposures(path, ORDER)
    assert found.image.to_pylist() == ["I 1.tif"]
    np.testing.assert_allclose(found.angles, [[-5.819826, -7.058795, -12.262634]], atol=1e-6)
    assert found.position.tolist() == [[10.5, 20.25, 900.0]]


@pytest.mark.parametrize(
    ("centre", "b1", "b2", "limit_px"),
    [
        ((51.5, 39.0), 0.0, 0.0, 1e-6),
        # Brown's terms about the principal point do not say quite the same about another centre.
        ((50.0, 40.0), 1e-4, 2e-4, 2e-3),
    ],
)
def test_the_distortion_of_micmac_leads_from_ideal_to_measured_points(tmp_path, centre, b1, b2, limit_px):
    p2 = -2e-6
    text = small.CALIBRATION.replace("<P2>0</P2>", f"<P2>{p2}</P2><b1>{b1}</b1><b2>{b2}</b2>")
    text = text.replace("<CDist>50 40</CDist>", "<CDist>{} {}</CDist>".format(*centre))
    (camera,) = read_micmac_cameras(saved(tmp_path, text, "AutoCal.xml")).values()
    assert (camera.columns, camera.rows, camera.focal_length_px) == (100, 80, 200.0)
    assert camera.principal_point_px == (1.5, 1.0)
    values = {name.split(":")[1]: value for name, value in camera.additional_parameters.items()}
    image_format = ImageFormat(250e-6, 200e-6, focal_length=200 * 5e-6)
    wanted = additional_parameters("+".join(f"brown-forward:{name}" for name in values), image_format)
    # An ideal pixel, distorted by hand.
    x, y = np.array([88.0, 12.0]) - centre
    square = x * x + y * y
    radial = 1e-5 * square + 2e-13 * square**2
    measured = [
        88.0 + x * radial + 1e-6 * (square + 2 * x * x) + 2 * p2 * x * y + b1 * x + b2 * y,
        12.0 + y * radial + p2 * (square + 2 * y * y) + 2e-6 * x * y,
    ]
    target = (np.array([88.0, 12.0]) - [51.5, 39.0]) * [5e-6, -5e-6]
    known = np.array([values[name.split(":")[1]] for name in wanted.names])
    found, good = measured_from_ideal(wanted, known, target[None])
    assert good.all()
    back = found[0] / [5e-6, -5e-6] + [51.5, 39.0]
    np.testing.assert_allclose(back, measured, rtol=0.0, atol=limit_px)
    assert abs(measured[0] - 88.0) > 0.5


@pytest.mark.parametrize(
    ("there", "instead", "what"),
    [
        ("<PP>", "<OrIntGlob><C2M>true</C2M></OrIntGlob><PP>", "not in pixels"),
        ("</CalibDistortion>", "</CalibDistortion><CalibDistortion><ModRad/></CalibDistortion>", "2 dist"),
    ],
)
def test_another_calibration_of_micmac_is_refused(tmp_path, there, instead, what):
    path = saved(tmp_path, small.CALIBRATION.replace(there, instead), "AutoCal.xml")
    with pytest.raises(InputError, match=what):
        read_micmac_cameras(path)


def test_a_calibration_of_micmac_without_distortion_is_read(tmp_path):
    head, tail = small.CALIBRATION.split("<ModPhgrStd>")
    text = f"{head}<ModNoDist><Inutile/></ModNoDist>{tail.split('</ModPhgrStd>')[1]}"
    (camera,) = read_micmac_cameras(saved(tmp_path, text, "AutoCal.xml")).values()
    assert camera.additional_parameters == {}


def test_homologous_points_of_pairs_become_tie_points(tmp_path):
    found = read_micmac_image_points(saved(tmp_path, small.packed(small.MICMAC_POINTS)))
    rows = sorted(zip(found.point.to_pylist(), found.image.to_pylist(), found.xy.tolist(), strict=True))
    assert rows == [
        ("tie1", "a.tif", [1.5, 2.5]), ("tie1", "b.tif", [3.5, 4.5]), ("tie1", "c.tif", [5.5, 6.5]),
        ("tie2", "a.tif", [7.0, 8.0]), ("tie2", "b.tif", [9.0, 10.0]),
    ]  # fmt: skip
    # A chain that comes back to another place of an image contradicts itself.
    chain = {**small.MICMAC_POINTS, "Homol/Pastisc.tif/a.tif.txt": "5.5 6.5 50 60\n"}
    found = read_micmac_image_points(saved(tmp_path, small.packed(chain)))
    assert found.point.to_pylist() == ["tie1", "tie1"]


def test_ground_points_of_micmac(tmp_path):
    found = read_micmac_control(saved(tmp_path, small.GROUND_POINTS))
    assert found.point.to_pylist() == ["G 1"]
    np.testing.assert_array_equal(found.position, [[1.5, 2.5, np.nan]])
    np.testing.assert_array_equal(found.sigma, [[0.02, 0.02, np.nan]])
    text = """<SetOfMesureAppuisFlottants><MesureAppuiFlottant1Im><NameIm>a.tif</NameIm><OneMesureAF1I>
    <NamePt>G 1</NamePt><PtIm>5.5 6.5</PtIm></OneMesureAF1I>
    </MesureAppuiFlottant1Im></SetOfMesureAppuisFlottants>"""
    points = read_micmac_image_points(saved(tmp_path, text))
    assert (points.image.to_pylist(), points.point.to_pylist()) == (["a.tif"], ["G 1"])
    assert points.xy.tolist() == [[5.5, 6.5]]


def test_a_problem_of_bal_sees_its_own_points(tmp_path):
    rng = np.random.default_rng(3)
    cameras = np.column_stack(
        [rng.normal(0, 0.2, (3, 3)), rng.normal(0, 1, (3, 3)), np.tile([500.0, 0, 0], (3, 1))]
    )
    ground = rng.normal(0, 1, (5, 3)) - [0, 0, 20.0]
    lines = []
    for number, camera in enumerate(cameras):
        x, y, z = (ground @ exp(camera[:3]).T + camera[3:6]).T
        lines += [f"{number} {k} {500 * x[k] / -z[k]!r} {500 * y[k] / -z[k]!r}" for k in range(5)]
    numbers = [repr(float(value)) for value in (*cameras.ravel(), *ground.ravel())]
    text = "\n".join(["3 5 15", *lines, *numbers]).replace("np.float64(", "").replace(")", "")
    path = saved(tmp_path, text + "\n")
    exposures, points = read_bal_exposures(path, ORDER), read_bal_image_points(path)
    turn = from_omega_phi_kappa(np.radians(exposures.angles))
    for row, (image, point) in enumerate(
        zip(points.image.to_pylist(), points.point.to_pylist(), strict=True)
    ):
        x, y, z = turn[int(image)].T @ (ground[int(point)] - exposures.position[int(image)])
        np.testing.assert_allclose(points.xy[row], [500 * x / -z, 500 * y / -z], atol=1e-9)
    with pytest.raises(InputError, match="announced"):
        read_bal_exposures(saved(tmp_path, text.rsplit("\n", 1)[0]), ORDER)


def test_cameras_of_a_parameter_folder_of_pix4d(tmp_path):
    again = PIX4D_CAMERAS.split("\n\n")[1].replace("IMG 1", "IMG 2")
    ((name, camera),) = read_pix4d_cameras(saved(tmp_path, PIX4D_CAMERAS + again)).items()
    assert name == "IMG 1.JPG"
    assert (camera.columns, camera.rows, camera.focal_length_px) == (100, 80, 200.0)
    assert camera.principal_point_px == (1.5, 1.0)
    assert camera.additional_parameters == {"brown-forward:k1": 0.1, "brown-forward:p2": 0.001}
    with pytest.raises(InputError, match="cut off"):
        read_pix4d_cameras(saved(tmp_path, PIX4D_CAMERAS + again[:60]))


def test_a_database_of_colmap(tmp_path):
    path = saved(tmp_path, small.colmap_database())
    (camera,) = read_colmap_database_cameras(path).values()
    assert (camera.columns, camera.focal_length_px, camera.principal_point_px) == (100, 201.0, (0.0, 0.0))
    points = read_colmap_database_image_points(path)
    rows = sorted(zip(points.point.to_pylist(), points.image.to_pylist(), points.xy.tolist(), strict=True))
    assert rows == [
        ("tie1", "a.tif", [10.0, 0.5]), ("tie1", "b.tif", [20.0, 0.5]),
        ("tie2", "a.tif", [11.0, 1.5]), ("tie2", "b.tif", [21.0, 1.5]), ("tie2", "c.tif", [32.0, 2.5]),
    ]  # fmt: skip
    exposures = read_colmap_database_exposures(path, ORDER)
    assert exposures.image.to_pylist() == ["b.tif"]
    assert exposures.position.tolist() == [[9.25, 48.5, 900.0]]
    np.testing.assert_allclose(exposures.sigma_position, [[0.02, 0.03, 0.05]])
    local = read_colmap_database_exposures(saved(tmp_path, small.colmap_database(1)), ORDER)
    assert local.states.crs == "local"
    assert local.position.tolist() == [[48.5, 9.25, 900.0]]


def test_an_old_database_of_colmap_has_no_priors_and_its_fisheyes_are_named(test_data):
    path = test_data / "format_samples" / "more" / "colmap" / "kapture_t265_rig" / "colmap.db"
    with pytest.raises(InputError, match="no position priors"):
        read_colmap_database_exposures(path, ORDER)
    with pytest.raises(InputError, match="OPENCV_FISHEYE"):
        read_colmap_database_cameras(path)


def test_a_column_that_makes_a_gigabyte_is_refused(tmp_path):
    path = saved(tmp_path, small.colmap_database())
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(
            "DROP TABLE images; CREATE TABLE images (image_id INTEGER PRIMARY KEY, camera_id INTEGER, "
            "name AS (zeroblob(400000000))); INSERT INTO images (image_id, camera_id) VALUES (1, 1);"
        )
    with pytest.raises(InputError, match="too big"):
        read_colmap_database_image_points(path)


def test_a_view_without_end_is_no_table(tmp_path):
    path = saved(tmp_path, small.colmap_database())
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(
            "DROP TABLE images; CREATE VIEW images AS WITH RECURSIVE n(image_id) AS (SELECT 1 UNION ALL "
            "SELECT image_id + 1 FROM n) SELECT image_id, 'a' AS name, 1 AS camera_id FROM n;"
        )
    with pytest.raises(InputError, match="no table 'images'"):
        read_colmap_database_image_points(path)
