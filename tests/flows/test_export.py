"""``aerocal export``: what is written leads to the ground that the adjustment sees (each file read anew)."""

from __future__ import annotations

import csv
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from _pytest.mark import ParameterSet

from adjust.arrays import Floats
from adjust.geometry.rotation import from_omega_phi_kappa, from_phi_omega_kappa
from adjust.handover.cartesian_map import EARTH_RADIUS_M, CartesianMap, Pose, on_ground
from adjust.handover.rational import RationalPolynomials
from flows.command.export_execution import write_export
from flows.runs.project_run import RunRequest, carry_out
from tasks.errors import InputError
from tasks.formats.colmap import read_colmap_image_points
from tasks.handover.export import export_results
from tasks.handover.formats.patb import numbers_of_names
from tasks.handover.formats.register import REGISTER
from tasks.handover.results import Results, read_results
from tasks.settings.deliver import World
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.command_line import aerocal
from tests.flows.adjustment_alone import adjustment_alone
from tests.tasks.handover.test_read_back import READ, WITH_THEIR_GROUND, WITHOUT_ORIENTATIONS

SMALLER = (
    "project.crs=EPSG:25832",
    "project.latitude_deg=48",
    "project.longitude_deg=11.5",
    "flight.0.lines=2",
    "flight.0.exposures=4",
    "points.count=300",
    "terrain.mean_m=400",
    "terrain.relief_m=30",
    "truth.refraction=true",
)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small adjusted block in UTM, refraction corrected."""
    folder = tmp_path_factory.mktemp("block")
    project = simulate_project(load_simulation("uce-high", SMALLER), folder / "b").project_file
    outcome = carry_out(adjustment_alone, RunRequest(project, folder / "results"))
    assert outcome.error is None, outcome.error
    return folder / "results"


@pytest.fixture(scope="module")
def block(results: Path) -> Results:
    """The results as they are read for an export."""
    return read_results(results)


def eo_csv(text: str, order: str = "omega-phi-kappa", unit: str = "deg") -> tuple[Floats, Floats]:
    rows = list(csv.DictReader(text.splitlines()))
    factor = {"deg": np.pi / 180.0, "gon": np.pi / 200.0, "rad": 1.0}[unit]
    centre = np.array([[float(row[f"{axis}_m"]) for axis in "xyz"] for row in rows])
    names = ("omega", "phi", "kappa")
    angles = np.array([[float(row[f"{name}_{unit}"]) for name in names] for row in rows]) * factor
    turn = from_omega_phi_kappa if order == "omega-phi-kappa" else from_phi_omega_kappa
    return centre, turn(angles)


def patb(text: str) -> tuple[Floats, Floats]:
    """Records of 4F16, 5F16.12, 4F16.12 in fixed columns."""
    lines = text.splitlines()
    cells = [[float(line[k : k + 16]) for k in range(0, len(line), 16)] for line in lines]
    centre = [row[2:5] for row in cells[0::3]]
    matrix = [[*two, *three] for two, three in zip(cells[1::3], cells[2::3], strict=True)]
    return np.array(centre), np.array(matrix).reshape(-1, 3, 3)


def esri(text: str) -> tuple[Floats, Floats]:
    rows = list(csv.DictReader(text.splitlines()))
    centre = np.array([[float(row[f"Perspective{axis}"]) for axis in "XYZ"] for row in rows])
    angles = np.deg2rad([[float(row[name]) for name in ("Omega", "Phi", "Kappa")] for row in rows])
    return centre, from_omega_phi_kappa(angles)


def orbit(text: str) -> tuple[Floats, Floats]:
    rows = list(csv.reader(text.splitlines()))[1:]
    numbers = np.array([[float(cell) for cell in row[1:]] for row in rows])
    return numbers[:, :3], from_omega_phi_kappa(np.deg2rad(numbers[:, 3:]))


def metashape(text: str) -> tuple[Floats, Floats]:
    """By its matrix, which leads from the object into the image."""
    numbers = np.array([[float(cell) for cell in line.split("\t")[1:]] for line in text.splitlines()[2:]])
    np.testing.assert_allclose(
        from_omega_phi_kappa(np.deg2rad(numbers[:, 3:6])),
        np.swapaxes(numbers[:, 6:].reshape(-1, 3, 3), 1, 2),
        atol=2e-9,
    )
    return numbers[:, :3], np.swapaxes(numbers[:, 6:].reshape(-1, 3, 3), 1, 2)


def inpho(text: str) -> tuple[Floats, Floats]:
    """The four lines after each $EXT_ORI: c X Y Z, then the matrix into the image."""
    lines = text.splitlines()
    starts = [k for k, line in enumerate(lines) if "$EXT_ORI" in line]
    head = np.array([[float(cell) for cell in lines[k + 1].split()] for k in starts])
    matrix = np.array([[[float(c) for c in lines[k + i].split()] for i in (2, 3, 4)] for k in starts])
    return head[:, 1:], np.swapaxes(matrix, 1, 2)


def isat(text: str) -> tuple[Floats, Floats]:
    rows = [line.split(":")[1].split() for line in text.splitlines() if "EO_parameters" in line]
    numbers = np.array(rows, dtype=np.float64)
    return numbers[:, :3], from_omega_phi_kappa(np.deg2rad(numbers[:, 3:]))


READERS: dict[str, tuple[str, Callable[[str], tuple[Floats, Floats]]]] = {
    "eo-csv": ("eo.csv", eo_csv),
    "patb": ("patb.ori", patb),
    "esri": ("frames.csv", esri),
    "orbit": ("orbit.csv", orbit),
    "metashape": ("metashape_opk.txt", metashape),
    "inpho": ("inpho.prj", inpho),
    "isat": ("photo", isat),
}


#: Both orders and the units that are no default.
QUICK_ANGLES = {("omega-phi-kappa", "rad"), ("phi-omega-kappa", "gon")}


def cases(*worlds: World) -> list[ParameterSet]:
    """Every format with the kinds of programs it can be written for, of these.

    What a kind of program is given does not depend on the format: after the first one, two formats are quick.
    """
    found = []
    for name in READERS:
        own = [world for world in worlds if world in REGISTER[name].worlds]
        quick = own if name in ("eo-csv", "inpho") else own[:1]
        found += [
            pytest.param(name, world, marks=() if world in quick else pytest.mark.slow) for world in own
        ]
    return found


def sampled(block: Results, heights: tuple[float, ...] = (370.0, 400.0, 430.0)) -> tuple[Floats, Floats]:
    grid = block.images.grid_of_image_points(5)
    level = np.repeat(heights, grid.shape[1])
    return np.tile(grid, (1, len(heights), 1)), np.tile(level, (len(grid), 1))


def focal_length(folder: Path, block: Results) -> Floats:
    """The one a user is told to enter."""
    c = block.images.focal_length[block.images.camera]
    for name, key in (("inpho.prj", "$FOCAL_LENGTH"), ("camera", "focal_length")):
        if (folder / name).is_file():
            (line,) = (line for line in (folder / name).read_text().splitlines() if key in line)
            c = np.full(len(c), float(line.split(":")[1]) * 1e-3)
    if (folder / "cameras.csv").is_file():
        row = next(csv.DictReader((folder / "cameras.csv").read_text().splitlines()))
        c = np.full(len(c), float(row["FocalLength"]) * 1e-6)
    return c


@pytest.mark.parametrize(("name", "world"), cases("map-cartesian", "map-cartesian-curved"))
def test_a_program_that_takes_the_map_as_cartesian_sees_the_same_ground(
    results: Path, block: Results, tmp_path: Path, name: str, world: str
) -> None:
    written, (file, read) = export_results(results, name, tmp_path, world), READERS[name]
    centre, rotation = read((tmp_path / file).read_text())
    c = focal_length(tmp_path, block)
    model = CartesianMap(EARTH_RADIUS_M if world.endswith("curved") else None)
    ideal, height = sampled(block)
    ground = on_ground(model, Pose(centre, rotation, c, np.zeros(len(c))), ideal, height)
    away = np.linalg.norm((ground - block.images.ground(ideal, height))[..., :2], axis=-1).max()
    pixel_m = float(block.images.pixel_size[0] / c[0] * (centre[:, 2] - 400.0).max())
    # In the corner the ray is oblique; what the program's model cannot do was said.
    assert away < 1.5 * written.misfit_px * pixel_m + 0.002
    assert written.misfit_px < 1.0
    true, _ = eo_csv((tmp_path / "eo_rigorous.csv").read_text())
    np.testing.assert_allclose(true, block.images.map_pose.centre, atol=6e-5)


@pytest.mark.parametrize(("name", "world"), cases("map", "local"))
def test_true_orientations_are_written_to_less_than_a_millimetre(
    results: Path, block: Results, tmp_path: Path, name: str, world: str
) -> None:
    written = export_results(results, name, tmp_path, world)
    images, (file, read) = block.images, READERS[name]
    centre, rotation = read((tmp_path / file).read_text())
    if world == "local":
        expected = images.projection_centre, images.local_from_camera
    else:
        expected = images.map_pose.centre, images.map_pose.map_from_camera
    np.testing.assert_allclose(centre, expected[0], atol=6e-5)
    # 1e-9 rad are 0.002 mm from 2 km.
    np.testing.assert_allclose(rotation, expected[1], atol=2e-9)
    assert "Nothing is approximated" in written.statement
    assert not (tmp_path / "eo_rigorous.csv").exists()


@pytest.mark.parametrize(
    ("order", "unit"),
    [
        pytest.param(order, unit, marks=() if (order, unit) in QUICK_ANGLES else pytest.mark.slow)
        for order in ("omega-phi-kappa", "phi-omega-kappa")
        for unit in ("deg", "gon", "rad")
    ],
)
def test_any_angle_system(results: Path, block: Results, tmp_path: Path, order: str, unit: str) -> None:
    write_export(results, "eo-csv", tmp_path, None, order, unit, force=False)
    _, rotation = eo_csv((tmp_path / "eo.csv").read_text(), order, unit)
    np.testing.assert_allclose(rotation, block.images.map_pose.map_from_camera, atol=2e-9)


def test_rational_polynomials_lead_to_the_measured_pixel(
    results: Path, block: Results, tmp_path: Path
) -> None:
    export_results(results, "rpc", tmp_path)
    ideal, height = sampled(block)
    ground = block.images.ground(ideal, height)
    for k, name in enumerate(block.images.names):
        values = dict(line.split(": ") for line in (tmp_path / f"{name}_RPC.TXT").read_text().splitlines())
        image, earth = ("LINE", "SAMP"), ("LAT", "LONG", "HEIGHT")
        coefficients = {
            part: np.array([[float(values[f"{a}_{part}_COEFF_{i + 1}"]) for i in range(20)] for a in image])
            for part in ("NUM", "DEN")
        }
        one = RationalPolynomials(
            *(np.array([float(values[f"{a}_{what}"]) for a in image]) for what in ("OFF", "SCALE")),
            *(np.array([float(values[f"{a}_{what}"]) for a in earth]) for what in ("OFF", "SCALE")),
            coefficients["NUM"],
            coefficients["DEN"],
        )
        geodetic = block.images.map_frame.to_geodetic(ground[k])
        geodetic[:, :2] = np.rad2deg(geodetic[:, :2])
        camera = block.cameras[0].frame
        column = ideal[k, :, 0] / camera.pixel_size + 0.5 * (camera.columns - 1)
        row = 0.5 * (camera.rows - 1) - ideal[k, :, 1] / camera.pixel_size
        assert np.abs(one.project(geodetic) - np.column_stack([row, column])).max() < 0.002


def test_the_statement_says_what_the_user_must_set(results: Path, block: Results, tmp_path: Path) -> None:
    text = " ".join(export_results(results, "patb", tmp_path).statement.split())
    assert text.startswith(f"{block.name}: ")
    for words in ("switched OFF", "NO LONGER camera positions", "eo_rigorous.csv", "not yet validated"):
        assert words in text
    assert " ".join((tmp_path / "HANDOVER.txt").read_text().split()).startswith(f"{text} SHA-256 of")
    assert "Refraction of the standard atmosphere is contained" in text


def test_points_of_the_block_go_along_but_rejected_ones(results: Path, tmp_path: Path) -> None:
    copy = tmp_path / "results"
    shutil.copytree(results, copy, ignore=shutil.ignore_patterns(".store"))
    table = pq.read_table(copy / "residuals.parquet")
    rows = table.to_pandas()
    of_image_points = rows.index[rows["group"] == "image_points"]
    bad = rows.loc[of_image_points[0]]
    rows.loc[of_image_points[0], "status"] = "rejected"
    changed = table.set_column(
        table.schema.get_field_index("status"), "status", pa.array(rows["status"], pa.string())
    )
    (copy / "residuals.parquet").unlink()
    pq.write_table(changed, copy / "residuals.parquet")
    written = export_results(copy, "colmap")
    read = read_colmap_image_points(written.folder / "images.txt")
    names = dict(line.split(",")[:2] for line in (written.folder / "points.csv").read_text().splitlines()[1:])
    found = {
        (image, names[point]): xy
        for image, point, xy in zip(read.image.to_pylist(), read.point.to_pylist(), read.xy, strict=True)
    }
    given = pq.read_table(copy / "image_points.parquet").to_pandas()
    measured = {(row.image, row.point): (row.x_mm, row.y_mm) for row in given.itertuples(index=False)}
    assert set(measured) - set(found) == {(bad["image"], bad["point"])}
    camera = read_results(copy).cameras[0].frame
    for key, (column, row) in found.items():
        x, y = measured[key]
        assert column == pytest.approx(x * 1e-3 / camera.pixel_size + 0.5 * camera.columns, abs=1e-4)
        assert row == pytest.approx(0.5 * camera.rows - y * 1e-3 / camera.pixel_size, abs=1e-4)
    # The block was adjusted with refraction, which such programs do not know.
    assert "contained in the cameras" in " ".join(written.statement.split())
    assert 0.0 < written.misfit_px < 0.1


def test_differences_at_control_points_are_those_of_the_adjustment(results: Path, tmp_path: Path) -> None:
    export_results(results, "geopackage", tmp_path)
    differences = pq.read_table(results / "control_residuals.parquet").to_pandas().set_index("point")
    with closing(sqlite3.connect(tmp_path / "block.gpkg")) as connection:
        rows = connection.execute("SELECT point, dx_m, dy_m, dz_m FROM control_points").fetchall()
    assert len(rows) == len(differences)
    for point, *difference in rows:
        assert difference == differences.loc[point, ["dx_m", "dy_m", "dz_m"]].tolist()


def test_wrong_words_are_refused_and_nothing_is_written(results: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    for to, world in (("path", None), ("rpc", "local"), ("patb", "rpc"), ("patb", "flat")):
        with pytest.raises(InputError):
            export_results(results, to, out, world)
    with pytest.raises(InputError, match="no results"):
        export_results(tmp_path, "patb", out)
    with pytest.raises(InputError, match="--unit"):
        write_export(results, "eo-csv", out, None, "omega-phi-kappa", "grad", force=False)
    with pytest.raises(InputError, match="--unit: The format patb has its own order and unit of angles"):
        write_export(results, "patb", out, None, "omega-phi-kappa", "gon", force=False)
    assert not out.exists()


def test_a_format_without_results_is_refused_and_none_lists_the_formats() -> None:
    assert aerocal("export", "--to", "patb").returncode == 2
    done = aerocal("export")
    assert done.returncode == 0
    assert all(name in done.stdout for name in REGISTER)


def test_results_are_found_by_any_path(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "link").symlink_to(results)
    (results.parent / "further").mkdir(exist_ok=True)
    monkeypatch.chdir(results.parent / "further")
    written = [
        export_results(path, "colmap", tmp_path / str(number)).folder / "images.txt"
        for number, path in enumerate((results, tmp_path / "link", Path("..") / results.name))
    ]
    assert len({file.read_bytes() for file in written}) == 1


def test_photos_are_numbered_only_where_names_are_no_numbers() -> None:
    assert numbers_of_names(("1001", "1002")) == (["1001", "1002"], False)
    assert numbers_of_names(("0012", "12")) == (["1", "2"], True)
    assert numbers_of_names(("a", "b")) == (["1", "2"], True)


def test_every_format_is_read_back_in_these_tests() -> None:
    assert set(REGISTER) == {*READ, *WITHOUT_ORIENTATIONS, *WITH_THEIR_GROUND}
    assert set(READERS) < set(READ)
