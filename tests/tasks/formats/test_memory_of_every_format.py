"""Reading a large file of any format takes at most twice its size and 200 MB beyond what is imported."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.tasks.formats.large_files import DOCUMENTS, LARGE
from tests.tasks.formats.sound_files import SOUND

_MB = 1_000_000
# A document is read as a whole, and has at most 20 MB.
_SIZE, _DOCUMENT = 40 * _MB, 19 * _MB
_PROGRAM = """
import sqlite3, sys, time
from pathlib import Path
import pandas, pyarrow.csv, pyproj, scipy.sparse.csgraph
from benchmarks.machine import peak_memory_mib
from tests.tasks.formats.sound_files import READERS
reader = READERS[sys.argv[1]][sys.argv[2]]
before, began = peak_memory_mib(), time.process_time()
assert reader(Path(sys.argv[3])) is not None
print((peak_memory_mib() - before) * 2**20, time.process_time() - began)
"""


def test_every_reader_of_the_registers_has_a_large_file():
    assert set(LARGE) == set(SOUND)


@pytest.mark.slow
@pytest.mark.parametrize("key", LARGE, ids="-".join)
def test_memory_of_a_large_file(key: tuple[str, str], tmp_path: Path):
    file = tmp_path / "file"
    LARGE[key](file, _DOCUMENT if key in DOCUMENTS else _SIZE)
    command = [sys.executable, "-c", _PROGRAM, *key, str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    memory, seconds = map(float, done.split())
    size = file.stat().st_size
    print(f"\n{size / _MB:.0f} MB: {memory / _MB:.0f} MB beyond the imports, {seconds:.1f} s")
    assert memory < 2 * size + 200 * _MB
