"""Arrays that follow others of the same size need no new pages."""

import os
import subprocess
import sys

_PROGRAM = """
import sys
from flows.runs.freed_memory import keep_freed_memory

if sys.argv[1] == "kept":
    keep_freed_memory()

import resource
import numpy as np

def pages():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    arrays = [np.ones(3 * 2**20) for _ in range(4)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

print([pages() for _ in range(6)][-1])
"""


def _pages(how, **more):
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MALLOC_")}
    environment["NUMPY_MADVISE_HUGEPAGE"] = "0"
    ended = subprocess.run(
        [sys.executable, "-c", _PROGRAM, how],
        env={**environment, **more},
        capture_output=True,
        text=True,
        check=True,
    )
    return int(ended.stdout)


def test_arrays_that_follow_others_need_no_new_pages():
    # Four arrays of 24 MB are 24,576 pages of 4 KB.
    assert _pages("returned") > 20_000
    assert _pages("kept") < 100


def test_settings_of_the_environment_remain():
    assert _pages("kept", MALLOC_TRIM_THRESHOLD_="1000000") > 5_000
