"""Corrected image points, adjusted again without refraction, additional parameters and mean residuals: the same result.

What the first adjustment found is in the image points; so the second one, which knows no more than focal length and
principal point, has its minimum in the same place.
"""  # noqa: E501

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from flows.runs.project_run import RunRequest, carry_out
from tasks.handover.export import export_results
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.flows.adjustment_alone import adjustment_alone

#: 16 images with radial errors, shifted CCD images and refraction.
SMALL = (
    "project.crs=EPSG:25832", "project.latitude_deg=48", "project.longitude_deg=9.3",
    "flight.0.exposures=4", "flight.1.exposures=4", "points.count=700", "terrain.mean_m=400",
    "terrain.relief_m=30", "truth.refraction=true", "truth.image_errors.radial_um=8.0",
    "truth.image_errors.tile_um=1.5",
)  # fmt: skip
SETTINGS = (
    'adjustment.free=["focal_length", "principal_point", "boresight", "gnss_shift"]',
    "adjustment.residual_grid.iterations=3", "adjustment.residual_grid.cross_validation=false",
)  # fmt: skip
#: A correction polynomial, and a distortion from the ideal to the measured point.
SETS = {"brown": "brown:K1,K2,P1,P2", "forward": "brown-forward:k1-k2,p1,p2"}
HELD = ("adjustment.refraction=none",)


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("corrected")
    return simulate_project(load_simulation("uce-high", SMALL), folder / "b").project_file


@pytest.fixture(scope="module")
def calibrated(project: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Results with one of the sets, each adjusted once."""
    made: dict[str, Path] = {}

    def results(name: str) -> Path:
        if name not in made:
            made[name] = tmp_path_factory.mktemp(name)
            parameters = f'adjustment.self_calibration.parameters="{SETS[name]}"'
            adjust(project, made[name], *SETTINGS, parameters)
        return made[name]

    return results


def adjust(project: Path, out: Path, *settings: str) -> None:
    outcome = carry_out(adjustment_alone, RunRequest(project, out, settings))
    assert outcome.error is None, outcome.error


def without_distortion(project: Path, written: Path) -> Path:
    """The project file with the written image points and camera."""
    (camera,) = csv.DictReader((written / "cameras.csv").read_text().splitlines())
    text = project.read_text()
    for old, new in (
        ("focal_length_mm = 80.0", f"focal_length_mm = {camera['focal_length_mm']}"),
        ("principal_point_mm = [0.0, 0.0]", f"principal_point_mm = [{camera['x0_mm']}, {camera['y0_mm']}]"),
        ('file = "image_points.csv"', f'file = "{written / "image_points.csv"}"'),
    ):
        assert old in text
        text = text.replace(old, new)
    again = project.with_name("again.toml")
    again.write_text(text)
    return again


def largest_in_sigma(first: Path, second: Path, table: str, key: str, quantities: dict[str, str]) -> float:
    one, other = (pd.read_parquet(folder / table).set_index(key) for folder in (first, second))
    assert set(one.index) == set(other.index)
    other = other.loc[one.index]
    away = [(other[name] - one[name]).abs() / one[sigma] for name, sigma in quantities.items()]
    return float(np.nanmax(np.array(away, dtype=float)))


def names(*quantities: str) -> dict[str, str]:
    return {name: f"sigma_{name}" for name in quantities}


def adjusted_again(project: Path, first: Path, folder: Path) -> float:
    """Largest difference of orientations and points after the corrected image points of a result, in σ."""
    export_results(first, "corrected-csv", folder / "written")
    adjust(without_distortion(project, folder / "written"), folder / "again", *HELD)
    angles = names("omega_deg", "phi_deg", "kappa_deg")
    return max(
        largest_in_sigma(
            first, folder / "again", f"{table}.parquet", key, {**names("x_m", "y_m", "z_m"), **more}
        )
        for table, key, more in (("exterior_orientations", "image", angles), ("object_points", "point", {}))
    )


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == "forward" else pytest.mark.slow) for name in SETS]
)
def test_adjusted_again_the_orientations_and_points_are_the_same(
    name: str, project: Path, calibrated: Callable[[str], Path], tmp_path: Path
) -> None:
    assert adjusted_again(project, calibrated(name), tmp_path) < 0.05


def test_what_is_not_taken_from_the_image_points_is_seen(
    project: Path, calibrated: Callable[[str], Path], tmp_path: Path
) -> None:
    first = tmp_path / "first"
    shutil.copytree(calibrated("brown"), first, ignore=shutil.ignore_patterns(".store"))
    file = first / "residual_grid.parquet"
    table = pq.read_table(file)
    for column in ("correction_x_um", "correction_y_um"):
        index = table.schema.get_field_index(column)
        table = table.set_column(index, table.schema.field(index), pa.nulls(len(table), pa.float64()))
    file.unlink()
    pq.write_table(table, file)
    assert adjusted_again(project, first, tmp_path) > 1.0
