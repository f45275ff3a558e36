"""A child process of ``aerocal serve``: a group of its own, and an end when nobody holds it any more.

Run as a program (``python -m flows.serving.child HANDLE MODULE ARGUMENT …``) it carries out a module and
sends itself SIGTERM when the other end of the pipe HANDLE is closed: when the parent is killed, the runner
still drains, and the server, which the runner holds as well, ends after it.
"""

from __future__ import annotations

import contextlib
import os
import runpy
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

#: A log that is larger, bytes, is begun anew; the old one is kept once.
_LOG_BYTES = 20_000_000


class Lifeline:
    """A pipe that keeps a child going as long as somebody holds its one end.

    It outlasts the child: the next one that is started in its place is bound to it, too.
    """

    def __init__(self) -> None:
        self.reading, self.held = os.pipe()

    def release(self) -> None:
        """Hold it no longer; the child ends if nobody else does."""
        for handle in (self.reading, self.held):
            with contextlib.suppress(OSError):
                os.close(handle)


class Child:
    """A running child process.

    Parameters
    ----------
    module, arguments : what it carries out.
    environment : all its variables.
    log : file that its output is appended to.
    lifeline : what it lives on.
    holds : the lifelines of other children, which then outlive this one even if the parent is killed.
    """

    def __init__(
        self,
        module: str,
        *arguments: str,
        environment: Mapping[str, str],
        log: Path,
        lifeline: Lifeline,
        holds: Sequence[Lifeline] = (),
    ) -> None:
        handed_on = (lifeline.reading, *(other.held for other in holds))
        # Neither the folder we were started in nor any other a delivery lies in holds our modules.
        command = [sys.executable, "-P", "-m", __name__, str(lifeline.reading), module, *arguments]
        with _opened_log(log) as stream:
            self.process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=subprocess.STDOUT,
                env={**environment, "PYTHONSAFEPATH": "1"},
                cwd=log.parent,
                pass_fds=handed_on,
                start_new_session=True,
            )
        self.log = log

    @property
    def ended(self) -> bool:
        """Whether it has ended."""
        return self.process.poll() is not None

    def ask_to_end(self) -> None:
        """Send SIGTERM to the process itself; what it has started is its own affair."""
        with contextlib.suppress(ProcessLookupError):
            self.process.terminate()

    def wait(self, timeout_s: float) -> bool:
        """Wait until it has ended; whether it has."""
        try:
            self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return False
        return True

    def end_group(self, grace_s: float) -> None:
        """End it and all it has started: SIGTERM, and SIGKILL for what is left after a while."""
        self._signal_group(signal.SIGTERM)
        self.wait(grace_s)
        self._signal_group(signal.SIGKILL)
        self.process.wait()

    def begin_log_anew(self) -> None:
        """Keep a log that has grown large as the old one, and go on in an empty one.

        Lines written between the copy and the cut are lost; a few in a year.
        """
        # A full disk must not end the server: then the log stays as it is.
        with contextlib.suppress(OSError):
            if self.log.stat().st_size > _LOG_BYTES:
                shutil.copyfile(self.log, self.log.with_suffix(".old.log"))
                os.truncate(self.log, 0)

    def last_lines(self, number: int = 5) -> str:
        """The end of its log."""
        lines = self.log.read_text(encoding="utf-8", errors="replace").splitlines()
        return "\n".join(lines[-number:])

    def _signal_group(self, which: signal.Signals) -> None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.process.pid, which)


def _opened_log(log: Path) -> BinaryIO:
    log.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    if log.is_file() and log.stat().st_size > _LOG_BYTES:
        log.replace(log.with_suffix(".old.log"))
    return log.open("ab")


def _end_when_released(handle: int) -> None:
    """Wait until the other end of a pipe is closed everywhere, then end like one that was asked to."""
    os.read(handle, 1)
    os.kill(os.getpid(), signal.SIGTERM)


def main(arguments: list[str]) -> None:
    """Carry out a module in this process, bound to a pipe."""
    handle, module, *rest = arguments
    os.set_inheritable(int(handle), False)
    threading.Thread(target=_end_when_released, args=(int(handle),), daemon=True).start()
    sys.argv = [module, *rest]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main(sys.argv[1:])
