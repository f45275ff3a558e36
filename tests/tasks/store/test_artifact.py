"""The digest of a file is made once in a run, and again as soon as the file has changed."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest

from tasks.store import artifact
from tasks.store.artifact import digest_of_unchanged, forget_digests


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The files whose digests were made; one that has only just been written counts as old."""
    monkeypatch.setattr(artifact, "_TICK_NS", 0)
    found: list[Path] = []
    plain = artifact.digest_of_file

    def noted(path: Path) -> str:
        found.append(path)
        return plain(path)

    monkeypatch.setattr(artifact, "digest_of_file", noted)
    forget_digests()
    return found


def test_an_unchanged_file_is_read_once_in_a_run(tmp_path: Path, reads: list[Path]) -> None:
    file = tmp_path / "file"
    file.write_text("one")
    assert [digest_of_unchanged(file) for _ in range(3)] == [_digest("one")] * 3
    assert reads == [file]
    forget_digests()
    assert digest_of_unchanged(file) == _digest("one")
    assert reads == [file, file]


@pytest.mark.usefixtures("reads")
def test_a_changed_file_is_noticed_even_with_its_old_size_and_time(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("one")
    before = file.stat()
    assert digest_of_unchanged(file) == _digest("one")
    # Until the clock of the file system has moved on.
    while file.stat().st_ctime_ns == before.st_ctime_ns:
        file.write_text("two")
        os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert (file.stat().st_size, file.stat().st_mtime_ns) == (before.st_size, before.st_mtime_ns)
    assert digest_of_unchanged(file) == _digest("two")


@pytest.mark.usefixtures("reads")
def test_another_file_at_the_same_place_is_noticed(tmp_path: Path) -> None:
    file, other = tmp_path / "file", tmp_path / "other"
    file.write_text("one")
    other.write_text("two")
    assert digest_of_unchanged(file) == _digest("one")
    other.rename(file)
    assert digest_of_unchanged(file) == _digest("two")


def test_a_file_that_has_only_just_changed_is_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(artifact, "_TICK_NS", 10**15)
    forget_digests()
    file = tmp_path / "file"
    file.write_text("one")
    digest_of_unchanged(file)
    assert artifact._DIGESTS == {}


def test_a_clock_that_counts_seconds_is_known_by_its_times() -> None:
    assert artifact._tick_ns(1_764_000_000_000_000_000) == 10**9
    assert artifact._tick_ns(1_764_000_000_004_000_000) < 10**8
