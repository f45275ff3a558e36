"""The program ``aerocal``, also as ``python -m flows.command``."""

from __future__ import annotations

import errno
import gc
import os
import sys
from io import TextIOWrapper
from pathlib import Path

try:
    _HERE = str(Path.cwd())
except FileNotFoundError:
    sys.exit("Error: The current folder does not exist any more. Change to another one, then run again.")
# What lies in the folder of a delivery is data. This process may have been started with `python -m`, and
# those it starts would look for modules there.
if not sys.flags.safe_path and sys.path[0] in ("", _HERE):
    del sys.path[0]
os.environ["PYTHONSAFEPATH"] = "1"
if sys.platform == "win32":
    sys.exit("aerocal needs file locks and signals of Linux. On Windows, run it in WSL 2 or in a container.")

from flows.command.interruption import end_on_signals
from flows.runs.freed_memory import keep_freed_memory

_FULL = (errno.ENOSPC, errno.EDQUOT)


def main() -> None:
    """Run the command line; ends the process with the documented exit code."""
    end_on_signals(_command_line)


def _command_line() -> None:
    # Most commands end before there is garbage worth a search, and their libraries' objects stay.
    gc.set_threshold(1_000_000)
    keep_freed_memory()
    # Threads of the linear algebra would wait for the processors that ours use, here and in what this starts.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    _open_closed_streams()
    _require_paths_in_utf8()
    _take_every_screen()
    from flows.command.main import app

    try:
        try:
            app()
        finally:
            _flush()
    except OSError as error:
        # Of a file there is its name; what was printed has none.
        if error.errno not in _FULL or error.filename is not None:
            raise
        _print_nothing_more()
        sys.exit(
            f"Error: What was printed could not be written ({error.strerror}). Free some space and run again."
        )


def _open_closed_streams() -> None:
    """Let streams that were closed lead nowhere; the next file that is opened would take their place."""
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), "r" if name == "stdin" else "w"))


def _require_paths_in_utf8() -> None:
    """End with exit code 2 if a path could not be stated in the results, which are in UTF-8."""
    for text in (_HERE, *sys.argv[1:]):
        try:
            text.encode()
        except UnicodeEncodeError:
            print(f"Error: {text!a} is not UTF-8. Rename it, or set PYTHONUTF8=1 if it is.", file=sys.stderr)
            sys.exit(2)


def _take_every_screen() -> None:
    """Print on screens with fewer characters than Unicode has, and on those of which no width is known."""
    if isinstance(sys.stdout, TextIOWrapper):
        # As stderr does.
        sys.stdout.reconfigure(errors="backslashreplace")
    if os.environ.get("COLUMNS") == "0":
        # So docker and Emacs say that they do not know; Rich would print nothing.
        del os.environ["COLUMNS"]


def _flush() -> None:
    """Write what was printed, which the interpreter would do with an exit code of its own (120).

    Raises
    ------
    OSError
        If there is no space for it.
    """
    try:
        sys.stdout.flush()
    except (AttributeError, ValueError):
        # Closed by whoever started the command.
        return
    except OSError as error:
        if error.errno in _FULL:
            raise
        # Closed by whoever read it.
        _print_nothing_more()


def _print_nothing_more() -> None:
    """Drop what is left in the buffer, so that it does not fail again at the end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    main()
