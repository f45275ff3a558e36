"""The three storeys: imports point downwards only."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]


#: The flows and what serves them.
WITH_PREFECT = {"flows/serving/registered.py", "flows/serving/deployed.py", "flows/serving/deployments.py"}


def test_imports_point_downwards_only() -> None:
    command = [str(Path(sys.executable).with_name("lint-imports")), "--no-cache"]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_only_the_flows_and_what_serves_them_import_prefect_when_they_are_imported() -> None:
    """Every other module of ours loads without Prefect coming along."""
    modules = sorted(
        path.relative_to(REPOSITORY).with_suffix("").as_posix().replace("/", ".").removesuffix(".__init__")
        for package in ("flows", "tasks", "adjust")
        for path in (REPOSITORY / package).rglob("*.py")
        if path.relative_to(REPOSITORY).as_posix() not in WITH_PREFECT
    )
    program = f"import importlib, sys\nfor name in {modules!r}: importlib.import_module(name)\n"
    program += "sys.exit('prefect' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_an_adjustment_does_not_wait_for_all_distributions() -> None:
    """One probability is a function of scipy.special; scipy.stats takes longer than the rest together."""
    program = "import tasks.deliveries.cameras, tasks.deliveries.exposures, tasks.deliveries.image_points\n"
    program += "import tasks.stages.approximate_values, tasks.stages.bundle_adjustment\n"
    program += "import tasks.documents.report.page, sys\nsys.exit('scipy.stats' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_run_that_finds_everything_stored_loads_nothing_that_computes() -> None:
    """What such a run imports: the command, the settings, the story with its stages."""
    program = "import flows.command.execution, flows.stories.aerial_triangulation, sys\n"
    program += "sys.exit(', '.join({'numba', 'pandas', 'scipy'} & set(sys.modules)) or 0)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
