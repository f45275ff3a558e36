"""The calibration of a check in the project file: one text, four meanings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.settings.load import load_project
from tasks.settings.project import Project

Write = Callable[..., Path]
TABLES = ("parameters", "correlations", "control_residuals", "control_points", "cameras")


def project(tmp_path: Path, write_project: Write, text: str) -> Project:
    return load_project(write_project(tmp_path, text))


def test_by_default_the_cameras_are_the_calibration(tmp_path: Path, write_project: Write) -> None:
    found = project(tmp_path, write_project, "").direct_georeferencing.calibration
    assert not found.adjustment
    assert not found.is_of_results


def test_the_own_adjustment_the_registry_and_a_folder_of_results_are_told_apart(
    tmp_path: Path, write_project: Write
) -> None:
    text = '[direct_georeferencing]\ncalibration = "adjustment"\n'
    own = project(tmp_path, write_project, text).direct_georeferencing.calibration
    assert (own.adjustment, own.registry) == (True, False)
    text = '[direct_georeferencing]\ncalibration = "registry"\n'
    registered = project(tmp_path, write_project, text).direct_georeferencing.calibration
    assert (registered.adjustment, registered.registry, registered.is_of_results) == (False, True, False)
    folder = tmp_path / "flight"
    folder.mkdir()
    for name in TABLES:
        (folder / f"{name}.parquet").write_text(name)
    text = '[direct_georeferencing]\ncalibration = "flight"\nstrip_bias_m = 0.03\n'
    found = project(tmp_path, write_project, text)
    assert found.direct_georeferencing.calibration.is_of_results
    assert found.direct_georeferencing.calibration.correlations == folder / "correlations.parquet"
    assert found.direct_georeferencing.strip_bias_m == (0.03, 0.03, 0.03)
    # Files of the calibration are input files: a changed one makes the check run again.
    assert folder / "parameters.parquet" in found.input_files()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('calibration = "nowhere"', "nowhere/parameters.parquet"),
        ("calibration = 3", "The calibration is not valid"),
        ('calibration = { parameters = "project.toml" }', "by only some of its files"),
        ("calibration = { adjustment = true, registry = true }", "or twice"),
        ("calibraton = 3", "Did you mean 'calibration'"),
        ("accuracy_class_m = 0", "accuracy_class_m"),
        ("strip_bias_deg = -1", "strip_bias_deg"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, write_project: Write, text: str, words: str) -> None:
    with pytest.raises(InputError) as error:
        project(tmp_path, write_project, f"[direct_georeferencing]\n{text}\n")
    assert words in str(error.value)
