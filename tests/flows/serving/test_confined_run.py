"""A deployed run from end to end: it reads and writes nothing outside the folders of its server."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from flows.runs.project_run import RunOutcome, RunRequest, Story, carry_out
from flows.server.roots import Roots, roots_of
from flows.stories.aerial_triangulation import aerial_triangulation
from tasks.errors import InputError
from tasks.results.summary import Summary
from tasks.settings.project import Project
from tasks.store.store import Store
from tests.flows.conftest import write_block


@pytest.fixture
def roots(tmp_path: Path) -> Roots:
    write_block(tmp_path / "root" / "block")
    write_block(tmp_path / "outside")
    return roots_of([tmp_path / "root"])


def deployed(
    roots: Roots, *overrides: str, output: str = "results", story: Story = aerial_triangulation
) -> RunOutcome:
    """What a deployment does with its parameters."""
    file = roots.project_file("block")
    return carry_out(
        story, RunRequest(file, roots.output_folder(file, output), overrides, roots=roots.folders)
    )


def everything(folder: Path) -> dict[str, bytes | None]:
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


def test_a_sound_project_is_run_and_nothing_is_written_outside(roots: Roots, tmp_path: Path) -> None:
    before = everything(tmp_path / "outside")
    outcome = deployed(roots)
    assert outcome.summary.status == "done", outcome.error
    assert (tmp_path / "root" / "block" / "results" / "report.html").is_file()
    assert everything(tmp_path / "outside") == before


@pytest.mark.parametrize(
    "override",
    [
        'inputs.exposures.file="../../outside/exposures.csv"',
        'inputs.exposures.file="/etc/hostname"',
        'inputs.exposures.file="link.csv"',
        'inputs.exposures.file="linked/exposures.csv"',
        'inputs.exposures.file="${HOME}/exposures.csv"',
        'inputs.exposures.file="~/exposures.csv"',
        'inputs.image_points.file="{outside}/image_points.csv"',
        'inputs.control.file="{outside}/control.csv"',
        'cameras.C.file="{outside}/exposures.csv"',
        'project.heights={{ geoid = "{outside}/exposures.csv" }}',
        'inputs.exposures.heights={{ geoid = "/usr/share/proj/x.tif" }}',
        'adjustment.residual_grid={{ file = "{outside}/exposures.csv" }}',
        'direct_georeferencing.calibration="{outside}"',
        'project.crs="+proj=utm +zone=32 +ellps=bessel +nadgrids={outside}/exposures.csv +type=crs"',
        'project.crs="+init={outside}/exposures.csv:1"',
    ],
)
def test_no_input_outside_is_read(roots: Roots, tmp_path: Path, override: str) -> None:
    block, outside = tmp_path / "root" / "block", tmp_path / "outside"
    (block / "link.csv").symlink_to(outside / "exposures.csv")
    (block / "linked").symlink_to(outside)
    if override.startswith("cameras"):
        file = block / "project.toml"
        file.write_text(file.read_text().replace("[cameras.C]", "[cameras.C]\nformat = 'ign-xml'"))
    opened: list[str] = []

    def note(event: str, arguments: tuple[object, ...]) -> None:
        if event == "open" and isinstance(arguments[0], str) and arguments[0].startswith(str(outside)):
            opened.append(arguments[0])

    _LISTENERS.append(note)
    try:
        outcome = deployed(roots, override.format(outside=outside) if "{outside}" in override else override)
    finally:
        _LISTENERS.remove(note)
    assert outcome.summary.status == "input_error", override
    assert opened == []
    assert os.environ.get("HOME", "nowhere") + "/exposures.csv" not in str(outcome.error)


def test_a_registry_cannot_be_named_by_a_project(roots: Roots, tmp_path: Path) -> None:
    file = tmp_path / "root" / "block" / "project.toml"
    sound = file.read_text()
    for more in ('registry = "sqlite:////etc/x"\n', "[registry]\nurl = 'sqlite:////etc/x'\n"):
        file.write_text((more + sound) if more.startswith("registry") else sound + more)
        outcome = deployed(roots)
        assert outcome.summary.status == "input_error"
        assert "no key 'registry'" in str(outcome.error)


def test_a_link_swapped_in_while_a_run_reads_its_inputs_is_noticed(roots: Roots, tmp_path: Path) -> None:
    block, outside = tmp_path / "root" / "block", tmp_path / "outside"

    def swapping(project: Project, store: Store) -> Summary:
        # The paths have been checked; now one of them becomes a link.
        (block / "exposures.csv").unlink()
        (block / "exposures.csv").symlink_to(outside / "exposures.csv")
        return aerial_triangulation(project, store)

    outcome = deployed(roots, story=swapping)
    assert outcome.summary.status == "input_error"
    assert "contains a link" in str(outcome.error)


@pytest.mark.parametrize("place", ["", ".store", ".store/lock", ".store/bundle_adjustment"])
def test_an_output_folder_with_a_link_in_it_is_refused(roots: Roots, tmp_path: Path, place: str) -> None:
    outside = tmp_path / "outside"
    link = tmp_path / "root" / "block" / "results" / place
    link.parent.mkdir(parents=True, exist_ok=True)
    link.symlink_to(outside / "project.toml" if place.endswith("lock") else outside)
    before = everything(outside)
    with pytest.raises(InputError, match=r"leads out|a link in the folder"):
        deployed(roots)
    assert everything(outside) == before


def test_an_output_folder_swapped_for_a_link_during_the_run_gets_nothing_published(
    roots: Roots, tmp_path: Path
) -> None:
    results, outside = tmp_path / "root" / "block" / "results", tmp_path / "outside"

    def swapping(project: Project, store: Store) -> Summary:
        results.rename(results.with_name("aside"))
        results.symlink_to(outside)
        return aerial_triangulation(project, store)

    with pytest.raises(Exception, match="moved or replaced"):
        deployed(roots, story=swapping)
    assert not (outside / "report.html").exists()
    assert not (outside / "manifest.json").exists()


_LISTENERS: list[Callable[[str, tuple[object, ...]], None]] = []


@pytest.fixture(scope="module", autouse=True)
def _listen() -> None:
    """Hear of every file that Python opens; such a hook cannot be taken away again, so there is one."""
    import sys

    sys.addaudithook(
        lambda event, arguments: [listener(event, arguments) for listener in _LISTENERS] and None
    )
