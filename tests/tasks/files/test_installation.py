"""Sentences about disks that cannot be written."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from tasks.files.installation import InstallationError, writing_into


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EACCES])
@pytest.mark.parametrize("option", ["--out", None])
def test_another_folder_is_advised_where_an_option_names_it(
    tmp_path: Path, number: int, option: str | None
) -> None:
    with pytest.raises(InstallationError) as raised, writing_into(tmp_path, option):
        raise OSError(number, "cannot be written", str(tmp_path / "file"))
    assert ("another folder with --out" in raised.value.remedy) is (option is not None)
