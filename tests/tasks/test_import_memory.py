"""The import of image points takes at most twice the file and 300 MB beyond what a process has anyway."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.importing import imported, write_delivery

_MB, _MIB = 1e6, 2**20


def memory_within_limit(
    folder: Path, count: int, row: str, refused: str = "", besides: float = 300 * _MB
) -> None:
    """Import so many rows and compare with the limit; part of why they are refused, if they are."""
    file = write_delivery(folder, count, row)
    done = imported(folder, folder / "results")
    size = file.stat().st_size
    assert refused in done.refused
    # But for the first and last two images', every point has three rays.
    assert bool(refused) == bool(done.refused) == (done.rows < count - 1_000)
    assert done.memory_mib * _MIB < 2 * size + besides
    print(f"\n{size / _MB:.0f} MB: {done.memory_mib * _MIB / size:.2f} of the file, {done.processor_s:.1f} s")


def test_a_file_of_six_megabytes(tmp_path: Path) -> None:
    # Of short rows, which need most memory for the size of their file. It takes 80 MB; 200 bytes more for
    # each row, which a million rows would need to exceed 300 MB besides, exceed 120 MB here.
    memory_within_limit(tmp_path, 250_000, "{image},{point},{x:.0f},{y:.0f}", besides=120 * _MB)


@pytest.mark.slow
@pytest.mark.parametrize("count", [2_000_000, 6_000_000])
@pytest.mark.parametrize(
    ("row", "refused"),
    [
        ("{image},{point:06d},{x:.3f},{y:.3f}", ""),
        ("{image},{point},{x:.0f},{y:.0f}", ""),
        ("{image},{point},1,2", "exactly the same position"),
        ("{image},a-long-name-of-a-tie-point-{point:012d},{x:.6f},{y:.6f}", ""),
        ("{image},{own:09d},{x:.3f},{y:.3f}", "No point is measured in two images"),
        (
            "{image},a-long-name-of-a-tie-point-{own:012d},{x:.6f},{y:.6f}",
            "No point is measured in two images",
        ),
        ("{image},{point},7000,{y:.3f}", ""),
        ("{image},7,{x:.3f},{y:.3f}", "already given in line 2"),
        ("{image},{own:09d},{x:.3f},12000", "lies outside"),
    ],
    ids=[
        "ordinary",
        "short",
        "one place",
        "long names",
        "own names",
        "long own names",
        "one half",
        "one point",
        "outside",
    ],
)
def test_other_files(tmp_path: Path, row: str, refused: str, count: int) -> None:
    memory_within_limit(tmp_path, count, row, refused)
