"""What a rerun computes again: nothing, or exactly what a change reaches."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from tasks.store.source_digest import sources_reached
from tests.command_line import aerocal

REPOSITORY = Path(__file__).resolve().parents[2]
STAGES = [
    "import_exposures",
    "import_control",
    "import_image_points",
    "approximate_values",
    "bundle_adjustment",
    "remarks",
    "report",
]


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of our packages that a test may edit; its kernels are interpreted, as compiling takes longer.

    Keys ignore where the sources lie: what the packages themselves have computed is its own.
    """
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    folder = tmp_path / "application"
    for package in ("flows", "tasks", "adjust"):
        shutil.copytree(REPOSITORY / package, folder / package)
    return folder


def aerocal_of(tree: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Carry out a command of a copy of our packages."""
    return subprocess.run(
        [sys.executable, "-P", "-m", "flows.command", *arguments],
        env={**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
        timeout=280,
    )


def computed(block: Path, *settings: str, tree: Path = REPOSITORY) -> list[str]:
    """Run the project and name the stages that were computed, in their order."""
    arguments = ["run", str(block), *(argument for setting in settings for argument in ("--set", setting))]
    done = aerocal(*arguments) if tree == REPOSITORY else aerocal_of(tree, *arguments)
    assert done.returncode in (0, 4), done.stderr
    manifest = json.loads((block.parent / "results" / "manifest.json").read_text())
    assert [entry["stage"] for entry in manifest["stages"]] == STAGES
    return [entry["stage"] for entry in manifest["stages"] if not entry["reused"]]


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert text.count(old) >= 1
    file.write_text(text.replace(old, new))


def mean_height_m(block: Path) -> float:
    return float(pd.read_parquet(block.parent / "results" / "object_points.parquet")["z_m"].mean())


def test_only_what_a_change_reaches_is_computed_again(block: Path) -> None:
    assert computed(block) == STAGES
    assert computed(block) == []
    # A gate is looked at after the adjustment; the report names it.
    assert computed(block, "gates.sigma0.max=1.4") == ["report"]
    assert computed(block, "adjustment.confidence=0.99") == ["bundle_adjustment", "remarks", "report"]
    assert computed(block, "adjustment.confidence=0.99") == []
    # Both results are kept.
    assert computed(block) == []


def test_a_byte_of_the_tie_points_repeats_everything_that_depends_on_it(warm_block: Path) -> None:
    points = warm_block.parent / "image_points.csv"
    lines = points.read_text().splitlines()
    last = lines[-1][-1]
    lines[-1] = lines[-1][:-1] + ("1" if last != "1" else "2")
    points.write_text("\n".join(lines) + "\n")
    assert computed(warm_block) == [
        "import_image_points",
        "approximate_values",
        "bundle_adjustment",
        "remarks",
        "report",
    ]


def test_moving_the_delivery_repeats_nothing(warm_block: Path, tmp_path: Path) -> None:
    moved = tmp_path / "elsewhere" / "block"
    moved.parent.mkdir()
    warm_block.parent.rename(moved)
    assert computed(moved / "project.toml") == []


# Daily: what each stage reaches; in the tests of the store, that the same output repeats nothing behind it.
@pytest.mark.slow
def test_a_source_file_of_the_adjustment_repeats_only_what_reaches_it(warm_block: Path, tree: Path) -> None:
    with (tree / "adjust" / "data_snooping.py").open("a") as stream:
        stream.write("# a remark in the rejection\n")
    # Its tables come out the same, so the report has nothing new to say.
    assert computed(warm_block, tree=tree) == ["bundle_adjustment"]


def test_words_of_a_remark_and_of_a_template_repeat_no_adjustment(warm_block: Path, tree: Path) -> None:
    for behind_all_stages in ("flows/stories/aerial_triangulation.py", "tasks/results/publish.py"):
        with (tree / behind_all_stages).open("a") as stream:
            stream.write("# a remark\n")
    templates = tree / "tasks" / "documents" / "report" / "templates"
    edit(templates / "sections" / "datum.html.j2", "What fixes", "What holds")
    remarks = tree / "tasks" / "remarks" / "adjustment.py"
    edit(remarks, "image coordinates are uncontrolled", "image coordinates have no control")
    assert computed(warm_block, tree=tree) == ["remarks", "report"]
    assert "What holds the datum" in (warm_block.parent / "results" / "report.html").read_text()
    problems = json.loads((warm_block.parent / "results" / "summary.json").read_text())["problems"]
    assert any("image coordinates have no control" in sentence for sentence in problems)


def test_each_stage_depends_only_on_the_sources_it_needs() -> None:
    reached = {
        stage: set(sources_reached(REPOSITORY / "tasks" / "stages" / f"{stage}.py"))
        for stage in (
            "ingest",
            "approximate_values_stage",
            "bundle_adjustment_stage",
            "remarks_stage",
            "report",
        )
    }

    def reaching(*files: str) -> set[str]:
        return {stage for stage, sources in reached.items() if {*files} & sources}

    assert reaching("adjust/data_snooping.py") == {"bundle_adjustment_stage"}
    assert reaching("tasks/remarks/adjustment.py") == {"remarks_stage", "report"}
    assert reaching("tasks/documents/report/templates/sections/datum.html.j2") == {"report"}
    assert not reaching("tasks/results/publish.py", "flows/stories/aerial_triangulation.py")


def test_a_new_name_of_the_project_repeats_the_report_only(warm_block: Path) -> None:
    edit(warm_block, 'name = "two strips"', 'name = "renamed"')
    assert computed(warm_block) == ["report"]
    assert "<h1>renamed</h1>" in (warm_block.parent / "results" / "report.html").read_text()


@pytest.mark.slow
def test_a_length_in_a_style_sheet_repeats_the_report_only(warm_block: Path, tree: Path) -> None:
    edit(tree / "tasks" / "documents" / "report" / "templates" / "style.css", "1080px", "1000px")
    assert computed(warm_block, tree=tree) == ["report"]


@pytest.mark.slow
def test_a_change_in_what_a_kernel_calls_gives_the_new_result(
    block: Path, tree: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    # Compiled, with one cache of machine code for both: stale code would be found if there were any.
    monkeypatch.delenv("NUMBA_DISABLE_JIT")
    monkeypatch.setenv("AEROCAL_KERNEL_CACHE", str(tmp_path / "kernels"))
    computed(block, tree=tree)
    before = mean_height_m(block)
    callee = tree / "adjust" / "observations" / "image_point_kernel.py"
    original = callee.read_text()
    # A focal length longer by 1/1000 would move the terrain down by 1 m at this flying height; the four
    # control points hold back a part of it.
    edit(callee, "interior[camera, 0]", "(1.001 * interior[camera, 0])")
    assert "bundle_adjustment" in computed(block, tree=tree)
    assert before - mean_height_m(block) > 0.1
    callee.write_text(original)
    assert computed(block, tree=tree) == []
    assert mean_height_m(block) == before
