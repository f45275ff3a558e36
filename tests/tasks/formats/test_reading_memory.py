"""Reading a table of 200 MB takes at most twice its size and 300 MB, and a wrong one is refused in time."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

_MB = 1_000_000
SIZE = 200 * _MB
REFUSED_S = 10.0
_HEADER = b"image,point,x,y\n"
_PROGRAM = """
import resource, sys, time
from pathlib import Path
import pyarrow.csv
from tasks.errors import InputError
from tasks.formats.register import IMAGE_POINT_FORMATS
def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
before, began = peak(), time.process_time()
try:
    print(len(IMAGE_POINT_FORMATS[sys.argv[1]](Path(sys.argv[2])).line))
except InputError as error:
    print("refused", str(error)[:300].replace(chr(10), " "))
print(peak() - before, time.process_time() - began)
"""


def image_points(image: int) -> list[tuple[str, str, float, float]]:
    """A thousand points of an image, as many as five images have in common."""
    return [
        (f"21FD244720x00015_{image:05d}", f"tp{200 * image + k:07d}", 13.7 * k % 20_000, 7.3 * k)
        for k in range(1_000)
    ]


def as_csv(image: int) -> bytes:
    return "".join(f"{i},{p},{x:.3f},{y:.3f}\n" for i, p, x, y in image_points(image)).encode()


def as_mes(image: int) -> bytes:
    return "".join(f"{p} {i} {x:.3f} {y:.3f} \r\n" for i, p, x, y in image_points(image)).encode()


def read(file: Path, kind: str) -> tuple[str, int, float]:
    """What came of it, the memory it took beyond that of the imports, bytes, and the processor time, s."""
    command = [sys.executable, "-c", _PROGRAM, kind, str(file)]
    said, figures = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    memory, seconds = figures.split()
    return said, int(memory), float(seconds)


@pytest.mark.parametrize(
    ("kind", "rows", "end"),
    [
        ("csv", as_csv, b""),
        ("ign-mes", as_mes, b""),
        ("csv", as_csv, b"i,p,1,x\n"),
        ("csv", as_csv, b"i,p,1\n"),
    ],
)
def test_rows_as_they_are_delivered(tmp_path: Path, kind: str, rows: object, end: bytes) -> None:
    file, image = tmp_path / "points", 0
    with file.open("wb") as stream:
        stream.write(_HEADER if kind == "csv" else b"")
        while stream.tell() < SIZE:
            stream.write(rows(image))  # type: ignore[operator]
            image += 1
        stream.write(end)
    said, memory, seconds = read(file, kind)
    assert said.startswith(f"refused {file}:{1000 * image + 2}: ") if end else said == str(1000 * image)
    assert memory < 2 * SIZE + 300 * _MB
    print(f"\n{kind}: {memory / file.stat().st_size:.2f} of the file, {seconds:.1f} s")


@pytest.mark.parametrize(
    "piece",
    [
        b"x",
        b'"',
        b",",
        b"\0",
        b"\n",
        b"\r",
        b'"\n',
        b"\0\n",
        b",,,\n",
        b"," * 90_000 + b"\n",
        b"\xff,p,1,2\n",
    ],
    ids=repr,
)
def test_what_is_no_table(tmp_path: Path, piece: bytes) -> None:
    file = tmp_path / "points.csv"
    with file.open("wb") as stream:
        stream.write(_HEADER)
        some = piece * (_MB // len(piece) + 1)
        while stream.tell() < SIZE:
            stream.write(some)
    said, memory, seconds = read(file, "csv")
    assert said.startswith("refused ")
    assert memory < 2 * SIZE + 300 * _MB
    assert seconds < REFUSED_S
