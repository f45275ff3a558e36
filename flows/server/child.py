"""A child process of ``aerocal serve``: restarted when it ends, and ended with its parent.

It fills the gap that one command on one machine leaves where neither systemd nor a container engine looks
after each process. Run as a program (``python -m flows.server.child HANDLE MODULE``) it carries out a module
and sends itself SIGTERM when the other end of the pipe HANDLE is closed: when the parent is killed, the
runner still drains, and the server, which the runner holds as well, ends after it.
"""

from __future__ import annotations

import contextlib
import gc
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import FrameType

from tasks.files.installation import InstallationError
from tasks.patience import Patience

#: A log that is larger, bytes, is started again; the old one is kept once.
_LOG_BYTES = 20_000_000
#: How long processes that have been killed may be seen, s.
_REMOVED_S = 2.0


class Lifeline:
    """A pipe that keeps a child alive as long as a process holds its other end.

    It outlasts the child: the next one that is started in its place is bound to it, too.
    """

    def __init__(self) -> None:
        self.reading, self.held = os.pipe()

    def release(self) -> None:
        """Release it; the child ends unless another process holds it."""
        for handle in (self.reading, self.held):
            with contextlib.suppress(OSError):
                os.close(handle)


class Child:
    """A running child process.

    Parameters
    ----------
    module : its `main` is carried out.
    environment : all its variables.
    log : file that its output is appended to.
    lifeline : what it lives on.
    holds : the lifelines of other children, which then outlive this one even if the parent is killed.
    """

    def __init__(
        self,
        module: str,
        environment: Mapping[str, str],
        log: Path,
        lifeline: Lifeline,
        holds: Sequence[Lifeline] = (),
    ) -> None:
        handed_on = (lifeline.reading, *(other.held for other in holds))
        # Neither the folder we were started in nor any other a delivery lies in holds our modules.
        command = [sys.executable, "-P", "-m", __name__, str(lifeline.reading), module]
        log.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with log.open("ab") as stream:
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

    def wait(self, timeout_s: float) -> bool:
        """Wait until it has ended; returns whether it has."""
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
        # What it has started belongs to the system now, which removes it after a moment.
        until = time.monotonic() + _REMOVED_S
        while self._signal_group(0) and time.monotonic() < until:
            time.sleep(0.02)

    def begin_log_anew(self) -> None:
        """Rename a log that has grown large, and continue in an empty one.

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

    def _signal_group(self, which: int) -> bool:
        """Send a signal to it and all it has started; returns whether there is anything left."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.process.pid, which)
            return True
        return False


def _end_when_released(handle: int) -> None:
    """Wait until the other end of a pipe is closed everywhere, then end as if asked to."""
    os.read(handle, 1)
    os.kill(os.getpid(), signal.SIGTERM)


def main(handle: int, module: str) -> None:
    """Carry out a module in this process, bound to a pipe."""
    os.set_inheritable(handle, False)
    threading.Thread(target=_end_when_released, args=(handle,), daemon=True).start()
    # Prefect makes hundreds of thousands of objects when it is loaded, and all of them stay.
    gc.set_threshold(50_000)
    import_module(module).main()


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])


#: What a child gets to end once nothing runs any more, s.
END_S = 30.0
#: So many ends within so many seconds mean that starting it again does not help. A database may well be away
#: for a quarter of an hour.
_ENDS = 20
_PATIENCE = Patience(1.0, 60.0, 3600.0)

Say = Callable[[str], None]


class Requests:
    """How often the process was asked to end (SIGTERM, interrupt key)."""

    def __init__(self) -> None:
        self.number = 0
        self.come = threading.Event()

    def note(self, _signal: int, _frame: FrameType | None) -> None:
        """A signal has come."""
        self.number += 1
        self.come.set()


@contextmanager
def requests_to_end() -> Iterator[Requests]:
    """Note requests to end while the context lasts, in place of ending at once."""
    requests = Requests()
    # Nobody else is to end the process over them (`flows.command.interruption`).
    wakeup = signal.set_wakeup_fd(-1)
    before = {which: signal.signal(which, requests.note) for which in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield requests
    finally:
        for which, handler in before.items():
            signal.signal(which, handler)
        signal.set_wakeup_fd(wakeup)


class Supervised:
    """A child that is restarted, after increasing pauses, whenever it has ended on its own.

    Parameters
    ----------
    name : what sentences call it.
    start : starts it.
    say : shows a sentence to the user.
    may_start : whether what it needs is there; asked before it is started again.
    """

    def __init__(
        self, name: str, start: Callable[[], Child], say: Say, may_start: Callable[[], bool] = lambda: True
    ) -> None:
        self.name, self._start, self._say, self._may_start = name, start, say, may_start
        self._ends: list[float] = []
        self._again: float | None = None
        self.child = start()

    def look(self) -> None:
        """Start it again if it has ended and the pause is over.

        Raises
        ------
        InstallationError
            If it has ended too often for that.
        """
        now = time.monotonic()
        if self._again is not None:
            if now >= self._again and self._may_start():
                self._start_again(now)
        elif self.child.ended:
            # What it has started works for nobody any more, and would stand next to what is started next.
            self.child.end_group(0.0)
            self._wait(now, "has stopped unexpectedly")
        else:
            self.child.begin_log_anew()

    def _start_again(self, now: float) -> None:
        try:
            self.child = self._start()
        except OSError as error:
            # The memory that ended it may be short for a while, too.
            self._wait(now, f"cannot be started ({error.strerror or error})")
        else:
            self._again = None

    def _wait(self, now: float, what: str) -> None:
        self._ends = [*(end for end in self._ends if now - end < _PATIENCE.total_s), now]
        if len(self._ends) >= _ENDS:
            raise self._given_up()
        pause_s = _PATIENCE.pause_s(len(self._ends))
        self._again = now + pause_s
        self._say(f"The {self.name} {what}; it is restarted in {pause_s:.0f} s.")

    def _given_up(self) -> InstallationError:
        return InstallationError(
            f"The {self.name} has stopped unexpectedly {_ENDS} times within "
            f"{_PATIENCE.total_s / 60:.0f} minutes.",
            "Find the cause and start again; interrupted runs resume. "
            f"Its log is {self.child.log}; the last lines:\n{self.child.last_lines()}",
        )

    def drain(self, requests: Requests) -> None:
        """Let it finish what it has started, until there are two requests to end."""
        # The process itself, not those it has started.
        self.child.process.terminate()
        while requests.number < 2 and not self.child.wait(0.5):
            pass

    def end(self) -> None:
        """End it and all it has started."""
        self.child.end_group(END_S)
