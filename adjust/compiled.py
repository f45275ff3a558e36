"""Compiled kernels and the folder they are cached in.

numba's own cache looks at the file of a kernel only: after a change in a callee elsewhere it would
serve stale machine code. The cache folder therefore carries a digest of every source file of
``adjust`` in its name, so any change compiles afresh.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import platformdirs


def source_digest() -> str:
    """Digest (16 hex digits) of the names and contents of all source files of ``adjust``."""
    root = Path(__file__).parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path:
    """A writable folder for the machine code of exactly these sources.

    AEROCAL_KERNEL_CACHE names another parent folder; where the user's cache cannot be written the
    system's temporary folder serves.
    """
    named = os.environ.get("AEROCAL_KERNEL_CACHE")
    parent = Path(named) if named else Path(platformdirs.user_cache_dir("aerocal")) / "kernels"
    folder = parent / source_digest()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        return Path(tempfile.gettempdir()) / f"aerocal-kernels-{os.getuid()}" / folder.name


CACHE_FOLDER = _cache_folder()
numba.config.CACHE_DIR = str(CACHE_FOLDER)  # type: ignore[attr-defined]


def is_warm() -> bool:
    """Whether machine code of these sources is there already; otherwise the first run compiles."""
    return next(CACHE_FOLDER.rglob("*.nbi"), None) is not None


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function of arrays and numbers on its first call; cached, no fastmath, GIL released."""
    compiled: Callable[..., Any] = numba.njit(cache=True, error_model="numpy", nogil=True)(function)
    return compiled


def small_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same for a few lines that become a part of their callers.

    A call hands over every array as seven numbers: for one ray that would cost more than the lines do.
    """
    compiled: Callable[..., Any] = numba.njit(cache=True, error_model="numpy", nogil=True, forceinline=True)(
        function
    )
    return compiled
