"""Blocks of other programs: their own object points fall onto their own image points through what is read."""

from __future__ import annotations

import json
import struct
from dataclasses import replace

import numpy as np
import pytest

from adjust.geometry.earth import ecef_from_enu, ecef_from_geodetic
from adjust.geometry.rotation import from_omega_phi_kappa, ned_from_body, to_omega_phi_kappa
from tasks.errors import InputError
from tasks.formats.colmap import read_colmap_cameras, read_colmap_exposures, read_colmap_image_points
from tasks.formats.earth_poses import WGS84
from tasks.formats.metashape import read_metashape_cameras, read_metashape_exposures
from tasks.formats.opensfm import (
    read_odm_control,
    read_odm_measurements,
    read_opensfm_cameras,
    read_opensfm_exposures,
    read_opensfm_tracks,
)

ORDER = "omega-phi-kappa"
NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@pytest.fixture(scope="module")
def more(test_data):
    return test_data / "format_samples" / "more"


def residuals_px(exposures, camera, points, objects, scale=None):
    """Measured less computed (n, 2), pixels from the middle of the image, x right, y up.

    `scale` turns what is measured into such pixels; None: it is pixels from the corner.
    """
    row = {name: k for k, name in enumerate(exposures.image.to_pylist())}
    k = np.array([row[name] for name in points.image.to_pylist()])
    place = np.array([objects[name] for name in points.point.to_pylist()])
    rotation = from_omega_phi_kappa(np.radians(exposures.angles))[k]
    x, y, z = np.einsum("nji,nj->ni", rotation, place - exposures.position[k]).T
    u, v = x / -z, -y / -z
    known = {name.split(":")[1]: value for name, value in camera.additional_parameters.items()}
    square = u * u + v * v
    radial = 1 + sum(known.get(f"k{power}", 0.0) * square**power for power in (1, 2, 3, 4))
    p1, p2 = known.get("p1", 0), known.get("p2", 0)
    u, v = (
        u * radial + 2 * p1 * u * v + p2 * (square + 2 * u * u),
        v * radial + p1 * (square + 2 * v * v) + 2 * p2 * u * v,
    )
    c, (x0, y0) = camera.focal_length_px, camera.principal_point_px
    computed = np.column_stack([x0 + c * (u * (1 + known.get("b1", 0)) + known.get("b2", 0) * v), y0 - c * v])
    if scale is None:
        half = 0.5 * np.array([camera.columns, camera.rows])
        return (points.xy - half) * [1.0, -1.0] - computed
    return points.xy * scale - computed


def binary_points(path):
    content = path.read_bytes()
    (count,), at, found = struct.unpack_from("<Q", content), 8, {}
    for _ in range(count):
        number, *xyz = struct.unpack_from("<Q3d", content, at)
        (length,) = struct.unpack_from("<Q", content, at + 43)
        found[str(number)], at = xyz, at + 51 + 8 * length
    assert at == len(content)
    return found


def test_a_binary_model_of_colmap_sees_its_own_points(more):
    folder = more / "colmap" / "sbcv_sceaux_bin"
    exposures = read_colmap_exposures(folder / "images.bin", ORDER)
    points = read_colmap_image_points(folder / "images.bin")
    (camera,) = read_colmap_cameras(folder / "cameras.bin").values()
    objects = binary_points(folder / "points3D.bin")
    assert len(exposures.image) == 11
    assert len(objects) == 7862
    away = residuals_px(exposures, camera, points, objects)
    # COLMAP's own mean error of these points is some half a pixel.
    assert np.sqrt((away**2).sum(axis=1).mean()) < 1.0
    assert np.abs(away.mean(axis=0)).max() < 0.02


def test_a_text_model_of_colmap_sees_its_own_points(more):
    folder = more / "colmap" / "kapture_maupertuis_txt"
    exposures = read_colmap_exposures(folder / "images.txt", ORDER)
    points = read_colmap_image_points(folder / "images.txt")
    camera = read_colmap_cameras(folder / "cameras.txt")["1"]
    rows = [line.split() for line in (folder / "points3D.txt").read_text().splitlines() if line[0] != "#"]
    objects = {row[0]: [float(value) for value in row[1:4]] for row in rows}
    assert (
        exposures.image.to_pylist() == ["04.jpg", "03.jpg", "01.jpg", "00.jpg"] or len(exposures.image) == 4
    )
    assert (camera.columns, camera.rows, camera.focal_length_px) == (1919, 1079, 1847.53)
    away = residuals_px(exposures, camera, points, objects)
    # Distortion was not estimated in this model (SIMPLE_PINHOLE).
    assert np.sqrt((away**2).sum(axis=1).mean()) < 2.0


def test_a_fisheye_of_colmap_is_refused_and_named(more):
    with pytest.raises(InputError, match="OPENCV_FISHEYE"):
        read_colmap_cameras(more / "colmap" / "kapture_t265_rig" / "cameras.txt")


def test_text_and_binary_models_of_colmap_are_the_same(more, tmp_path):
    folder = more / "colmap" / "sbcv_sceaux_bin"
    exposures = read_colmap_exposures(folder / "images.bin", ORDER)
    points = read_colmap_image_points(folder / "images.bin")
    lines, content = ["# made from the binary file"], (folder / "images.bin").read_bytes()
    (count,), at = struct.unpack_from("<Q", content), 8
    for _ in range(count):
        number, *pose, camera = struct.unpack_from("<I7dI", content, at)
        end = content.index(b"\0", at + 64)
        (size,) = struct.unpack_from("<Q", content, end + 1)
        name, at = content[at + 64 : end].decode(), end + 9
        lines.append(" ".join([str(number), *map(repr, pose), str(camera), name]))
        seen = [struct.unpack_from("<ddQ", content, at + 24 * k) for k in range(size)]
        lines.append(" ".join(f"{x!r} {y!r} {-1 if p == 2**64 - 1 else p}" for x, y, p in seen))
        at += 24 * size
    path = tmp_path / "images.txt"
    path.write_text("\n".join(lines) + "\n")
    again, points_again = read_colmap_exposures(path, ORDER), read_colmap_image_points(path)
    np.testing.assert_array_equal(again.position, exposures.position)
    np.testing.assert_array_equal(points_again.xy, points.xy)
    assert points_again.point.to_pylist() == points.point.to_pylist()


def test_a_reconstruction_of_opensfm_sees_its_own_points(more):
    folder = more / "opensfm" / "berlin"
    path = folder / "reconstruction_example.json"
    (given,) = json.loads(path.read_text())
    exposures, cameras = read_opensfm_exposures(path, ORDER), read_opensfm_cameras(path)
    (camera,) = cameras.values()
    assert exposures.image.to_pylist() == list(given["shots"])
    points = read_opensfm_tracks(folder / "tracks_example.csv")
    seen = np.isin(points.point.to_pylist(), list(given["points"]))
    kept = type(points)(
        points.file, points.image.filter(seen), points.point.filter(seen), points.xy[seen],
        points.sigma[seen], points.line[seen],
    )  # fmt: skip

    # Geographic positions and true north are brought back to the earth, and so are the object points.
    def ecef(place):
        return ecef_from_geodetic(
            WGS84, np.column_stack([np.radians(place[:, 1]), np.radians(place[:, 0]), place[:, 2]])
        )

    place = given["reference_lla"]
    origin = np.array([[place["longitude"], place["latitude"], place["altitude"]]])
    axes = ecef_from_enu(*np.radians(origin[0, 1::-1]))
    objects = {
        name: ecef(origin)[0] + axes @ np.array(p["coordinates"]) for name, p in given["points"].items()
    }
    turned = [
        ecef_from_enu(*np.radians(position[1::-1])) @ from_omega_phi_kappa(np.radians(angles))
        for position, angles in zip(exposures.position, exposures.angles, strict=True)
    ]
    geocentric = replace(
        exposures, position=ecef(exposures.position), angles=np.degrees(to_omega_phi_kappa(np.array(turned)))
    )
    away = residuals_px(geocentric, camera, kept, objects, scale=max(camera.columns, camera.rows))
    rms = np.sqrt((away**2).sum(axis=1).mean())
    assert rms < 3.0
    assert np.abs(away.mean(axis=0)).max() < 0.3


def test_the_camera_of_metashape_stands_where_its_gnss_says(more):
    """s R x + t by PROJ (EPSG:4978 to 4979), which is 4 cm from the GNSS reference in the file."""
    path = more / "metashape" / "geograypher_M3M_excerpt.xml"
    exposures = read_metashape_exposures(path, ORDER)
    np.testing.assert_allclose(
        exposures.position[0], [-120.41798590724954, 39.41191730272552, 2420.100578], rtol=0, atol=1e-6
    )
    metres = np.array([np.cos(np.radians(39.41)) * 111_320.0, 111_000.0, 1.0])
    away = (exposures.position[0] - [-120.417985477, 39.41191747, 2420.109]) * metres
    assert np.linalg.norm(away) < 0.05
    # A camera whose image top points forward, as a drone knows its attitude: T = R_z(90°).
    body = NED @ ned_from_body(np.radians([179.9, 0.1, 0.0]))
    image = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    turn = from_omega_phi_kappa(np.radians(exposures.angles[0])).T @ body @ image
    assert np.degrees(np.arccos((np.trace(turn) - 1.0) / 2.0)) < 3.0
    assert exposures.states.reference == "true-north"


def test_the_sensor_of_metashape_is_read_with_its_distortion(more):
    ((name, camera),) = read_metashape_cameras(more / "metashape" / "geograypher_M3M_excerpt.xml").items()
    assert name == "M3M (12.29mm)"
    assert (camera.columns, camera.rows, camera.pixel_um) == (5280, 3956, 3.3582)
    assert camera.focal_length_mm == pytest.approx(3705.4728792737214 * 3.3582e-3)
    assert camera.principal_point_mm == pytest.approx((11.6738523909 * 3.3582e-3, 27.7497969199 * 3.3582e-3))
    assert camera.additional_parameters == pytest.approx(
        {
            "brown-forward:k1": -0.0919367147, "brown-forward:k2": -0.0762807468,
            "brown-forward:k3": 0.1162639394, "brown-forward:k4": -0.0761413904,
            "brown-forward:p2": -0.0003134847, "brown-forward:p1": 0.0001164035,
            "brown-forward:b1": 0.5262024073 / 3705.4728792737214,
            "brown-forward:b2": -0.3058334293 / 3705.4728792737214,
        }
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "crs", "points", "marks"),
    [
        ("copr", "+proj=utm +zone=11 +ellps=WGS84 +datum=WGS84 +units=m +no_defs", None, None),
        ("bellus", "+proj=utm +zone=17 +datum=WGS84", 4, 4),
        ("boruszyn", "EPSG:2180", None, None),
    ],
)
def test_the_three_ways_to_state_a_crs_in_a_gcp_list_are_read(test_data, name, crs, points, marks):
    path = test_data / "format_samples" / "odm_gcp" / f"{name}_gcp_list.txt"
    control, measured = read_odm_control(path), read_odm_measurements(path)
    assert control.states.crs == crs
    rows = [line for line in path.read_text().splitlines()[1:] if line.strip()]
    assert len(measured.image) == len(rows)
    places = {tuple(row.split()[:3]) for row in rows}
    assert len(control.point) == len(places)
    if points is not None:
        assert (len(control.point), len(measured.image)) == (points, marks)
    if name == "copr":
        assert control.point[0].as_py() == "gcp02"
        assert measured.image[0].as_py() == "IMG_0037.jpg"
        assert measured.xy[0].tolist() == [3609.3727839973153, 2293.7951481487607]


def test_a_run_of_odm_has_its_shots_where_its_gps_was(test_data):
    path = test_data / "format_samples" / "opensfm" / "reconstruction.json"
    exposures = read_opensfm_exposures(path, ORDER)
    (given,) = json.loads(path.read_text())
    place = given["reference_lla"]
    east_north = (exposures.position[:, :2] - [place["longitude"], place["latitude"]]) * [
        111_320.0 * np.cos(np.radians(place["latitude"])), 110_760.0,
    ]  # fmt: skip
    gps = np.array([shot["gps_position"] for shot in given["shots"].values()])
    assert np.abs(east_north - gps[:, :2]).max() < 3.0
    assert np.abs(exposures.position[:, 2] - gps[:, 2]).max() < 10.0
    (camera,) = read_opensfm_cameras(path).values()
    assert camera.principal_point_px == pytest.approx(
        (-0.0015460447606643697 * 1368, -0.004751874732641298 * 1368)
    )
