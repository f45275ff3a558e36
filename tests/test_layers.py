"""The three storeys: imports point downwards only."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]


#: The flows and what serves them.
WITH_PREFECT = {"flows/serving/registered.py", "flows/serving/deployed.py", "flows/serving/deployments.py"}


def test_imports_point_downwards_only() -> None:
    command = [str(Path(sys.executable).with_name("lint-imports")), "--no-cache"]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


#: What is imported one after the other, each with the libraries that must not have come along till then.
STEPS = {
    # What a run imports that finds everything stored: the command, the settings, the story with its stages.
    "reuse": (
        ["flows.command.execution", "flows.stories.aerial_triangulation"],
        {"numba", "pandas", "scipy"},
    ),
    "adjustment": (
        [
            *(f"tasks.deliveries.{name}" for name in ("cameras", "exposures", "image_points")),
            *(f"tasks.stages.{name}" for name in ("approximate_values", "bundle_adjustment")),
            "tasks.documents.report.page",
        ],
        {"scipy.stats"},
    ),
    "everything": (
        sorted(
            ".".join(path.relative_to(REPOSITORY).with_suffix("").parts).removesuffix(".__init__")
            for package in ("flows", "tasks", "adjust")
            for path in (REPOSITORY / package).rglob("*.py")
            if path.relative_to(REPOSITORY).as_posix() not in WITH_PREFECT
        ),
        {"prefect"},
    ),
}
_PROGRAM = """\
import importlib, json, sys
found = {{}}
for step, (modules, unwanted) in {steps!r}.items():
    for name in modules:
        importlib.import_module(name)
    found[step] = sorted(unwanted & set(sys.modules))
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def came_along() -> dict[str, list[str]]:
    """The unwanted libraries of each step, in one process for all."""
    command = [sys.executable, "-c", _PROGRAM.format(steps=STEPS)]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found: dict[str, list[str]] = json.loads(done.stdout)
    return found


def test_only_the_flows_and_what_serves_them_import_prefect_when_they_are_imported(
    came_along: dict[str, list[str]],
) -> None:
    """Every other module of ours loads without Prefect coming along."""
    assert came_along["everything"] == []


def test_an_adjustment_does_not_wait_for_all_distributions(came_along: dict[str, list[str]]) -> None:
    """One probability is a function of scipy.special; scipy.stats takes longer than the rest together."""
    assert came_along["adjustment"] == []


def test_a_run_that_finds_everything_stored_loads_nothing_that_computes(
    came_along: dict[str, list[str]],
) -> None:
    assert came_along["reuse"] == []
