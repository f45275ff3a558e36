"""What is written for another program and read again is the same block, to the digits that are printed."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adjust.camera.additional.selection import NOTHING
from adjust.camera.interior import FrameCamera
from adjust.geometry.rotation import from_omega_phi_kappa, from_phi_omega_kappa
from adjust.handover.refit import Freed
from tasks.block.self_calibration import additional_parameters_of
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import local_frame
from tasks.formats.records import ExposureRecords
from tasks.formats.register import CAMERA_FORMATS, read_exposures
from tasks.formats.table_layout import TableLayout
from tasks.handover.delivery import Angles, Delivery
from tasks.handover.formats.register import REGISTER
from tasks.handover.receiver import hand_over
from tasks.handover.results import CalibratedCamera, Results
from tasks.handover.rigorous import OrientedImages
from tasks.settings.coordinates import ELLIPSOIDAL

NAMES = ("1 a.tif", "0002", "III_3", "4")
ELSEWHERE = ("camera", "strip")
_OPK = {"omega": "Omega", "phi": "Phi", "kappa": "Kappa"}
#: Format of a delivery → file, format and layout with which it is read.
READ = {
    "patb": ("patb.ori", "patb", TableLayout()),
    "bingo": ("itera.dat", "bingo", TableLayout()),
    "catalyst": (
        "catalyst_eo.txt", "csv",
        TableLayout(
            separator="blank", header=False,
            columns={"image": 1, "x": 2, "y": 3, "z": 4, "omega": 5, "phi": 6, "kappa": 7},
            elsewhere=ELSEWHERE,
        ),
    ),
    "corrected-csv": ("exterior_orientations.csv", "csv", TableLayout()),
    "inpho": ("inpho.prj", "inpho", TableLayout()),
    "isat": ("photo", "isat", TableLayout()),
    "metashape": ("metashape_opk.txt", "metashape-opk", TableLayout()),
    "orbit": (
        "orbit.csv", "csv",
        TableLayout(columns={"image": "Filename", "x": "X/Long", "y": "Y/Lat", **_OPK}, elsewhere=ELSEWHERE),
    ),
    "esri": (
        "frames.csv", "csv",
        TableLayout(
            columns={
                "image": "Raster", "camera": "CameraID", **_OPK,
                **{axis: f"Perspective{axis.upper()}" for axis in "xyz"},
            },
            elsewhere=ELSEWHERE,
        ),
    ),
    "eo-csv": (
        "eo.csv", "csv",
        TableLayout(
            columns={
                **{axis: f"{axis}_m" for axis in "xyz"},
                **{f"s{axis}": f"sigma_{axis}_m" for axis in "xyz"},
                **{name: f"{name}_deg" for name in _OPK},
                **{f"s{name}": f"sigma_{name}_deg" for name in _OPK},
            },
            elsewhere=ELSEWHERE,
        ),
    ),
}  # fmt: skip
#: Formats with an angle system of their own.
SYSTEMS = {"bingo": Angles("phi-omega-kappa", "gon")}
#: Formats that carry their own geometry and no orientations.
WITHOUT_ORIENTATIONS = {"rpc", "kmz", "distortion-grid"}
#: Formats that stand in test_ground_through_files.
WITH_THEIR_GROUND = {
    "colmap", "geopackage", "geojson", "opf", "opensfm", "openmvg", "nerfstudio", "blocks-exchange",
    "metashape-xml", "orthority", "realityscan", "stac", "sure",
}  # fmt: skip


@pytest.fixture(scope="module")
def block() -> Results:
    rng = np.random.default_rng(17)
    n = len(NAMES)
    cameras = tuple(
        CalibratedCamera(
            FrameCamera(name, 1000, 800, 5e-6, c, (1e-5, -2e-5), "corner", 0),
            additional_parameters_of(name, NOTHING, None, 0),
            np.zeros(0),
        )
        for name, c in (("UC A", 0.1), ("B", 0.07))
    )
    place = MapFrame("local", ELLIPSOIDAL)
    centre = rng.uniform(-1e3, 1e3, (n, 3)) + np.array([0.0, 0.0, 2000.0])
    # One straight down at κ = 180°, one oblique.
    angles = np.array([[0.0, 0.0, np.pi], [0.7, -0.6, -2.0], *rng.uniform(-0.1, 0.1, (n - 2, 3))])
    images = OrientedImages(
        NAMES, np.array([0, 1, 0, 1]), place, local_frame(place, centre), centre,
        from_omega_phi_kappa(angles),
        np.array([0.1, 0.07]), np.array([c.frame.half_format for c in cameras]), np.array([5e-6, 5e-6]),
    )  # fmt: skip
    quantities = ("x_m", "y_m", "z_m", "omega_deg", "phi_deg", "kappa_deg")
    table = pd.DataFrame({f"sigma_{name}": rng.uniform(0.001, 0.1, n) for name in quantities})
    return Results(images, cameras, table, ("s1", "s1", "s 2", ""), np.full((n, 3), 400.0), "test")


def read_back(block: Results, name: str, folder: Path, angles: Angles | None = None) -> ExposureRecords:
    form = REGISTER[name]
    delivery = Delivery(block, hand_over(block, "local", Freed()), angles or Angles())
    for file, text in form.write(delivery).items():
        (folder / file).write_text(text, encoding="utf-8", newline="")
    file, reader, layout = READ[name]
    return read_exposures(reader, folder / file, SYSTEMS.get(name, angles or Angles()).order, layout)


def test_every_format_with_orientations_is_read_back():
    assert set(READ) == set(REGISTER) - WITHOUT_ORIENTATIONS - WITH_THEIR_GROUND


@pytest.mark.parametrize("name", READ)
def test_orientations_are_the_same_to_the_printed_digits(block, name, tmp_path):
    records = read_back(block, name, tmp_path)
    np.testing.assert_allclose(records.position, block.images.projection_centre, rtol=0, atol=0.6e-4)
    if name in SYSTEMS:
        read = from_phi_omega_kappa(records.angles * np.pi / 200.0)
    else:
        read = from_omega_phi_kappa(np.deg2rad(records.angles))
    # 1e-7 degrees are 1.7e-9.
    np.testing.assert_allclose(read, block.images.local_from_camera, rtol=0, atol=3e-9)
    expected = ["1", "2", "3", "4"] if name == "patb" else list(NAMES)
    if name in ("isat", "bingo", "catalyst"):
        # Their names end at a blank.
        expected = [one.replace(" ", "_") for one in expected]
    assert records.image.to_pylist() == expected


@pytest.mark.parametrize("name", ["inpho", "isat", "esri", "eo-csv"])
def test_cameras_are_named_as_they_were(block, name, tmp_path):
    camera = read_back(block, name, tmp_path).camera.to_pylist()
    expected = ["UC_A" if name == "isat" else "UC A", "B"]
    assert camera == expected * 2


def test_phi_omega_kappa_in_gon_is_read_back_from_a_table(block, tmp_path):
    wanted = Angles("phi-omega-kappa", "gon")
    names = {name: f"{name}_gon" for name in _OPK}
    _, reader, layout = READ["eo-csv"]
    form = REGISTER["eo-csv"].write(Delivery(block, hand_over(block, "local", Freed()), wanted))
    (tmp_path / "eo.csv").write_text(form["eo.csv"])
    columns = {
        key: value for key, value in layout.columns.items() if key[0] != "s" or key in ("sx", "sy", "sz")
    }
    layout = TableLayout(columns={**columns, **names}, elsewhere=ELSEWHERE)
    records = read_exposures(reader, tmp_path / "eo.csv", wanted.order, layout)
    read = from_phi_omega_kappa(records.angles * np.pi / 200.0)
    np.testing.assert_allclose(read, block.images.local_from_camera, rtol=0, atol=3e-9)


@pytest.mark.parametrize(("name", "file"), [("inpho", "inpho.prj"), ("isat", "camera")])
def test_cameras_are_the_same(block, name, file, tmp_path):
    read_back(block, name, tmp_path)
    found = CAMERA_FORMATS[name](tmp_path / file)
    for camera, (read_name, read) in zip(block.cameras, found.items(), strict=True):
        frame = camera.frame
        assert read_name == (frame.name.replace(" ", "_") if name == "isat" else frame.name)
        assert (read.columns, read.rows) == (frame.columns, frame.rows)
        np.testing.assert_allclose(
            [read.pixel_um, read.focal_length_mm, *read.principal_point_mm],
            [5.0, frame.focal_length * 1e3, 0.01, -0.02],
            atol=1e-6,
        )


def test_blocks_of_inpho_have_the_keys_of_published_ones_in_their_order(block, tmp_path):
    """A camera printed in a public program, and photos of two programs that write for Inpho."""
    read_back(block, "inpho", tmp_path)
    text = (tmp_path / "inpho.prj").read_text(encoding="utf-8")
    keys = re.findall(r"^ *\$(\w+)", text, re.MULTILINE)
    start = keys.index("CAMERA")
    assert keys[start : keys.index("END", start)] == [
        "CAMERA", "TYPE", "BRAND", "KIND", "CCD_INTERIOR_ORIENTATION", "CCD_COLUMNS", "CCD_ROWS",
        "PIXEL_REFERENCE", "FOCAL_LENGTH", "PRINCIPAL_POINT_PPA",
    ]  # fmt: skip
    start = keys.index("PHOTO")
    assert keys[start : keys.index("END", start)] == [
        "PHOTO", "PHOTO_NUM", "PHOTO_FILE", "CAMERA_ID", "TERRAIN_HEIGHT", "IO_STAT", "ORI_STAT", "EXT_ORI",
    ]  # fmt: skip
    assert len(re.findall(r"\$EXT_ORI : \d\d:\d\d:\d\d \d\d/\d\d/\d{4}$", text, re.MULTILINE)) == 4


def test_the_reference_table_of_metashape_has_positions_angles_and_their_accuracies(block, tmp_path):
    read_back(block, "metashape", tmp_path)
    columns = {
        "image": 1, **{name: k for k, name in enumerate(("x", "y", "z", "sx", "sy", "sz"), 2)},
        **{name: k for k, name in enumerate((*_OPK, *(f"s{name}" for name in _OPK)), 8)},
    }  # fmt: skip
    layout = TableLayout(columns=columns, elsewhere=("camera", "strip"))
    records = read_exposures("csv", tmp_path / "metashape_reference.csv", "omega-phi-kappa", layout)
    np.testing.assert_allclose(records.position, block.images.projection_centre, rtol=0, atol=0.6e-4)
    read = from_omega_phi_kappa(np.deg2rad(records.angles))
    np.testing.assert_allclose(read, block.images.local_from_camera, rtol=0, atol=3e-9)
    table = block.orientations.to_numpy(float)
    np.testing.assert_allclose(records.sigma_position, table[:, :3], atol=0.6e-4)
    np.testing.assert_allclose(records.sigma_angles, table[:, 3:], atol=1e-7)


@pytest.mark.parametrize("name", ["eo-csv", "corrected-csv", "metashape"])
def test_standard_deviations_that_are_not_known_are_empty(block, name, tmp_path):
    """Of a block that is converted without adjustment, some images have no attitude or no position."""
    sigmas = block.orientations.copy()
    sigmas.iloc[1, 3:] = np.nan
    sigmas.iloc[2] = np.nan
    unknown = replace(block, orientations=sigmas)
    records = read_back(unknown, name, tmp_path)
    assert not any("nan" in file.read_text() for file in tmp_path.iterdir())
    if name != "metashape":
        np.testing.assert_allclose(
            np.hstack([records.sigma_position, records.sigma_angles]), sigmas.to_numpy(float), atol=0.6e-4
        )


def test_standard_deviations_are_the_same(block, tmp_path):
    for name in ("isat", "eo-csv"):
        records = read_back(block, name, tmp_path)
        table = block.orientations.to_numpy(float)
        np.testing.assert_allclose(records.sigma_position, table[:, :3], atol=0.6e-4)
        np.testing.assert_allclose(records.sigma_angles, table[:, 3:], atol=1e-7)
