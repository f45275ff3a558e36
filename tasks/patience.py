"""Retries: pauses and duration; one policy for everything that may be temporarily unavailable."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

R = TypeVar("R")


@dataclass(frozen=True)
class Patience:
    """How long to wait.

    Attributes
    ----------
    first_s, longest_s : pause after the first failure, doubled each time, and its limit.
    total_s : time after which it is given up.
    """

    first_s: float
    longest_s: float
    total_s: float

    def pause_s(self, failures: int) -> float:
        """The pause after so many failures."""
        return float(min(self.first_s * 2.0 ** min(failures - 1, 30), self.longest_s))

    def tried(
        self,
        act: Callable[[], R],
        may_pass: Callable[[Exception], bool],
        say: Callable[[Exception, float, float], None] = lambda _error, _pause_s, _waited_s: None,
        *,
        pause: Callable[[float], None] = time.sleep,
        now: Callable[[], float] = time.monotonic,
    ) -> R:
        """The result of an action, which is repeated as long as it fails for temporary reasons.

        Parameters
        ----------
        may_pass : whether waiting can help against an error; other errors pass, as the last one does.
        say : is told of each failure: the error, the pause that follows, and the time waited so far, s.
        pause, now : the clock.
        """
        began, failures = now(), 0
        while True:
            try:
                return act()
            except Exception as error:
                failures, waited_s = failures + 1, now() - began
                if not may_pass(error) or waited_s >= self.total_s:
                    raise
                pause_s = min(self.pause_s(failures), max(self.total_s - waited_s, 0.1))
                say(error, pause_s, waited_s)
            pause(pause_s)
