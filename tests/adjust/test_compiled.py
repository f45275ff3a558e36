"""Compiled kernels are never served stale."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import adjust
from adjust import compiled

# A kernel that calls another one of another file. Our own behave alike and take ten times as long to compile.
CALLER = """
import numpy as np
from adjust.callee_kernel import height
from adjust.compiled import kernel
@kernel
def heights(scale):
    result = np.empty(len(scale))
    for i in range(len(scale)):
        result[i] = height(scale[i])
    return result
"""
CALLEE = """
from adjust.compiled import small_kernel
@small_kernel
def height(scale):
    return 0.1 * scale
"""
SOUND, CHANGED = "0.1 * scale", "0.1 * scale + 1.0"
PROGRAM = """
import numpy as np
from adjust.caller_kernel import heights
from adjust.compiled import CACHE_FOLDER
print(CACHE_FOLDER.name, *np.round(heights(np.array([1000.0, 2000.0])), 6))
print("compiled:", sum(heights.stats.cache_misses.values()))
"""


def copy_of_adjust(folder: Path) -> Path:
    shutil.copytree(Path(adjust.__file__).parent, folder / "adjust")
    (folder / "adjust" / "caller_kernel.py").write_text(CALLER)
    (folder / "adjust" / "callee_kernel.py").write_text(CALLEE)
    return folder


def replace_in(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert text.count(old) == 1
    file.write_text(text.replace(old, new))


def environment_of(folder: Path, cache: Path) -> dict[str, str]:
    """That of a process with these sources and this cache."""
    own = {"AEROCAL_KERNEL_CACHE": str(cache), "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    return {**os.environ, **own}


def run_all(
    folder: Path, cache: Path, program: str = PROGRAM, **variables: str
) -> subprocess.CompletedProcess[str]:
    """What a fresh process prints."""
    return subprocess.run(
        [sys.executable, "-c", program],
        cwd=folder,
        env={**environment_of(folder, cache), **variables},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )


def run(folder: Path, cache: Path, compiled: bool = True) -> tuple[str, list[float]]:
    """Name of the cache folder and the heights, from a fresh process that has to compile or not."""
    done = run_all(folder, cache)
    heights, compilations = done.stdout.splitlines()
    assert compilations == f"compiled: {int(compiled)}"
    name, *numbers = heights.split()
    return name, [float(number) for number in numbers]


def test_a_changed_callee_of_a_kernel_is_compiled_afresh(tmp_path: Path) -> None:
    folder, cache = copy_of_adjust(tmp_path / "sources"), tmp_path / "cache"
    first_name, first = run(folder, cache)
    assert first == [100.0, 200.0]
    assert list((cache / first_name).rglob("*.nbi")), "machine code was cached"
    replace_in(folder / "adjust" / "callee_kernel.py", SOUND, CHANGED)
    second_name, second = run(folder, cache)
    assert second_name != first_name
    assert second == [101.0, 201.0]
    replace_in(folder / "adjust" / "callee_kernel.py", CHANGED, SOUND)
    # As it was before, and in another place: copies share machine code.
    copy = shutil.copytree(folder, tmp_path / "copy")
    assert run(copy, cache, compiled=False) == (first_name, first)


@pytest.mark.slow
def test_without_the_digest_in_the_folder_name_stale_code_would_be_served(tmp_path: Path) -> None:
    # The experiment that the folder's name is there for; should numba change this, it may go.
    folder, cache = copy_of_adjust(tmp_path / "sources"), tmp_path / "cache"
    replace_in(
        folder / "adjust/compiled.py", "    return digest.hexdigest()[:16]", '    return "always_the_same"'
    )
    _, first = run(folder, cache)
    replace_in(folder / "adjust" / "callee_kernel.py", SOUND, CHANGED)
    _, second = run(folder, cache, compiled=False)
    assert first == second == [100.0, 200.0]


def test_processes_that_start_at_one_moment_compile_a_kernel_once(tmp_path: Path) -> None:
    folder, cache, begin = copy_of_adjust(tmp_path / "sources"), tmp_path / "cache", tmp_path / "begin"
    program = f"""
import pathlib, sys, time
import numpy as np
from adjust.callee_kernel import height
from adjust.caller_kernel import heights
print("ready", flush=True)
while not pathlib.Path({str(begin)!r}).exists():
    time.sleep(0.001)
assert heights(np.array([1000.0])) == [100.0]
print(*(sum(one.stats.cache_misses.values()) for one in (height, heights)))
"""
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", program],
            env=environment_of(folder, cache),
            cwd=folder,
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    assert [process.stdout.readline() for process in processes if process.stdout] == ["ready\n"] * 2
    begin.touch()
    compiled = sorted(process.communicate(timeout=120)[0] for process in processes)
    assert compiled == ["0 0\n", "1 1\n"]


def test_a_process_that_waits_for_one_that_was_stopped_says_so_once(tmp_path: Path) -> None:
    folder, cache = copy_of_adjust(tmp_path / "sources"), tmp_path / "cache"
    replace_in(folder / "adjust" / "compiled.py", "_PATIENCE_S = 10.0", "_PATIENCE_S = 0.1")
    stopped = """
import os, signal
from adjust.compiled import _lock_of
with _lock_of("adjust.callee_kernel.height"), _lock_of("adjust.caller_kernel.heights"):
    os.kill(os.getpid(), signal.SIGSTOP)
"""
    options: dict[str, Any] = {"env": environment_of(folder, cache), "cwd": folder, "text": True}
    holder = subprocess.Popen([sys.executable, "-c", stopped], **options)
    try:
        os.waitid(os.P_PID, holder.pid, os.WSTOPPED)
        waiting = subprocess.Popen(
            [sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options
        )
        assert waiting.stderr is not None
        said = waiting.stderr.readline()
        assert f"waiting for process {holder.pid}, which compiles kernels" in said
    finally:
        holder.send_signal(signal.SIGCONT)
    numbers, rest = waiting.communicate(timeout=120)
    assert rest == ""
    assert numbers.endswith("100.0 200.0\ncompiled: 1\n")
    assert holder.wait(timeout=10) == 0


def test_a_cache_that_cannot_be_written_gives_way_to_the_temporary_folder(tmp_path: Path) -> None:
    folder, occupied = copy_of_adjust(tmp_path / "sources"), tmp_path / "a_file"
    occupied.write_text("not a folder")
    program = "from adjust.compiled import CACHE_FOLDER; print(CACHE_FOLDER)"
    done = run_all(folder, occupied, program, TMPDIR=str(tmp_path))
    assert Path(done.stdout.strip()).parent.parent == tmp_path


def test_a_simulation_leaves_most_to_be_compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "CACHE_FOLDER", tmp_path)
    for part, warm in (("simulate", False), ("georeferencing", True)):
        (tmp_path / part).mkdir()
        (tmp_path / part / "kernel-1.py311.nbi").touch()
        assert compiled.is_warm() is warm


@pytest.mark.parametrize("others", ["may write there", "have linked it"])
def test_machine_code_of_a_temporary_folder_that_is_not_ours_alone_is_not_loaded(
    tmp_path: Path, others: str
) -> None:
    folder, occupied = copy_of_adjust(tmp_path / "sources"), tmp_path / "a_file"
    occupied.write_text("not a folder")
    temporary = tmp_path / f"aerocal-kernels-{os.getuid()}"
    if others == "have linked it":
        (tmp_path / "theirs").mkdir()
        temporary.symlink_to(tmp_path / "theirs")
    else:
        temporary.mkdir()
        temporary.chmod(0o777)
    done = run_all(folder, occupied, TMPDIR=str(tmp_path))
    assert done.stdout.splitlines()[1] == "compiled: 1"
    assert not list(temporary.iterdir())
    assert done.stderr.count("kernels cannot be stored") == 1
    assert str(occupied) in done.stderr


def test_machine_code_that_cannot_be_stored_is_compiled_in_every_process(tmp_path: Path) -> None:
    folder, cache = copy_of_adjust(tmp_path / "sources"), tmp_path / "cache"
    full = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n"
    for _ in range(2):
        done = run_all(folder, cache, program=full + PROGRAM)
        assert done.stdout.endswith("100.0 200.0\ncompiled: 1\n")
        assert done.stderr.count("kernels cannot be stored") == 1
    assert "AEROCAL_KERNEL_CACHE" in done.stderr


@pytest.mark.parametrize(("damaged", "left"), [("*.nbi", 0), ("*.nbc", 100)])
def test_damaged_machine_code_is_compiled_afresh(tmp_path: Path, damaged: str, left: int) -> None:
    # After a power cut, files may be empty or end early.
    folder, cache = copy_of_adjust(tmp_path / "sources"), tmp_path / "cache"
    sound = run(folder, cache)
    files = list(cache.rglob(damaged))
    assert files
    for file in files:
        os.truncate(file, left)
    assert run(folder, cache) == sound
    assert run(folder, cache, compiled=False) == sound
