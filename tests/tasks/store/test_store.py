"""The stage store: what is reused, what is computed again, what is never kept."""

from __future__ import annotations

import json
import logging
import os
import stat
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest

from tasks.errors import InputError
from tasks.files.installation import InstallationError
from tasks.settings.base import InputPath, Settings
from tasks.store.artifact import Artifact, verified
from tasks.store.run_lock import run_lock
from tasks.store.stage_record import read_records
from tasks.store.store import Store, stored


class Delivery(Settings):
    """A delivered file and a factor."""

    file: InputPath
    factor: float = 1.0


@stored("read_numbers")
def read_numbers(folder: Path, *, delivery: Delivery) -> None:
    numbers = [delivery.factor * float(line) for line in delivery.file.read_text().splitlines()]
    pd.DataFrame({"number": numbers}).to_parquet(folder / "numbers.parquet")


@stored("add_numbers")
def add_numbers(folder: Path, *, numbers: Artifact, offset: float = 0.0) -> None:
    total = pd.read_parquet(verified(numbers))["number"].sum() + offset
    (folder / "total.json").write_text(json.dumps({"total": total}))


@stored("count_tables")
def count_tables(folder: Path, /, *, offset: int = 0, **tables: Artifact) -> None:
    (folder / "names.json").write_text(json.dumps(sorted(tables)[offset:]))


@stored("add_numbers_slowly")
def overwrite_its_input(folder: Path, *, delivery: Delivery) -> None:
    (folder / "seen.txt").write_text(delivery.file.read_text())
    delivery.file.write_text("somebody is still copying")


@stored("fill_the_disk")
def fill_the_disk(folder: Path, *, size: int) -> None:
    (folder / "part.txt").write_text("a part")
    with Path("/dev/full").open("wb", buffering=0) as full:
        full.write(bytes(size))


@stored("two_stems")
def two_files_of_one_stem(folder: Path, *, text: str) -> None:
    (folder / "a.json").write_text(text)
    (folder / "a.txt").write_text(text)
    (folder / "b.txt").write_text(text)


#: Inodes of what the first of two had finished.
_finished_first: list[int] = []


@stored("beside_another")
def beside_another(folder: Path, *, text: str) -> None:
    """While it is at work, another process finishes the same output."""
    (folder / "text.txt").write_text(text)
    if len(list(folder.parent.glob(".unfinished-*"))) == 1:
        outputs = beside_another(Store(folder.parents[1]), text=text)
        _finished_first.append(outputs["text"].path.stat().st_ino)


@stored("after_its_run")
def after_its_run(folder: Path, *, text: str) -> None:
    """While it is at work, its run has ended and the next one begins."""
    (folder / "first.txt").write_text(text)
    Store(folder.parents[1]).begin_run()
    (folder / "second.txt").write_text(text)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    store = Store.of(tmp_path / "results")
    store.begin_run()
    return store


@pytest.fixture
def delivery(tmp_path: Path) -> Delivery:
    file = tmp_path / "numbers.txt"
    file.write_text("1\n2\n3\n")
    return Delivery(file=file)


def run(store: Store, delivery: Delivery, offset: float = 0.0) -> tuple[float, list[str]]:
    """The total, and the stages that were computed rather than reused."""
    store.begin_run()
    numbers = read_numbers(store, delivery=delivery)["numbers"]
    total = add_numbers(store, numbers=numbers, offset=offset)["total"]
    computed = [record.stage for record in read_records(store.folder) if not record.reused]
    return json.loads(verified(total).read_text())["total"], computed


def test_a_rerun_with_unchanged_inputs_computes_nothing(store: Store, delivery: Delivery) -> None:
    assert run(store, delivery) == (6.0, ["read_numbers", "add_numbers"])
    assert run(store, delivery) == (6.0, [])


def test_a_setting_of_the_late_stage_repeats_only_the_late_stage(store: Store, delivery: Delivery) -> None:
    run(store, delivery)
    assert run(store, delivery, offset=1.0) == (7.0, ["add_numbers"])


def test_a_byte_of_the_input_repeats_everything_behind_it(store: Store, delivery: Delivery) -> None:
    run(store, delivery)
    status = delivery.file.stat()
    delivery.file.write_text("1\n2\n4\n")
    # Not even a restored time stamp hides the change.
    os.utime(delivery.file, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert run(store, delivery) == (7.0, ["read_numbers", "add_numbers"])


def test_a_moved_delivery_computes_nothing(store: Store, delivery: Delivery, tmp_path: Path) -> None:
    run(store, delivery)
    moved = delivery.file.rename(tmp_path / "moved.txt")
    assert run(store, Delivery(file=moved)) == (6.0, [])


def test_an_input_that_gives_the_same_numbers_does_not_repeat_the_next_stage(
    store: Store, delivery: Delivery
) -> None:
    run(store, delivery)
    delivery.file.write_text("1.0\n2.0\n3.0\n")
    assert run(store, delivery) == (6.0, ["read_numbers"])


def test_a_stage_that_takes_its_tables_by_name_tells_them_apart(store: Store, delivery: Delivery) -> None:
    numbers = read_numbers(store, delivery=delivery)["numbers"]
    first = count_tables(store, exposures=numbers, cameras=numbers)["names"]
    other = count_tables(store, exposures=numbers, control_points=numbers)["names"]
    assert json.loads(first.path.read_text()) == ["cameras", "exposures"]
    assert json.loads(other.path.read_text()) == ["control_points", "exposures"]
    parts = json.loads((first.path.parent / "stage.json").read_text())["key_parts"]["arguments"]
    assert sorted(parts) == ["cameras", "exposures", "offset"]


def test_rows_and_digest_come_with_the_artifact(store: Store, delivery: Delivery) -> None:
    numbers = read_numbers(store, delivery=delivery)["numbers"]
    assert numbers.rows == 3
    assert len(numbers.sha256) == 64
    assert numbers == read_numbers(store, delivery=delivery)["numbers"]


@pytest.mark.parametrize("damage", ["changed", "missing", "no list", "deep list"])
def test_a_damaged_output_is_computed_again_with_a_warning(
    store: Store, delivery: Delivery, damage: str, caplog: pytest.LogCaptureFixture
) -> None:
    path = read_numbers(store, delivery=delivery)["numbers"].path
    good = path.read_bytes()
    victim = path.with_name("stage.json") if damage.endswith("list") else path
    victim.unlink()
    if damage == "changed":
        victim.write_bytes(good[:-1] + b"?")
    elif damage == "deep list":
        victim.write_bytes(b"[" * 100_000)
    with caplog.at_level(logging.WARNING, logger="aerocal"):
        again = read_numbers(store, delivery=delivery)["numbers"]
    assert verified(again).read_bytes() == good
    assert "read_numbers: the stored output is damaged" in caplog.text


def test_a_reader_refuses_a_file_that_was_changed_behind_its_back(store: Store, delivery: Delivery) -> None:
    numbers = read_numbers(store, delivery=delivery)["numbers"]
    numbers.path.unlink()
    with pytest.raises(InstallationError, match="is missing"):
        verified(numbers)
    numbers.path.write_bytes(b"other")
    with pytest.raises(InstallationError, match="was changed"):
        verified(numbers)


def test_a_file_that_changes_while_it_is_read_is_an_input_error(store: Store, delivery: Delivery) -> None:
    with pytest.raises(InputError, match="changed while it was being read"):
        overwrite_its_input(store, delivery=delivery)
    assert not list((store.folder / "add_numbers_slowly").iterdir())


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs the device that is always full")
def test_a_full_disk_gives_one_message_and_leaves_nothing(store: Store) -> None:
    with pytest.raises(InstallationError, match="no space left"):
        fill_the_disk(store, size=10)
    assert not list((store.folder / "fill_the_disk").iterdir())


def test_two_files_with_one_stem_are_told_apart_by_their_whole_names(store: Store) -> None:
    for outputs in (two_files_of_one_stem(store, text="x"), two_files_of_one_stem(store, text="x")):
        assert {name: artifact.path.name for name, artifact in outputs.items()} == {
            "a.json": "a.json", "a.txt": "a.txt", "b": "b.txt",
        }  # fmt: skip
        assert all(artifact.name == name for name, artifact in outputs.items())


def test_leftovers_of_a_killed_run_are_swept_and_never_read(store: Store, delivery: Delivery) -> None:
    leftover = store.folder / "read_numbers" / ".unfinished-killed"
    leftover.mkdir(parents=True)
    (leftover / "numbers.parquet").write_bytes(b"half")
    assert run(store, delivery)[0] == 6.0
    assert not leftover.exists()


def test_the_reason_for_computing_names_what_changed(
    store: Store, delivery: Delivery, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO, logger="aerocal"):
        run(store, delivery)
        run(store, delivery, offset=2.0)
    started = [message for message in caplog.messages if "started" in message]
    assert started == [
        "read_numbers: started (no earlier result)",
        "add_numbers: started (no earlier result)",
        "add_numbers: started (changed: offset)",
    ]


def test_an_argument_without_content_is_refused(store: Store) -> None:
    with pytest.raises(TypeError, match=r"'numbers\[1\]' of a stage is a PosixPath"):
        add_numbers(store, numbers=(1, Path("x")))  # type: ignore[arg-type]


def test_stored_files_are_read_only(store: Store, delivery: Delivery) -> None:
    path = read_numbers(store, delivery=delivery)["numbers"].path
    assert path.stat().st_mode & 0o222 == 0


@pytest.mark.parametrize("mask", [0o002, 0o027, 0o077])
def test_who_may_use_stored_outputs_is_said_by_the_umask(
    delivery: Delivery, tmp_path: Path, mask: int
) -> None:
    before = os.umask(mask)
    try:
        path = read_numbers(Store.of(tmp_path / "results"), delivery=delivery)["numbers"].path
        with run_lock(tmp_path / "results"):
            pass
    finally:
        os.umask(before)
    modes = {place: stat.S_IMODE(place.stat().st_mode) for place in (path.parent, *path.parent.iterdir())}
    assert modes.pop(path.parent) == 0o777 & ~mask
    assert set(modes.values()) == {0o444 & ~mask}
    assert stat.S_IMODE((tmp_path / "results" / ".store" / "lock").stat().st_mode) == 0o666 & ~mask


def test_of_two_that_compute_the_same_the_first_to_finish_stays(store: Store) -> None:
    outputs = beside_another(store, text="x")
    (place,) = (store.folder / "beside_another").iterdir()
    assert outputs["text"].path == place / "text.txt"
    assert verified(outputs["text"]).read_text() == "x"
    first, second = read_records(store.folder)
    assert first.key == second.key == place.name
    # The first to finish may be read by others already: it was not replaced by its twin.
    assert outputs["text"].path.stat().st_ino == _finished_first[-1]


def test_a_damaged_output_is_replaced_by_whoever_finishes_next(store: Store) -> None:
    path = beside_another(store, text="x")["text"].path
    path.chmod(0o644)
    path.write_text("damaged")
    again = beside_another(store, text="x")["text"]
    assert verified(again).read_text() == "x"
    assert not list((store.folder / "beside_another").glob(".*"))


def test_a_stage_whose_run_has_ended_keeps_nothing(store: Store) -> None:
    with pytest.raises(InstallationError, match="No such file"):
        after_its_run(store, text="x")
    assert not list((store.folder / "after_its_run").iterdir())


def test_records_come_in_the_order_in_which_the_stages_ended(store: Store, delivery: Delivery) -> None:
    run(store, delivery)
    assert [record.stage for record in read_records(store.folder)] == ["read_numbers", "add_numbers"]
    (store.folder / "run" / ".0-killed.json").write_text('{"stage": "rea')
    assert len(read_records(store.folder)) == 2
    store.begin_run()
    assert read_records(store.folder) == ()


def test_records_keep_their_order_by_a_clock_before_1970(
    store: Store, delivery: Delivery, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Two moments of June 1969.
    moments = iter([-18_000_000_000_000_000, -17_999_999_000_000_000])
    clock = SimpleNamespace(time_ns=lambda: next(moments))
    monkeypatch.setattr("tasks.store.stage_record.time", clock)
    run(store, delivery)
    assert [record.stage for record in read_records(store.folder)] == ["read_numbers", "add_numbers"]
