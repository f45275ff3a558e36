"""Sentences about disks that cannot be written."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from tasks.files.installation import InstallationError, write_whole, writing_into
from tests.tasks.forked import fails_with_files_of_at_most


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
