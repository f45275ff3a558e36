"""Compiled kernels and the folder they are cached in.

numba's own cache looks at the file of a kernel only: after a change in a callee elsewhere it would
serve stale machine code. The cache folder therefore carries a digest of every source file of
``adjust`` in its name, so any change compiles afresh. Copies of the same sources share the folder.

Processes that need the same kernel at the same time compile it once: one compiles, the others wait for
its machine code. numba's own cache would have each compile it, and the last one to end would drop from the
index what the others have added.
"""

from __future__ import annotations

import fcntl
import hashlib
import logging
import math
import os
import stat
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import numba
import platformdirs
from numba.core import caching
from numba.core.compiler_lock import global_compiler_lock

_log = logging.getLogger("aerocal")

#: How often it is looked whether another process has compiled a kernel, s.
_LOOK_S = 0.02
# No kernel takes longer to compile, except on a machine with much else to do.
_PATIENCE_S = 10.0

_SOURCES = Path(__file__).resolve().parent


def source_digest() -> str:
    """Digest (16 hex digits) of the names and contents of all source files of ``adjust``."""
    digest = hashlib.sha256()
    for path in sorted(_SOURCES.rglob("*.py")):
        digest.update(path.relative_to(_SOURCES).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path:
    """The folder for the machine code of exactly these sources.

    AEROCAL_KERNEL_CACHE names another parent folder; where the user's cache cannot be written the
    system's temporary folder serves.
    """
    named = os.environ.get("AEROCAL_KERNEL_CACHE")
    parent = Path(named) if named else Path(platformdirs.user_cache_dir("aerocal")) / "kernels"
    folder = parent / source_digest()
    with suppress(OSError):
        return _made(folder)
    with suppress(OSError):
        return _made(_own_temporary_folder() / folder.name)
    return folder


def _made(folder: Path) -> Path:
    """The folder, after a file was made in it."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder):
        return folder


def _own_temporary_folder() -> Path:
    """A temporary folder that no other user may have written into: what lies there is executed."""
    folder = Path(tempfile.gettempdir()) / f"aerocal-kernels-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o022:
        raise PermissionError
    return folder


CACHE_FOLDER = _cache_folder()
numba.config.CACHE_DIR = str(CACHE_FOLDER)  # type: ignore[attr-defined]


class KernelPlace(caching.UserProvidedCacheLocator):
    """Where in the cache folder a kernel lies: by the place of its file in ``adjust``.

    numba goes by the whole path, so that every clone and every installation would compile for itself.
    """

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        """Name of the folder for the kernels of a file."""
        return "_".join(Path(py_file).resolve().relative_to(_SOURCES).parts[:-1])

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> Any:
        """The place of a kernel; None for functions of others, which numba then looks after itself."""
        ours = Path(py_file).resolve().is_relative_to(_SOURCES)
        return cls(py_func, py_file) if ours else None


# As NUMBA_CACHE_LOCATOR_CLASSES would set it.
numba.config.CACHE_LOCATOR_CLASSES = ",".join(  # type: ignore[attr-defined]
    [f"{__name__}.KernelPlace", *(place.__name__ for place in caching.CacheImpl._locator_classes)]
)


class KernelCache(caching.FunctionCache):
    """The stored machine code of a kernel. What cannot be read or stored is compiled."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The machine code for a signature; None if there is none, or none that can be read."""
        try:
            return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except Exception:
            # A power cut leaves empty and cut files, which numba would neither take nor ever replace.
            with suppress(OSError):
                self.flush()  # type: ignore[no-untyped-call]
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store the machine code for a signature."""
        try:
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]
        except OSError as error:
            _tell_what_prevents_storing(error.strerror)


@cache
def _tell_what_prevents_storing(reason: str | None) -> None:
    _log.warning(
        "compiled kernels cannot be stored in %s (%s), so that every run compiles them again (some 20 s). "
        "Set AEROCAL_KERNEL_CACHE to a folder that can be written",
        CACHE_FOLDER,
        reason,
    )


def is_warm() -> bool:
    """Whether machine code of these sources exists; otherwise the first run compiles them.

    What a simulation has compiled is little.
    """
    return any(file.parent.name != "simulate" for file in CACHE_FOLDER.glob("*/*.nbi"))


# C does not call any kernel, so none is compiled for it a second time.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True}


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function of arrays and numbers on its first call; cached, no fastmath, GIL released."""
    return _compiled_once(numba.njit(**_OPTIONS)(function))


def small_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same for a few lines that become a part of their callers.

    A call hands over every array as seven numbers: for one ray that would cost more than the lines do.
    """
    return _compiled_once(numba.njit(forceinline=True, **_OPTIONS)(function))


def _compiled_once(dispatcher: Any) -> Callable[..., Any]:
    """The kernel, which only one process at a time compiles or loads."""
    own_compile = getattr(dispatcher, "compile", None)
    if own_compile is not None:  # None: NUMBA_DISABLE_JIT is set
        name = f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__qualname__}"

        def compile_or_load(signature: Any) -> Any:
            # numba's own lock first: otherwise two threads could each hold what the other one waits for.
            with global_compiler_lock, _lock_of(name):
                return own_compile(signature)

        dispatcher.compile = compile_or_load
        # There may be no place for a function of others; it is then compiled in every process.
        with suppress(RuntimeError):
            dispatcher._cache = KernelCache(dispatcher.py_func)  # type: ignore[no-untyped-call]
    kernel: Callable[..., Any] = dispatcher
    return kernel


@contextmanager
def _lock_of(name: str) -> Iterator[None]:
    """Hold the operating system's lock of a kernel; none where the cache folder cannot be written."""
    try:
        handle = os.open(CACHE_FOLDER / f"{name}.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except OSError:
        yield
        return
    tell_at = time.monotonic() + _PATIENCE_S
    try:
        # Not in the system call: a signal that comes just before it would be heard of only after it.
        while not _locked(handle):
            time.sleep(_LOOK_S)
            if time.monotonic() > tell_at:
                tell_at = math.inf
                _tell_whom_it_waits_for(_holder(handle))
        yield
    finally:
        # A forked process shares the lock, so closing alone would not end it.
        with suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_UN)
        os.close(handle)


def _holder(handle: int) -> str:
    """Number of the process that holds the lock of a kernel, as Linux lists it; empty if it is not seen."""
    inode, locks = os.fstat(handle).st_ino, Path("/proc/locks")
    with suppress(OSError):
        # Such as "7: FLOCK ADVISORY WRITE 1234 fe:00:5678 0 EOF"; 0 is a process of another container.
        for _, kind, _, _, process, place, *_ in map(str.split, locks.read_text().splitlines()):
            if kind == "FLOCK" and int(process) > 0 and place.endswith(f":{inode}"):
                return process
    return ""


@cache
def _tell_whom_it_waits_for(holder: str) -> None:
    """Say once for which process this one waits, and what to do."""
    _log.warning(
        "waiting for process %s, which compiles kernels. If it is stopped, let it continue (kill -CONT) or "
        "end it (kill -KILL), or set AEROCAL_KERNEL_CACHE to another folder",
        holder or "of another machine",
    )


def _locked(handle: int) -> bool:
    """Whether there is nothing to wait for any more: the lock is held, or the file system has no locks."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True
