"""Film images: interior orientation from fiducial marks, from simulated scans to the adjusted block."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adjust.simulate.block import simulate_block
from flows.runs.project_run import RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tasks.settings.load_simulation import load_simulation
from tasks.settings.simulation import Simulation
from tasks.simulation.simulate import film_of, simulate_project
from tasks.simulation.simulation_input import block_specification

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


def run(folder: Path, change: Callable[[Path], None] | None = None) -> Path:
    """Results of the flight as delivered, or after a change of its folder."""
    project = simulate_project(simulation(), folder / "flight").project_file
    if change is not None:
        change(project.parent)
    found = carry_out(aerial_triangulation, RunRequest(project, folder / "out"))
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


def test_uncorrected_scans_contradict_themselves(tmp_path: Path) -> None:
    """What the marks are for: without them shift and deformation of the scans remain."""

    def as_digital(folder: Path) -> None:
        remove_tables(folder / "project.toml", "inputs.fiducials", "cameras.RMK-153.fiducials_mm")

    summary = json.loads((run(tmp_path, as_digital) / "summary.json").read_text())
    assert summary["sigma0"] > 2.0


def test_a_wrong_mark_is_named(tmp_path: Path) -> None:
    def displace(folder: Path) -> None:
        table = pd.read_csv(folder / "fiducials.csv", dtype={"point": str})
        table.loc[(table["image"] == "E01_002") & (table["point"] == "3"), "x"] += 0.03
        table.to_csv(folder / "fiducials.csv", index=False)

    problems = json.loads((run(tmp_path, displace) / "summary.json").read_text())["problems"]
    assert any("the worst is mark 3 in image E01_002" in text for text in problems)


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
