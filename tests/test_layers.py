"""The three storeys: imports point downwards only."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]


#: The flows and what serves them.
WITH_PREFECT = {
    f"flows/serving/{name}.py" for name in ("registered", "deployed", "deployments", "fork", "preload")
}


def test_imports_point_downwards_only() -> None:
    command = [str(Path(sys.executable).with_name("lint-imports")), "--no-cache"]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def imported_on_loading(tree: ast.Module) -> Iterator[str]:
    """Names of modules that come along when a module is imported: those that no function imports later."""
    ahead: list[ast.AST] = [*tree.body]
    while ahead:
        node = ahead.pop()
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "no import is relative"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            ahead += node.orelse
        elif not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            ahead += ast.iter_child_nodes(node)


def test_only_the_flows_and_what_serves_them_import_prefect_at_their_top() -> None:
    with_prefect = tuple(name.removesuffix("py").replace("/", ".") for name in WITH_PREFECT)
    found = set()
    for package in ("flows", "tasks", "adjust"):
        for path in (REPOSITORY / package).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            # Only what contains one of the names has to be parsed.
            if "prefect" in text or "serving" in text:
                names = imported_on_loading(ast.parse(text))
                if any(f"{name}.".startswith(("prefect.", *with_prefect)) for name in names):
                    found.add(path.relative_to(REPOSITORY).as_posix())
    assert found == WITH_PREFECT


@pytest.mark.parametrize(
    "source",
    [
        "import prefect.client",
        "try:\n    from prefect import flow\nexcept ImportError:\n    pass",
        "class A:\n    import prefect",
    ],
)
def test_an_import_at_the_top_is_seen_wherever_it_is(source: str) -> None:
    (name,) = imported_on_loading(ast.parse(source))
    assert name.startswith("prefect")


@pytest.mark.parametrize(
    "source", ["def f():\n    import prefect", "if TYPE_CHECKING:\n    from prefect import Flow"]
)
def test_an_import_that_waits_is_none_at_the_top(source: str) -> None:
    assert [*imported_on_loading(ast.parse(source))] == []


#: What is imported one after the other, each with the libraries that must not have come along till then.
STEPS = {
    # What every command with --help imports, and `aerocal export` that lists the formats.
    "list": (["flows.command.main", "flows.command.format_table"], {"numpy", "pyarrow"}),
    # What a run imports that finds everything stored: the command, the settings, the story with its stages.
    "reuse": (
        ["flows.command.execution", "flows.stories.aerial_triangulation"],
        {"numba", "pandas", "pyarrow.compute", "scipy"},
    ),
    "adjustment": (
        [
            *(f"tasks.deliveries.{name}" for name in ("cameras", "exposures", "image_points")),
            *(f"tasks.stages.{name}" for name in ("approximate_values", "bundle_adjustment")),
            "tasks.documents.report.page",
        ],
        {"scipy.stats"},
    ),
    "image quality": (["flows.stories.image_quality"], {"scipy.signal"}),
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


def unwanted_after(*names: str) -> dict[str, list[str]]:
    """The unwanted libraries of some steps, in one process for all."""
    command = [sys.executable, "-c", _PROGRAM.format(steps={name: STEPS[name] for name in names})]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found: dict[str, list[str]] = json.loads(done.stdout)
    return found


@pytest.mark.slow
def test_only_the_flows_and_what_serves_them_import_prefect_when_they_are_imported() -> None:
    """Every other module of ours loads without Prefect coming along, from a library neither."""
    assert unwanted_after("everything")["everything"] == []


@pytest.fixture(scope="module")
def came_along() -> dict[str, list[str]]:
    return unwanted_after("list", "reuse", "adjustment", "image quality")


def test_an_adjustment_does_not_wait_for_all_distributions(came_along: dict[str, list[str]]) -> None:
    """One probability is a function of scipy.special; scipy.stats takes longer than the rest together."""
    assert came_along["adjustment"] == []


def test_image_quality_loads_no_signal_processing(came_along: dict[str, list[str]]) -> None:
    """It took 1.3 s."""
    assert came_along["image quality"] == []


def test_a_list_of_formats_loads_nothing_that_computes(came_along: dict[str, list[str]]) -> None:
    assert came_along["list"] == []


def test_a_run_that_finds_everything_stored_loads_nothing_that_computes(
    came_along: dict[str, list[str]],
) -> None:
    assert came_along["reuse"] == []
