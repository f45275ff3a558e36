"""Memory that arrays have freed stays with the process, for the arrays that follow.

An adjustment makes and frees arrays of some 10 MB thousands of times. By default, the allocator returns them
to the system, which clears every page when it is used again: a tenth of the processor time of a run.
"""

from __future__ import annotations

import ctypes
import os

# Parameters of mallopt(3), in malloc.h.
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8
#: Larger arrays are returned at once; the largest value that glibc accepts.
_KEPT_BYTES = 32 * 1024 * 1024


def keep_freed_memory() -> None:
    """Set up the allocator of this process; must be called before NumPy is loaded.

    It does nothing where the C library has no such settings, or the environment (``MALLOC_…``) has its own.
    """
    # Huge pages are cleared as a whole, also for the part of an array that nothing is written to.
    os.environ.setdefault("NUMPY_MADVISE_HUGEPAGE", "0")
    if any(name.startswith("MALLOC_") for name in os.environ):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_MMAP_THRESHOLD, _KEPT_BYTES)
        mallopt(_TRIM_THRESHOLD, -1)  # never
        # What one thread has freed, another can use.
        mallopt(_ARENA_MAX, 1)
