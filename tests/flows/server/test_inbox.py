"""The inbox: complete deliveries only, and each with a key of its own."""

from __future__ import annotations

import json
import os
import shutil
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from pathlib import Path

import pytest

from flows.server.api import Api
from flows.server.inbox import (
    MARKER,
    CalledOffError,
    Delivery,
    Inbox,
    Scheduled,
    read_inbox,
    schedule_deliveries,
)
from flows.server.roots import roots_of
from tasks.errors import InputError
from tasks.production.records import Records
from tasks.production.run_record import RunRecord


@pytest.fixture
def inbox(tmp_path: Path, write_project: Callable[..., Path]) -> Path:
    folder = tmp_path / "inbox"
    for name in ("block-1", "block-2"):
        write_project(folder / name)
    return folder


def read(inbox: Path) -> Inbox:
    return read_inbox(inbox, roots_of([inbox]))


def listed(folder: Path) -> str:
    files = sorted(file for file in folder.iterdir() if file.name != MARKER)
    return "".join(f"{sha256(file.read_bytes()).hexdigest()}  {file.name}\n" for file in files)


def test_a_delivery_without_its_marker_waits(inbox: Path) -> None:
    (inbox / "block-2" / MARKER).touch()
    found = read(inbox)
    assert [one.folder.name for one in found.complete] == ["block-2"]
    assert [folder.name for folder in found.waiting] == ["block-1"]
    assert not found.refused


def test_a_marker_that_lists_files_is_held_to_their_bytes(inbox: Path) -> None:
    block = inbox / "block-1"
    (block / MARKER).write_text(listed(block))
    assert len(read(inbox).complete) == 1
    points = (block / "image_points.csv").read_bytes()
    (block / "image_points.csv").write_bytes(points[:-5])
    assert "differs from its digest" in read(inbox).refused[block]
    (block / "image_points.csv").unlink()
    assert "image_points.csv does not exist" in read(inbox).refused[block]
    (block / "image_points.csv").write_bytes(points)
    assert len(read(inbox).complete) == 1


@pytest.mark.parametrize(
    ("marker", "reason"),
    [
        ("complete!\n", "line 1: not a digest"),
        (f"{'0' * 64}  ../../outside.csv\n", "outside the folders"),
        (f"{'0' * 64}  /etc/passwd\n", "outside the folders"),
    ],
)
def test_a_marker_that_is_no_list_of_delivered_files_is_refused(
    inbox: Path, marker: str, reason: str
) -> None:
    (inbox / "block-1" / MARKER).write_text(marker)
    found = read(inbox)
    assert not found.complete
    assert reason in found.refused[inbox / "block-1"]


def test_a_delivery_that_is_a_link_to_elsewhere_is_refused(
    inbox: Path, tmp_path: Path, write_project: Callable[..., Path]
) -> None:
    write_project(tmp_path / "outside")
    (tmp_path / "outside" / MARKER).touch()
    (inbox / "linked").symlink_to(tmp_path / "outside")
    found = read(inbox)
    assert not found.complete
    assert "outside the folders" in found.refused[inbox / "linked"]


def test_a_marker_without_a_project_is_refused(inbox: Path) -> None:
    (inbox / "empty").mkdir()
    (inbox / "empty" / MARKER).touch()
    assert read(inbox).refused[inbox / "empty"] == "It has no project.toml."


def test_the_key_changes_with_the_delivery_and_not_with_its_results(inbox: Path) -> None:
    block = inbox / "block-1"
    (block / MARKER).touch()
    first = read(inbox).complete[0].key
    (block / "results" / ".store").mkdir(parents=True)
    (block / "results" / "report.html").write_text("done")
    assert read(inbox).complete[0].key == first
    # Somebody has looked into the folder, and opened files.
    (block / "truth").mkdir(exist_ok=True)
    for name in (".DS_Store", "truth/Thumbs.db", ".~lock.control.csv#", "~$control.xlsx", ".nfs0000000001"):
        (block / name).write_bytes(b"Bud1")
    assert read(inbox).complete[0].key == first
    with (block / "exposures.csv").open("a") as stream:
        stream.write("3,C,s,20,0,100,0,0,0\n")
    changed = read(inbox).complete[0].key
    os.utime(block / MARKER, (1, 1))
    assert len({first, changed, read(inbox).complete[0].key}) == 3


def test_listed_files_are_read_once_as_long_as_nothing_changes(inbox: Path) -> None:
    block = inbox / "block-1"
    (block / MARKER).write_text(listed(block))
    known: dict[Delivery, str | None] = {}
    roots = roots_of([inbox])
    for content in (None, "damaged"):
        if content is not None:
            (block / "exposures.csv").write_text(content)
        first = read_inbox(inbox, roots, known)
        assert len(known) == (1 if content is None else 2)
        # No file is read, so nobody asks whether the look is over.
        again = read_inbox(inbox, roots, known, is_over=lambda: True)
        assert (again.complete, again.refused) == (first.complete, first.refused)
    assert "differs from its digest" in again.refused[block]


def test_a_file_that_cannot_be_read_for_a_moment_is_read_again(inbox: Path) -> None:
    block, known = inbox / "block-1", dict[Delivery, str | None]()
    # The system refuses to read it.
    (block / "exposures.csv").unlink()
    (block / "exposures.csv").symlink_to("/proc/self/mem")
    (block / MARKER).write_text(f"{'0' * 64}  exposures.csv\n")
    found = read_inbox(inbox, roots_of([inbox, Path("/proc/self")]), known)
    assert found.refused[block] == "It cannot be read (Input/output error)."
    assert known == {}


def test_a_damaged_file_that_is_replaced_is_read_though_size_and_time_are_the_same(inbox: Path) -> None:
    block = inbox / "block-1"
    (block / MARKER).write_text(listed(block))
    file, known, roots = block / "exposures.csv", dict[Delivery, str | None](), roots_of([inbox])
    content, status = file.read_bytes(), file.stat()
    for written, expected in ((content[::-1], 0), (content, 1)):
        file.write_bytes(written)
        os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))
        assert len(read_inbox(inbox, roots, known).complete) == expected


def test_the_listed_files_of_a_delivery_that_had_a_run_are_not_read_again(inbox: Path) -> None:
    block = inbox / "block-1"
    (block / MARKER).write_text(listed(block))

    def runs_of(keys: Sequence[str]) -> dict[str, RunRecord]:
        return {key: RunRecord.of("1", block / "project.toml", "story", "Completed") for key in keys}

    found = read_inbox(inbox, roots_of([inbox]), runs_of=runs_of, is_over=lambda: True)
    assert [one.key for one in found.complete] == list(found.runs)


def test_a_look_that_starts_nothing_tells_what_is_held_back(inbox: Path, tmp_path: Path) -> None:
    """With --only-on-schedule, by day; a call of the server would fail."""
    (inbox / "empty").mkdir()
    for name in ("block-1", "empty"):
        (inbox / name / MARKER).touch()
    nobody, records = Api("http://127.0.0.1:9/api"), Records.at(str(tmp_path / "records.sqlite"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("flows.server.inbox.STILL_S", 0.0)
        told = schedule_deliveries(
            nobody, records, inbox, roots_of([inbox]), "aerial-triangulation", only_look=True
        )
    refused = ("empty was not started. It has no project.toml.",)
    assert told == Scheduled((), (), ("block-2",), refused, on_schedule=("block-1",))
    assert records.runs() == ()


def test_the_key_of_a_delivery_stays_when_the_program_is_upgraded(inbox: Path) -> None:
    """Else all deliveries of the inbox would be processed again."""
    block = inbox / "block-1"
    (block / "a-b").mkdir()
    (block / "a").mkdir()
    for name in (MARKER, "a-b/1.csv", "a/2.csv"):
        (block / name).touch()
    (block / "nowhere").symlink_to(block / "nothing")
    told = [str(block.resolve())]
    for file in sorted(file for file in block.rglob("*") if file.is_file()):
        told.append(f"{file.relative_to(block)} {file.stat().st_size} {file.stat().st_mtime_ns}")
    key = sha256(json.dumps(told).encode()).hexdigest()
    assert [one.key for one in read(inbox).complete] == [key]


def test_a_delivery_whose_files_are_renamed_while_they_are_looked_at_is_never_refused(inbox: Path) -> None:
    block = inbox / "block-1"
    (block / MARKER).touch()
    over = threading.Event()

    def copy() -> None:
        while not over.is_set():
            for number in range(50):
                (block / f".{number}.part").touch()
                (block / f".{number}.part").rename(block / f"{number}.csv")

    with ThreadPoolExecutor(1) as copying:
        copying.submit(copy)
        try:
            found = [read_inbox(inbox, roots_of([inbox]), still_s=60.0) for _ in range(100)]
        finally:
            over.set()
    assert [one.refused for one in found] == [{}] * 100
    assert not any(one.complete for one in found)


def test_an_inbox_that_is_gone_is_said(inbox: Path) -> None:
    shutil.rmtree(inbox)
    with pytest.raises(InputError, match="--inbox"):
        read_inbox(inbox, roots_of([inbox.parent]))


def test_one_bad_delivery_never_stands_in_the_way_of_another(inbox: Path) -> None:
    """Whatever is copied into the inbox, looking through it goes on."""
    (inbox / "block-1" / MARKER).touch()
    made = {}
    for name in (
        "circle",
        "project in a circle",
        "null",
        "long",
        "pipe",
        "huge",
        "folder",
        "dangling",
        "a\x1b[2Jb",
    ):
        made[name] = inbox / name
        shutil.copytree(inbox / "block-2", made[name])
    (inbox / os.fsdecode(b"no-utf-8-\xff")).mkdir()
    (made["circle"] / MARKER).symlink_to(made["circle"] / MARKER)
    (made["project in a circle"] / "project.toml").unlink()
    (made["project in a circle"] / "project.toml").symlink_to(made["project in a circle"] / "project.toml")
    (made["null"] / MARKER).write_bytes(b"0" * 64 + b"  a\0b\n")
    (made["long"] / MARKER).write_text("0" * 64 + "  " + "x" * 5_000 + "\n")
    os.mkfifo(made["pipe"] / MARKER)
    (made["huge"] / MARKER).touch()
    os.truncate(made["huge"] / MARKER, 100_000_000_000)
    (made["folder"] / MARKER).mkdir()
    (made["dangling"] / MARKER).symlink_to(made["dangling"] / "nothing")
    for name in ("project in a circle", "a\x1b[2Jb"):
        (made[name] / MARKER).touch()
    (inbox / os.fsdecode(b"no-utf-8-\xff") / MARKER).touch()
    found = read(inbox)
    assert [one.folder.name for one in found.complete] == ["block-1"]
    assert [folder.name for folder in found.waiting] == ["block-2"]
    assert len(found.refused) == len(made) + 1


def test_a_marked_delivery_that_still_changes_waits_until_it_is_still(inbox: Path) -> None:
    roots, block = roots_of([inbox]), inbox / "block-1"
    (block / MARKER).touch()
    for content in ("a", "b"):
        (block / "more.csv").write_text(content)
        found = read_inbox(inbox, roots, still_s=0.5)
        assert not found.complete
        assert block in found.waiting
    until = time.monotonic() + 10.0
    while not (found := read_inbox(inbox, roots, still_s=0.5)).complete:
        assert time.monotonic() < until
        time.sleep(0.1)
    assert [one.folder.name for one in found.complete] == ["block-1"]
    assert not found.refused


def test_a_listed_file_of_300_gb_is_refused_unread(inbox: Path) -> None:
    block = inbox / "block-1"
    with (block / "points.csv").open("wb") as stream:
        stream.truncate(300 * 10**9)
    (block / MARKER).write_text(f"{'0' * 64}  points.csv\n")
    begun = time.monotonic()
    refused = read(inbox).refused[block]
    assert "line 1" in refused
    assert "300,000 MB, more than the 4,000 MB" in refused
    assert time.monotonic() - begun < 5.0


def test_a_look_that_is_called_off_ends_before_a_large_file_is_read(inbox: Path) -> None:
    block = inbox / "block-1"
    with (block / "points.csv").open("wb") as stream:
        stream.truncate(3 * 10**9)
    (block / MARKER).write_text(f"{'0' * 64}  points.csv\n")
    asked: list[int] = []

    def is_over() -> bool:
        asked.append(1)
        return len(asked) == 3

    with pytest.raises(CalledOffError):
        read_inbox(inbox, roots_of([inbox]), is_over=is_over)
    assert len(asked) == 3
