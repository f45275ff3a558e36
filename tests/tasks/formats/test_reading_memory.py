"""Reading a table of 200 MB takes at most twice its size and 300 MB, and a wrong one is refused in time."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

_MB = 1_000_000
SIZE = 200 * _MB
REFUSED_S = 10.0
Rows: TypeAlias = Callable[[int], bytes]
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
def test_rows_as_they_are_delivered(tmp_path: Path, kind: str, rows: Rows, end: bytes) -> None:
    file, image = tmp_path / "points", 0
    with file.open("wb") as stream:
        stream.write(_HEADER if kind == "csv" else b"")
        while stream.tell() < SIZE:
            stream.write(rows(image))
            image += 1
        stream.write(end)
    said, memory, seconds = read(file, kind)
    assert said.startswith(f"refused {file}:{1000 * image + 2}: ") if end else said == str(1000 * image)
    assert memory < 2 * SIZE + 300 * _MB
    print(f"\n{kind}: {memory / file.stat().st_size:.2f} of the file, {seconds:.1f} s")


def with_own_names(image: int) -> bytes:
    return "".join(
        f"{i},{p}{k:03d},{x:.3f},{y:.3f}\n" for k, (i, p, x, y) in enumerate(image_points(image))
    ).encode()


def short_with_own_names(image: int) -> bytes:
    return "".join(f"i,p{1_000 * image + k:08d},1,2\n" for k in range(1_000)).encode()


def with_own_images_and_names(image: int) -> bytes:
    return "".join(
        f"im{1_000 * image + k:08d},tp{1_000 * image + k:08d},1,2\n" for k in range(1_000)
    ).encode()


def rows_of_eight_bytes(_: int) -> bytes:
    return b"i,p,1,2\n" * 1_000


@pytest.mark.parametrize("size", [40 * _MB, SIZE])
@pytest.mark.parametrize(
    "rows", [with_own_names, short_with_own_names, with_own_images_and_names, rows_of_eight_bytes]
)
def test_short_rows_and_names_of_their_own(tmp_path: Path, rows: Rows, size: int) -> None:
    file, count = tmp_path / "points.csv", 0
    with file.open("wb") as stream:
        stream.write(_HEADER)
        while stream.tell() < size:
            stream.write(rows(count))
            count += 1
    said, memory, seconds = read(file, "csv")
    if size < SIZE or rows is with_own_names:
        assert said == str(1_000 * count)
    else:
        assert "more than twice its size" in said
        assert seconds < REFUSED_S
    assert memory < 2 * size + 300 * _MB
    print(f"\n{memory / size:.2f} of the file, {seconds:.1f} s: {said[:100]}")


@pytest.mark.parametrize(
    ("rows", "end", "what"),
    [
        (as_csv, b"i,p,1,x\n", "'x' in the column 'y' is not a number"),
        (lambda _: (b"," * 90_000 + b"\n") * 11, b"", "more than 4 columns"),
    ],
    ids=["last line wrong", "lines of commas"],
)
def test_a_gigabyte_is_refused_in_time(tmp_path: Path, rows: Rows, end: bytes, what: str) -> None:
    file, count = tmp_path / "points.csv", 0
    with file.open("wb") as stream:
        stream.write(_HEADER)
        while stream.tell() < 1_000 * _MB:
            stream.write(rows(count))
            count += 1
        stream.write(end)
    said, memory, seconds = read(file, "csv")
    assert what in said
    assert memory < 2 * file.stat().st_size + 300 * _MB
    assert seconds < REFUSED_S
    print(f"\n{memory / file.stat().st_size:.2f} of the file, {seconds:.1f} s: {said[:100]}")


NO_TABLE = {
    "one line": b"x",
    "quotation marks": b'"',
    "commas": b",",
    "NULs": b"\0",
    "line feeds": b"\n",
    "returns": b"\r",
    "open quotation marks": b'"\n',
    "NULs in lines": b"\0\n",
    "empty fields": b",,,\n",
    "very many fields": b"," * 90_000 + b"\n",
    "no text": b"\xff,p,1,2\n",
}


@pytest.mark.parametrize("piece", NO_TABLE.values(), ids=NO_TABLE)
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
