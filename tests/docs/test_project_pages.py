"""Version, licence and set-up are stated alike wherever they stand."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
import yaml

REPOSITORY = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_the_citation_names_this_version_and_licence() -> None:
    citation = yaml.safe_load((REPOSITORY / "CITATION.cff").read_text(encoding="utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert (citation["title"], citation["version"]) == (PROJECT["name"], PROJECT["version"])
    assert citation["license"] == PROJECT["license"]


def test_the_changelog_has_a_chapter_for_this_version() -> None:
    changelog = (REPOSITORY / "CHANGELOG.md").read_text(encoding="utf-8")
    versions = re.findall(r"^## (\d+\.\d+\.\d+)", changelog, re.MULTILINE)
    assert versions[0] == PROJECT["version"]


def test_every_make_target_that_contributors_are_told_of_exists() -> None:
    makefile = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([\w-]+):", makefile, re.MULTILINE))
    told = re.findall(r"`make ([\w -]+)`", (REPOSITORY / "CONTRIBUTING.md").read_text(encoding="utf-8"))
    named = {target for command in told for target in command.split()}
    assert named
    assert named <= targets


def test_the_page_on_calibration_has_the_results_that_the_readme_shows() -> None:
    """README's block is held to a run by a slow test; focal length as a change from 80 mm, in µm there."""
    readme = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    page = (REPOSITORY / "docs" / "calibration.md").read_text(encoding="utf-8")
    names = {
        "focal_length": "focal length, change", "principal_point_x": "principal point x",
        "principal_point_y": "principal point y", "boresight_roll": "roll", "boresight_pitch": "pitch",
        "boresight_yaw": "yaw", "gnss_shift_x": "shift east", "gnss_shift_y": "shift north",
        "gnss_shift_z": "shift up",
    }  # fmt: skip
    for name, title in names.items():
        row = re.search(rf"^{name} +\S+ +(\S+) +(\S+) +(\S+) +(\S+)", readme, re.MULTILINE)
        stated = re.search(rf"^\| {title} \| (\S+) \S+ \| (\S+) \S+ \| (\S+) \S+ \|", page, re.MULTILINE)
        assert row is not None, name
        assert stated is not None, title
        found = [float(value) for value in row.groups()[:3]]
        if name == "focal_length":
            found = [1e3 * (found[0] - 80.0), 1e3 * (found[1] - 80.0), 1e3 * found[2]]
        assert [float(value.replace("−", "-")) for value in stated.groups()] == pytest.approx(found, abs=6e-3)
    for figure in (r"χ² = ([\d.]+); 99 %", r"χ² of all nine errors is ([\d.]+)"):
        assert len(re.findall(figure, readme + page)) == 1
    assert re.findall(r"χ² = ([\d.]+); 99", readme) == re.findall(r"nine errors is ([\d.]+)", page)


def test_the_page_on_direct_georeferencing_has_the_differences_that_the_readme_shows() -> None:
    readme = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    page = (REPOSITORY / "docs" / "direct-georeferencing.md").read_text(encoding="utf-8")
    for shown, stated in (("RMS ", "RMS at the independent points"), ("predicted RMS", "predicted")):
        found = re.findall(rf"^{shown} +(0\.\d{{3}}) +(0\.\d{{3}}) +(0\.\d{{3}})$", readme, re.MULTILINE)
        assert len(found) == 1
        assert f"| {stated} | {' m | '.join(found[0])} m |" in page
