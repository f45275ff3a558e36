"""Sentences about disks that cannot be written."""

from __future__ import annotations

import errno
import os
import time
from pathlib import Path

import pytest

from tasks.files.installation import (
    InstallationError,
    part_of,
    remove_abandoned,
    write_whole,
    writing_into,
)
from tests.tasks.forked import FORK, fails_with_files_of_at_most


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EACCES])
@pytest.mark.parametrize("option", ["--out", None])
def test_another_folder_is_advised_where_an_option_names_it(
    tmp_path: Path, number: int, option: str | None
) -> None:
    with pytest.raises(InstallationError) as raised, writing_into(tmp_path, option):
        raise OSError(number, "cannot be written", str(tmp_path / "file"))
    assert ("another folder with --out" in raised.value.remedy) is (option is not None)


@pytest.mark.parametrize("before", [None, "before"])
def test_a_full_disk_leaves_no_part_of_a_file_and_what_was_there(tmp_path: Path, before: str | None) -> None:
    file = tmp_path / "a.svg"
    if before is not None:
        file.write_text(before)
    assert fails_with_files_of_at_most(1_000, lambda: write_whole(file, "x" * 2_000))
    assert [(one.name, one.read_text()) for one in tmp_path.iterdir()] == [("a.svg", before)][
        : before is not None
    ]
    write_whole(file, "x" * 2_000)
    assert file.read_text() == "x" * 2_000


def test_a_link_keeps_leading_to_its_file_and_a_pipe_stays_one(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "there" / "file")
    write_whole(tmp_path / "link", "text")
    assert (tmp_path / "there" / "file").read_text() == "text"
    read, write = os.pipe()
    write_whole(Path(f"/dev/fd/{write}"), b"bytes")
    assert os.read(read, 5) == b"bytes"
    os.close(read)
    os.close(write)


def test_what_a_process_that_has_ended_left_is_removed_and_nothing_else(tmp_path: Path) -> None:
    def begin_and_end() -> None:
        part_of(tmp_path / "table.csv").write_text("half")
        part_of(tmp_path / "image.tif").with_suffix(".part.cog").write_text("half")
        os._exit(0)

    process = FORK.Process(target=begin_and_end)
    process.start()
    process.join()
    left = {path.name for path in tmp_path.iterdir()}
    assert len(left) == 2
    number = str(process.pid)
    kept = [
        part_of(tmp_path / "a.csv").name, ".aerocal.part", f".aerocal.other.{number}.01234567.part",
        next(name for name in left).replace(number, "1"), f".{number}.part", "a.csv",
    ]  # fmt: skip
    for name in kept:
        (tmp_path / name).touch()
    remove_abandoned(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(kept)
    remove_abandoned(tmp_path / "nowhere")


def test_parts_are_removed_on_any_machine_when_nobody_has_written_into_them_for_a_day(tmp_path: Path) -> None:
    of_living, of_others = part_of(tmp_path / "a.csv"), ".aerocal.4f0c1d2e3a5b.7.01234567.part"
    names = (of_living.name, of_others, f"{of_others}.cog", "a.part", ".a.7.part")
    for hours, left in ((23, set(names)), (25, set(names[3:]))):
        for name in names:
            (tmp_path / name).touch()
            os.utime(tmp_path / name, (time.time() - 3600 * hours,) * 2)
        remove_abandoned(tmp_path)
        assert {path.name for path in tmp_path.iterdir()} == left


def test_two_files_are_written_at_once_under_two_names(tmp_path: Path) -> None:
    assert part_of(tmp_path / "a.csv") != part_of(tmp_path / "b.csv")
