"""Children that are started again when they end by themselves, and requests to end them all."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from flows.serving.child import Child
from tasks.storage.installation import InstallationError

#: What a child gets to end once nothing runs any more, s.
END_S = 30.0
#: So many ends within so many seconds mean that starting it again does not help. A database may well be away
#: for a quarter of an hour.
_ENDS, _WITHIN_S = 20, 3600.0
_LONGEST_PAUSE_S = 60.0

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
    """A child that is started again, after growing pauses, whenever it has ended by itself.

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
                self._again = None
                self.child = self._start()
        elif self.child.ended:
            # What it has started works for nobody any more, and would stand beside what is started next.
            self.child.end_group(0.0)
            self._ends = [*(end for end in self._ends if now - end < _WITHIN_S), now]
            if len(self._ends) >= _ENDS:
                raise self._given_up()
            pause_s = min(2.0 ** (len(self._ends) - 1), _LONGEST_PAUSE_S)
            self._again = now + pause_s
            self._say(f"The {self.name} has ended by itself; it is started again in {pause_s:.0f} s.")
        else:
            self.child.begin_log_anew()

    def _given_up(self) -> InstallationError:
        return InstallationError(
            f"The {self.name} has ended by itself {_ENDS} times within {_WITHIN_S / 60:.0f} minutes.",
            "Start again when the reason is found; runs go on where they stood. "
            f"Its log is {self.child.log}; the last lines:\n{self.child.last_lines()}",
        )

    def drain(self, requests: Requests) -> None:
        """Let it finish what it has begun, until there are two requests to end."""
        self.child.ask_to_end()
        while requests.number < 2 and not self.child.wait(0.5):
            pass

    def end(self) -> None:
        """End it and all it has started."""
        self.child.end_group(END_S)
