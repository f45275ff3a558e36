"""What an export replaces: what an export has written there, unchanged since."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.handover.written_files import STATEMENT, remove_written, write_files

FIRST, SECOND = {"eo.csv": "1\n", "block.bin": b"\1\2"}, {"eo.csv": "2\n", "block.bin": b"\1\3"}


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_an_export_is_repeated(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "eo"
    write_files(folder, FIRST, "About them.\n")
    write_files(folder, SECOND, "About them.\n")
    assert (folder / "eo.csv").read_text() == "2\n"
    assert (folder / "block.bin").read_bytes() == b"\1\3"
    assert (folder / STATEMENT).read_text().startswith("About them.\n\n")
    assert set(contents(folder)) == {*SECOND, STATEMENT}
    check = ["sha256sum", "--check", "--quiet", STATEMENT]
    assert subprocess.run(check, cwd=folder, check=False).returncode == 0
    (folder / "eo.csv").write_text("3\n")
    assert subprocess.run(check, cwd=folder, check=False).returncode == 1


@pytest.mark.parametrize("name", ["block.bin", STATEMENT])
@pytest.mark.parametrize("exported", [True, False])
def test_files_of_somebody_else_and_edited_ones_stay(tmp_path: Path, name: str, exported: bool) -> None:
    if exported:
        write_files(tmp_path, FIRST, "About them.\n")
    with (tmp_path / name).open("ab") as stream:
        stream.write(b"sent in May")
    before = contents(tmp_path)
    with pytest.raises(InputError, match=f"{name}: .* not by aerocal or was changed since"):
        write_files(tmp_path, SECOND, "About them.\n")
    assert contents(tmp_path) == before


def test_another_format_in_the_same_folder_can_be_repeated_too(tmp_path: Path) -> None:
    for _ in range(2):
        write_files(tmp_path, FIRST, "About them.\n")
        write_files(tmp_path, {"patb.ori": "1"}, "About others.\n")
    write_files(tmp_path, SECOND, "About them.\n")
    assert set(contents(tmp_path)) == {*SECOND, "patb.ori", STATEMENT}


def test_a_killed_export_is_stated_and_repeated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_files(tmp_path, FIRST, "About them.\n")

    def killed_at(_: Path, content: object) -> None:
        if content == b"\1\3":
            raise KeyboardInterrupt
        write_whole(_, content)

    from tasks.handover.written_files import write_whole

    with monkeypatch.context() as patch:
        patch.setattr("tasks.handover.written_files.write_whole", killed_at)
        with pytest.raises(KeyboardInterrupt):
            write_files(tmp_path, SECOND, "About them.\n")
    assert (tmp_path / STATEMENT).read_text().startswith("This export is not complete")
    write_files(tmp_path, {"eo.csv": "4\n", "block.bin": b"\4"}, "About them.\n")
    assert (tmp_path / "eo.csv").read_text() == "4\n"


def test_what_is_removed_is_what_was_written(tmp_path: Path) -> None:
    write_files(tmp_path, FIRST, "About them.\n")
    (tmp_path / "letter.txt").write_text("kept")
    (tmp_path / "eo.csv").write_text("edited")
    remove_written(tmp_path)
    assert set(contents(tmp_path)) == {"letter.txt", "eo.csv"}
