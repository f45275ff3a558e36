"""Film images: interior orientation from fiducial marks, from simulated scans to the adjusted block."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adjust.arrays import Floats
from adjust.simulate.block import simulate_block
from flows.runs.project_run import RunRequest, carry_out
from tasks.errors import InputError
from tasks.handover.export import export_results
from tasks.settings.load_simulation import load_simulation
from tasks.settings.simulation import Simulation
from tasks.simulation.simulate import film_of, simulate_project
from tasks.simulation.simulation_input import block_specification
from tests.command_line import aerocal
from tests.flows.adjustment_alone import adjustment_alone
from tests.tasks.image_files.images import pixels, written

_MM = 1e3
#: Thirty images of film; marks of 1 µm, shrinkage 1e-4, and no errors of the camera.
CHANGES = (
    "flight.0.lines=3",
    "flight.0.exposures=6",
    "flight.1.exposures=6",
    "points.count=700",
    "film.fiducial_um=1.0",
    "truth.focal_length_change_mm=0.0",
    "truth.image_errors={}",
)


def simulation() -> Simulation:
    return load_simulation("vaihingen-rmk-low", CHANGES, 3)


#: A lens with 10 µm of distortion, in a block of 2 µm.
LENS = (
    *CHANGES,
    "noise.image_um=2.0",
    'truth.image_errors.additional_um={"brown:K1"=30.0, "brown:K2"=-20.0}',
)


def run(
    folder: Path, change: Callable[[Path], None] | None = None, described: Simulation | None = None
) -> Path:
    """Results of the flight as delivered, or after a change of its folder."""
    project = simulate_project(described or simulation(), folder / "flight").project_file
    if change is not None:
        change(project.parent)
    found = carry_out(adjustment_alone, RunRequest(project, folder / "out"))
    if found.error is not None:
        raise RuntimeError(str(found.error))
    return found.directory


def remove_tables(project: Path, *names: str) -> None:
    tables = re.split(r"(?m)^(?=\[)", project.read_text())
    kept = [table for table in tables if not any(table.startswith(f"[{name}]") for name in names)]
    assert len(kept) == len(tables) - len(names)
    project.write_text("".join(kept))


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run(tmp_path_factory.mktemp("film"))


def test_shrinkage_and_affine_deformation_are_recovered_within_their_standard_deviations(
    results: Path,
) -> None:
    block = simulate_block(block_specification(simulation()))
    film = film_of(simulation(), block)
    assert film is not None
    table = pd.read_parquet(results / "film_orientations.parquet").set_index("image")
    table = table.loc[list(block.truth.images)]
    found = table[["a0_mm", "a1", "a2", "b0_mm", "b1", "b2"]].to_numpy().reshape(-1, 2, 3)
    true = film.coefficients * np.array([_MM, 1.0, 1.0])
    error = (found - true) / table[["sigma_0_mm", "sigma_1", "sigma_2"]].to_numpy()[:, None]
    assert np.sqrt(np.mean(error**2)) == pytest.approx(1.0, abs=0.15)
    assert np.abs(error).max() < 4.0
    # Shrunk by 100 ppm: in the camera everything is larger.
    scale = np.sqrt(np.linalg.det(found[:, :, 1:]))
    assert scale.mean() - 1.0 == pytest.approx(1e-4, abs=3e-5)
    assert np.all(table["marks"] == 8)
    assert table["sigma0_um"].mean() == pytest.approx(1.0, abs=0.1)


def test_the_block_is_that_of_a_camera_without_film(results: Path) -> None:
    summary = json.loads((results / "summary.json").read_text())
    assert summary["sigma0"] == pytest.approx(1.0, abs=0.05)
    assert any("ppm smaller than the camera states" in text for text in summary["problems"])


@pytest.mark.parametrize(
    ("numbered", "hint"),
    [
        (np.diag([1.0, -1.0]), "the side from which fiducials_mm numbers the marks"),
        (np.array([[0.0, -1.0], [1.0, 0.0]]), "where fiducials_mm begins to number the marks"),
    ],
)
def test_marks_numbered_from_another_side_or_corner_fit_and_are_refused_all_the_same(
    tmp_path: Path, numbered: Floats, hint: str
) -> None:
    def renumber(folder: Path) -> None:
        """The square of the marks is the same, so their residuals say nothing."""
        file = folder / "project.toml"
        head, table = file.read_text().split("fiducials_mm]\n")
        marks, rest = table.split("\n\n", 1)
        numbers = [re.fullmatch(r"(\w+) = \[(.*), (.*)\]", line) for line in marks.splitlines()]
        lines = []
        for one in numbers:
            assert one is not None
            x, y = numbered @ np.array([float(one[2]), float(one[3])])
            lines.append(f"{one[1]} = [{x}, {y}]")
        file.write_text(head + "fiducials_mm]\n" + "\n".join(lines) + "\n\n" + rest)

    with pytest.raises(RuntimeError, match=hint):
        run(tmp_path, renumber)


@pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
def test_a_scan_is_not_resampled_as_if_it_were_the_image_of_the_camera(results: Path, tmp_path: Path) -> None:
    image = pd.read_parquet(results / "film_orientations.parquet")["image"][0]
    scan = written(tmp_path / f"{image}.tif", pixels(1, 30, 30, "uint8"))
    done = aerocal("undistort", results, scan, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert "The camera RMK-153 exposes film" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("form", ["inpho", "colmap", "corrected-csv"])
def test_a_delivery_of_film_says_that_scans_have_an_interior_orientation_of_their_own(
    results: Path, tmp_path: Path, form: str
) -> None:
    text = " ".join(export_results(results, form, tmp_path).statement.split())
    assert "Camera RMK-153 exposes film" in text
    assert "The interior orientation of each scan (film_orientations.parquet of the results) is NOT" in text


def test_rational_polynomials_of_film_are_refused(results: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="differs from scan to scan"):
        export_results(results, "rpc", tmp_path)


def test_uncorrected_scans_contradict_themselves(tmp_path: Path) -> None:
    """What the marks are for: without them shift and deformation of the scans remain.

    Positions that are observed do not let the orientations take up the shifts.
    """

    def as_digital(folder: Path) -> None:
        remove_tables(folder / "project.toml", "inputs.fiducials", "cameras.RMK-153.fiducials_mm")

    everything = (*CHANGES, 'project.observe=["gnss", "ins", "control"]')
    observed = load_simulation("vaihingen-rmk-low", everything, 3)
    summary = json.loads((run(tmp_path, as_digital, observed) / "summary.json").read_text())
    assert summary["sigma0"] > 2.0


def test_a_wrong_mark_is_named(tmp_path: Path) -> None:
    def displace(folder: Path) -> None:
        table = pd.read_csv(folder / "fiducials.csv", dtype={"point": str})
        table.loc[(table["image"] == "E01_002") & (table["point"] == "3"), "x"] += 0.03
        table.to_csv(folder / "fiducials.csv", index=False)

    problems = json.loads((run(tmp_path, displace) / "summary.json").read_text())["problems"]
    assert any("the worst is mark 3 in image E01_002" in text for text in problems)


def with_report(outward_um: Floats, radius_mm: Floats) -> Callable[[Path], None]:
    """The camera as its calibration report states it, with the true distortion to 0.1 µm."""

    def change(folder: Path) -> None:
        project = folder / "project.toml"
        text = project.read_text()
        (marks,) = re.findall(r"(?ms)^\[cameras.RMK-153.fiducials_mm\]\n(.*?)^\n", text)
        (folder / "report.toml").write_text(
            '[camera]\nserial = "145123"\nfocal_length_mm = 153.0\nppa_mm = [0.0, 0.0]\npps_mm = [0.0, 0.0]\n'
            f'principal_point = "pps"\n\n[fiducials_mm]\n{marks}\n[distortion]\nunit = "um"\n'
            f'positive = "outward"\nsigma = 0.03\nradius_mm = {radius_mm.tolist()}\n'
            f"mean = {np.round(outward_um, 1).tolist()}\n"
        )
        remove_tables(project, "cameras.RMK-153.fiducials_mm")
        text = re.sub(r"(?m)^principal_point_mm = .*\n", "", project.read_text())
        project.write_text(re.sub(r"(?m)^focal_length_mm = .*$", 'calibration_report = "report.toml"', text))

    return change


def test_a_calibration_report_removes_the_distortion_of_the_lens(tmp_path: Path) -> None:
    described = load_simulation("vaihingen-rmk-low", LENS, 3)
    (errors,) = simulate_block(block_specification(described)).truth.image_errors
    radius = np.arange(10.0, 161.0, 10.0)
    outward = 1e6 * errors.error(np.column_stack([1e-3 * radius, np.zeros(len(radius))]))[:, 0]
    assert 5.0 < np.abs(outward).max() < 20.0
    results = run(tmp_path / "with", with_report(outward, radius), described)
    summary = json.loads((results / "summary.json").read_text())
    assert summary["sigma0"] == pytest.approx(1.0, abs=0.02)
    assert any("calibration report of 145123" in text for text in summary["problems"])
    without = run(tmp_path / "without", with_report(0.0 * outward, radius), described)
    assert json.loads((without / "summary.json").read_text())["sigma0"] > 1.04


def edited(old: str, new: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        path = folder / "fiducials.csv"
        path.write_text(path.read_text().replace(old, new, 1))

    return change


def cut(folder: Path) -> None:
    path = folder / "fiducials.csv"
    kept = [
        line for line in path.read_text().splitlines() if line[:10] not in {f"E01_001,{n}," for n in "345678"}
    ]
    path.write_text("\n".join(kept) + "\n")


def without_image(folder: Path) -> None:
    path = folder / "fiducials.csv"
    kept = [line for line in path.read_text().splitlines() if not line.startswith("E01_001,")]
    path.write_text("\n".join(kept) + "\n")


def undeclared(folder: Path) -> None:
    remove_tables(folder / "project.toml", "inputs.fiducials")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (edited("E01_001,2,", "E01_001,20,"), "has no fiducial mark '20'"),
        (edited("E01_001,2,", "E01_001,1,"), "measured twice in this image"),
        (edited("E01_001,2,", "X99,2,"), "There is no exposure of this image"),
        (cut, "fewer than 3 measured fiducial marks"),
        (without_image, "has no measured fiducial marks"),
        (undeclared, "has fiducial marks, but no measured ones are delivered"),
    ],
)
def test_bad_deliveries_of_marks_are_refused(
    tmp_path: Path, change: Callable[[Path], None], words: str
) -> None:
    with pytest.raises(RuntimeError, match=words):
        run(tmp_path, change)
