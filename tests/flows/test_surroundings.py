"""How commands begin where a shell, a container or another program has left something unusual."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import typer

from flows.command.exit_code import end_with


def aerocal(
    *words: str | Path, cwd: Path | None = None, before: str = "", **variables: str
) -> subprocess.CompletedProcess[str]:
    """Carry out a command in a process of its own, `before` in a shell in front of it."""
    program = [sys.executable, "-m", "flows.command"]
    shell = ["sh", "-c", f'{before}\nexec "$@"', "sh"] if before else []
    return subprocess.run(
        [*shell, *program, *words],
        cwd=cwd,
        env={**os.environ, **variables},
        capture_output=True,
        encoding=variables.get("PYTHONIOENCODING", "utf-8"),
        check=False,
        timeout=60,
    )


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_characters_that_the_screen_does_not_have_are_shown_as_numbers(encoding: str) -> None:
    done = aerocal("sweep", "--help", PYTHONIOENCODING=encoding)
    assert (done.returncode, done.stderr) == (0, "")
    assert "PROJECT.toml" in done.stdout


def test_a_screen_of_unknown_width_gets_everything() -> None:
    # docker exec and Emacs set it to 0 so.
    assert "sweep" in aerocal("--help", COLUMNS="0").stdout
    assert "PROJECT.toml" in aerocal("run", COLUMNS="0").stderr


def test_a_current_folder_that_was_removed_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "gone").mkdir()
    done = aerocal("--version", cwd=tmp_path / "gone", before='rmdir "$PWD"')
    assert done.returncode == 1
    assert done.stderr.splitlines() == [
        "Error: The current folder does not exist any more. Change to another one, then run again."
    ]


@pytest.mark.parametrize("where", ["argument", "folder"])
def test_a_path_that_is_not_utf_8_is_one_sentence(where: str, block: Path, tmp_path: Path) -> None:
    folder = block.parent.rename(tmp_path / os.fsdecode(b"M\xfcller"))
    project = folder / block.name
    done = aerocal("run", project) if where == "argument" else aerocal("run", project.name, cwd=folder)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert "M\\udcfcller" in done.stderr
    assert not (folder / "results").exists()


@pytest.mark.parametrize("streams", ["2>&-", ">&-", "<&- >&- 2>&-", "2>/dev/full", "2>&1 >/dev/null | :"])
def test_a_run_whose_progress_nobody_can_read_is_carried_out(streams: str, warm_block: Path) -> None:
    report = warm_block.parent / "results" / "report.html"
    report.unlink()
    program = f'{shlex.quote(sys.executable)} -m flows.command run "$1" {streams}'
    done = subprocess.run(["bash", "-c", f"set -o pipefail; {program}", "sh", warm_block], check=False)
    assert done.returncode == 0
    assert report.exists()


def test_a_limited_size_of_files_is_one_sentence(block: Path) -> None:
    limited = (
        "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (2_000, 2_000))\n"
        "from flows.command.__main__ import main; main()"
    )
    command = [sys.executable, "-c", limited, "run", str(block)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "File too large" in done.stderr.splitlines()[-1]


def test_too_little_memory_is_one_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(typer.Exit) as ended:
        end_with(lambda: len(np.empty(2**57)))
    assert ended.value.exit_code == 1
    said = capsys.readouterr().err
    assert said.startswith("Error: There is not enough memory (Unable to allocate 1.00 EiB")
    assert len(said.splitlines()) == 1
