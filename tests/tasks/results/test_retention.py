"""Clean-up: whatever goes, nothing that a manifest names, and a rerun of the last run computes nothing."""

from __future__ import annotations

import json
import os
import shutil
import signal
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasks.results.manifest import read_manifest
from tasks.results.publish import put_out
from tasks.results.retention import CleanUp, clean_up, look_through, output_folders
from tasks.results.summary import failed_summary
from tasks.settings.load import load_project
from tasks.settings.project import Project
from tasks.store.artifact import Artifact, digest_of_file, verified
from tasks.store.run_lock import run_lock
from tasks.store.stage_record import read_records
from tasks.store.store import STAGE_FILE, Store, stored
from tests.conftest import PROJECT
from tests.tasks.forked import FORK

DAY = 86_400
KINDS = ("sums", "products")


@stored("read_numbers")
def read_numbers(folder: Path, *, start: int) -> None:
    (folder / "numbers.json").write_text(json.dumps([start, start + 1]))


@stored("scale_numbers")
def scale_numbers(folder: Path, *, numbers: Artifact, factor: int) -> None:
    (folder / "scaled.json").write_text(json.dumps([factor * n for n in json.loads(text(numbers))]))


@stored("sum_numbers")
def sum_numbers(folder: Path, *, scaled: tuple[Artifact, ...]) -> None:
    (folder / "sums.json").write_text(json.dumps(sum(json.loads(text(scaled[0])))))


@stored("multiply_numbers")
def multiply_numbers(folder: Path, *, scaled: dict[str, Artifact]) -> None:
    first, second = json.loads(text(scaled["only"]))
    (folder / "products.json").write_text(json.dumps(first * second))


def text(artifact: Artifact) -> str:
    return verified(artifact).read_text()


@dataclass
class Folder:
    """An output folder with its runs, and a clock that is moved on by ageing the outputs."""

    directory: Path
    project: Project
    last: dict[str, tuple[int, int]] = field(default_factory=dict)

    @property
    def store(self) -> Store:
        return Store.of(self.directory)

    def run(self, kind: str = "sums", start: int = 0, factor: int = 1) -> list[str]:
        """Run, publish; the stages that were computed."""
        with run_lock(self.directory):
            self.store.begin_run()
            numbers = read_numbers(self.store, start=start)["numbers"]
            scaled = scale_numbers(self.store, numbers=numbers, factor=factor)["scaled"]
            if kind == "sums":
                made = sum_numbers(self.store, scaled=(scaled,))
            else:
                made = multiply_numbers(self.store, scaled={"only": scaled})
            records = read_records(self.store.folder)
            put_out(self.store, self.project, [made[kind]], failed_summary("input_error", ("",), {}), (kind,))
            self.last[kind] = (start, factor)
        return [record.stage for record in records if not record.reused]

    def outputs(self) -> set[Path]:
        return {path for path in self.store.folder.glob("*/*") if len(path.name) == 64}

    def age(self, days: float) -> None:
        """Let time pass."""
        for place in self.outputs():
            file = place / STAGE_FILE
            then = file.stat().st_mtime - days * DAY
            os.utime(file, (then, then))

    def damaged(self) -> list[str]:
        """Published files that do not have the digest, or the output, which the manifest says they have."""
        manifest = read_manifest(self.directory)
        assert manifest is not None
        return [
            entry.file
            for entry in manifest.artifacts.values()
            for place in (self.directory, self.store.folder / entry.stage / entry.key)
            if digest_of_file(place / entry.file) != entry.sha256
        ]


@pytest.fixture
def new_folder(tmp_path: Path) -> Callable[[], Folder]:
    (tmp_path / "project.toml").write_text(PROJECT)
    for file in ("image_points.csv", "exposures.csv"):
        (tmp_path / file).touch()
    project = load_project(tmp_path / "project.toml")
    return lambda: Folder(Path(tempfile.mkdtemp(dir=tmp_path)) / "results", project)


@pytest.fixture
def folder(new_folder: Callable[[], Folder]) -> Folder:
    return new_folder()


def since(days: float) -> datetime:
    return datetime.now(UTC) - timedelta(days=days)


def stages(found: CleanUp) -> list[str]:
    return sorted(output.stage for output in found.removed)


def reasons(found: CleanUp) -> dict[str, str]:
    return {output.stage: why for output, why in found.kept}


RUNS = st.lists(
    st.tuples(st.sampled_from(KINDS), st.integers(0, 2), st.integers(2, 4), st.integers(0, 60)),
    min_size=1,
    max_size=6,
)


@pytest.mark.parametrize("examples", [8, pytest.param(100, marks=pytest.mark.slow)])
def test_whatever_is_removed_what_is_published_stays_and_a_rerun_computes_nothing(
    new_folder: Callable[[], Folder], examples: int
) -> None:
    @settings(max_examples=examples, deadline=None, derandomize=True)
    @given(runs=RUNS, keep=st.integers(0, 100))
    def check(runs: list[tuple[str, int, int, int]], keep: int) -> None:
        folder = new_folder()
        for kind, start, factor, days in runs:
            folder.run(kind, start, factor)
            folder.age(days + 0.5)
        before = folder.outputs()
        recent = {
            place
            for place in before
            if (place / STAGE_FILE).stat().st_mtime > time.time() - (keep - 0.01) * DAY
        }
        planned = look_through(folder.directory, since(keep))
        assert folder.outputs() == before, "a look changes nothing"
        done = clean_up(folder.directory, since(keep))
        assert done.refusal is None
        assert stages(done) == stages(planned)
        assert folder.outputs() == before - {output.folder for output in done.removed}
        assert recent <= folder.outputs()
        assert folder.damaged() == []
        # Every kind of run that is published here is taken up whole: also what the manifest does not name.
        for kind, inputs in dict(folder.last).items():
            assert folder.run(kind, *inputs) == []
        # And nothing else was kept without need: three outputs for each kind, and those used lately.
        assert len(before - {output.folder for output in done.removed} - recent) <= 3 * len(folder.last)

    check()


def test_old_outputs_go_and_new_ones_stay_with_their_reasons(folder: Folder) -> None:
    folder.run(factor=2)
    folder.age(50)
    folder.run(factor=3)
    folder.age(50)
    folder.run(factor=4)
    found = clean_up(folder.directory, since(60))
    assert stages(found) == ["scale_numbers", "sum_numbers"]
    assert sorted(why for _, why in found.kept) == ["named", "named", "named", "recent", "recent"]
    assert found.freed > 0


def test_an_output_that_is_served_again_is_used_again(folder: Folder) -> None:
    folder.run(factor=2)
    folder.age(100)
    folder.run(factor=2)
    folder.run(factor=3)
    assert stages(clean_up(folder.directory, since(90))) == []


def test_the_upstream_of_another_kind_of_run_in_the_folder_stays(folder: Folder) -> None:
    """The manifest names the file of the first run, and the stages of the last one only."""
    folder.run("sums", start=1, factor=2)
    folder.run("products", start=5, factor=6)
    folder.age(1000)
    found = clean_up(folder.directory, since(0))
    assert stages(found) == []
    assert sorted((output.stage, why) for output, why in found.kept) == [
        ("multiply_numbers", "named"),
        ("read_numbers", "named"),
        ("read_numbers", "upstream"),
        ("scale_numbers", "named"),
        ("scale_numbers", "upstream"),
        ("sum_numbers", "named"),
    ]


def test_a_stage_that_hands_its_input_on_unchanged_stays_with_the_rest(folder: Folder) -> None:
    """Its output and its input are the same bytes; of either the digest alone does not say which is meant."""
    folder.run("sums", start=1, factor=1)
    folder.run("products", start=5, factor=6)
    folder.age(1000)
    assert stages(clean_up(folder.directory, since(0))) == []
    assert folder.run("sums", start=1, factor=1) == []


def test_published_files_take_no_room_of_their_own(folder: Folder) -> None:
    folder.run()
    folder.age(100)
    (output,) = [
        one for one, _ in look_through(folder.directory, since(0)).kept if one.stage == "sum_numbers"
    ]
    listed = (output.folder / STAGE_FILE).stat().st_size
    assert output.size == listed, "the table itself is a hard link of the published one"


def test_nothing_goes_while_a_run_is_writing(folder: Folder) -> None:
    folder.run(factor=2)
    folder.run(factor=3)
    folder.age(100)
    leftover = folder.store.folder / "sum_numbers" / ".unfinished-x"
    leftover.mkdir()
    before = folder.outputs()
    with run_lock(folder.directory):
        for found in (clean_up(folder.directory, since(0)), look_through(folder.directory, since(0))):
            assert found.refusal == "A run is writing to it: nothing is removed."
            assert not found.removed
    assert folder.outputs() == before
    assert leftover.exists()
    assert stages(clean_up(folder.directory, since(0))) == ["scale_numbers", "sum_numbers"]
    assert not leftover.exists()


@pytest.mark.parametrize("damage", ["", "{", '{"artifacts": {}}', "[]"])
def test_nothing_goes_where_the_manifest_cannot_be_read(folder: Folder, damage: str) -> None:
    folder.run()
    folder.age(100)
    before = folder.outputs()
    (folder.directory / "manifest.json").write_text(damage)
    found = clean_up(folder.directory, since(0))
    assert found.refusal == "Its manifest.json cannot be read: nothing is removed."
    assert folder.outputs() == before


def test_a_manifest_that_is_a_broken_link_is_not_the_absence_of_one(folder: Folder) -> None:
    folder.run()
    folder.age(100)
    (folder.directory / "manifest.json").unlink()
    (folder.directory / "manifest.json").symlink_to("nowhere")
    assert clean_up(folder.directory, since(0)).refusal is not None


def test_without_any_manifest_unused_outputs_go_in_time(folder: Folder) -> None:
    """A run that never came to an end; its finished stages are taken up for a while."""
    folder.store.begin_run()
    read_numbers(folder.store, start=1)
    assert stages(clean_up(folder.directory, since(90))) == []
    folder.age(91)
    assert stages(clean_up(folder.directory, since(90))) == ["read_numbers"]


def test_a_damaged_output_is_no_obstacle(folder: Folder) -> None:
    folder.run(factor=2)
    folder.run(factor=3)
    lists = sorted(folder.store.folder.glob("s*_numbers/*/stage.json"))
    folder.age(100)
    for file in lists:
        then = file.stat().st_mtime
        file.chmod(0o644)
        file.write_text("{")
        os.utime(file, (then, then))
    found = clean_up(folder.directory, since(90))
    assert found.refusal is None
    # What the manifest names stays, damaged or not.
    assert sorted(reasons(found)) == ["read_numbers", "scale_numbers", "sum_numbers"]


def test_what_is_none_of_ours_in_a_store_is_left_alone(folder: Folder) -> None:
    folder.run()
    (folder.store.folder / "notes" / "mine").mkdir(parents=True)
    (folder.store.folder / "notes" / "mine.txt").touch()
    found = clean_up(folder.directory, since(0))
    assert (found.removed, found.refusal) == ((), None)
    assert (folder.store.folder / "notes" / "mine").is_dir()
    assert (folder.store.folder / "notes" / "mine.txt").is_file()


@pytest.mark.parametrize("name", ["linked", "notes/" + "b" * 64])
def test_nothing_goes_where_a_link_leads_out_of_the_store(folder: Folder, name: str) -> None:
    folder.run(factor=2)
    folder.run(factor=3)
    folder.age(100)
    before = folder.outputs()
    elsewhere = folder.directory.parent / "elsewhere"
    (elsewhere / ("a" * 64)).mkdir(parents=True)
    (folder.store.folder / name).parent.mkdir(exist_ok=True)
    (folder.store.folder / name).symlink_to(elsewhere)
    found = clean_up(folder.directory, since(0))
    assert found.refusal is not None
    assert "There is a link in the folder of finished stages" in found.refusal
    assert (elsewhere / ("a" * 64)).is_dir()
    assert before <= folder.outputs()


def test_nothing_goes_outside_the_folders_of_a_server(folder: Folder) -> None:
    folder.run(factor=2)
    folder.run(factor=3)
    folder.age(100)
    found = clean_up(folder.directory, since(0), roots=[folder.directory / "elsewhere"])
    assert found.refusal is not None
    assert "leads outside the folders of this server" in found.refusal
    assert stages(clean_up(folder.directory, since(0), roots=[folder.directory.parent])) != []


def killed_clean_up(directory: Path, left: int) -> None:
    """A clean-up for a process of its own, killed with a folder half gone after so many others."""
    remove = shutil.rmtree

    def removing(folder: str, ignore_errors: bool) -> None:
        nonlocal left
        left -= 1
        if left < 0:
            next(path for path in Path(folder).rglob("*") if path.is_file()).unlink()
            os.kill(os.getpid(), signal.SIGKILL)
        remove(folder, ignore_errors=ignore_errors)

    shutil.rmtree = removing  # type: ignore[assignment]
    clean_up(directory, datetime.now(UTC))


@pytest.mark.parametrize("after", [0, 1, 2])
def test_a_killed_clean_up_leaves_a_store_that_works(folder: Folder, after: int) -> None:
    for factor in (2, 3, 4):
        folder.run(factor=factor)
    folder.age(100)
    process = FORK.Process(target=killed_clean_up, args=(folder.directory, after))
    process.start()
    process.join(60)
    assert process.exitcode == -signal.SIGKILL
    assert folder.damaged() == []
    assert len(list(folder.store.folder.glob("*/.discarded-*"))) == 1
    again = clean_up(folder.directory, since(0))
    assert len(again.removed) == 4 - after - 1
    assert again.leftover_size > 0
    assert not list(folder.store.folder.glob("*/.*"))
    assert folder.run(factor=4) == []
    # What had been half removed was never taken for a result.
    assert folder.run(factor=2) == ["scale_numbers", "sum_numbers"]
    assert folder.damaged() == []


def test_output_folders_are_found_but_not_behind_links(tmp_path: Path) -> None:
    top = tmp_path / "root"
    inner = top / "a" / "b" / "results"
    for place in (top / "results", inner, inner / "again", tmp_path / "outside", top / ".hidden" / "results"):
        Store.of(place).begin_run()
    (top / "link").symlink_to(tmp_path / "outside")
    (top / "c").mkdir()
    (top / "c" / ".store").symlink_to(tmp_path / "outside" / ".store")
    assert output_folders([top]) == (inner, inner / "again", top / "results")
    assert output_folders([top, inner]) == (inner, inner / "again", top / "results")
    assert output_folders([top], depth=1) == (top / "results",)


def test_a_folder_that_may_only_be_read_is_said_and_left(folder: Folder) -> None:
    folder.run()
    folder.age(100)
    found = clean_up(folder.directory / "nowhere", since(0))
    assert found.refusal is not None
    assert "nowhere" in found.refusal
