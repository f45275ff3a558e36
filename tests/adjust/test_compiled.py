"""Compiled kernels are never served stale."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import adjust

# One kernel that calls another one of another file: the intersection of two rays that meet at
# (0, 0, 0), seen from (±100, 0, 1000) with c = 0.1.
PROGRAM = """
import numpy as np
from adjust.approximate import intersection_kernel
from adjust.compiled import CACHE_FOLDER
one = np.ones((2, 2))
points, angle, status = intersection_kernel.intersect(
    np.array([0, 2]), np.array([0, 1]), np.array([0, 0]),
    np.array([[-100.0, 0.0, 1000.0], [100.0, 0.0, 1000.0]]), np.stack([np.eye(3)] * 2),
    np.array([[0.1, 0.0, 0.0]]), np.array([[0.01, 0.0], [-0.01, 0.0]]), one,
)
print(CACHE_FOLDER.name, *np.round(points[0], 6) + 0.0)
"""

# What the kernel of the collinearity equations computes, and a version with the principal point 1 mm off.
CALLEE = "adjust/observations/image_point_kernel.py"
SOUND = "misclosure[row, 0] = (ideal[corrected, 0] - interior[camera, 1] - c * a) * wx"
CHANGED = "misclosure[row, 0] = (ideal[corrected, 0] - interior[camera, 1] - c * a + 0.001) * wx"


def copy_of_adjust(folder: Path) -> Path:
    shutil.copytree(
        Path(adjust.__file__).parent, folder / "adjust", ignore=shutil.ignore_patterns("__pycache__")
    )
    return folder


def replace_in(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert text.count(old) == 1
    file.write_text(text.replace(old, new))


def run(folder: Path, cache: Path) -> tuple[str, list[float]]:
    """Name of the cache folder and the intersected point, from a fresh process."""
    environment = {**os.environ, "AEROCAL_KERNEL_CACHE": str(cache), "PYTHONDONTWRITEBYTECODE": "1"}
    environment["PYTHONPATH"] = str(folder)
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    name, *numbers = done.stdout.split()
    return name, [float(number) for number in numbers]


def test_a_changed_callee_of_a_kernel_is_compiled_afresh(tmp_path: Path) -> None:
    folder, cache = copy_of_adjust(tmp_path / "sources"), tmp_path / "cache"
    first_name, first = run(folder, cache)
    assert first == [0.0, 0.0, 0.0]
    assert list((cache / first_name).rglob("*.nbi")), "machine code was cached"
    replace_in(folder / CALLEE, SOUND, CHANGED)
    second_name, second = run(folder, cache)
    assert second_name != first_name
    # One millimetre in both images moves the point 10 m: h/c · 1 mm.
    assert second == [10.0, 0.0, 0.0]
    replace_in(folder / CALLEE, CHANGED, SOUND)
    assert run(folder, cache) == (first_name, first)


def test_without_the_digest_in_the_folder_name_stale_code_would_be_served(tmp_path: Path) -> None:
    # The experiment that the folder's name is there for; should numba change this, it may go.
    folder, cache = copy_of_adjust(tmp_path / "sources"), tmp_path / "cache"
    replace_in(
        folder / "adjust/compiled.py", "    return digest.hexdigest()[:16]", '    return "always_the_same"'
    )
    _, first = run(folder, cache)
    replace_in(folder / CALLEE, SOUND, CHANGED)
    _, second = run(folder, cache)
    assert first == second == [0.0, 0.0, 0.0]


def test_a_cache_that_cannot_be_written_gives_way_to_the_temporary_folder(tmp_path: Path) -> None:
    folder, occupied = copy_of_adjust(tmp_path / "sources"), tmp_path / "a_file"
    occupied.write_text("not a folder")
    program = "from adjust.compiled import CACHE_FOLDER; print(CACHE_FOLDER)"
    environment = {**os.environ, "AEROCAL_KERNEL_CACHE": str(occupied), "TMPDIR": str(tmp_path)}
    environment["PYTHONPATH"] = str(folder)
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert Path(done.stdout.strip()).parent.parent == tmp_path
