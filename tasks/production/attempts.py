"""Which runs are begun once more by themselves, when, and how often.

A run that the machine has ended says nothing about its project, so it is begun again: at once, because most
causes pass with the process that was killed, then after growing pauses. A full disk takes somebody to make
room; it is tried again less often and for longer. What ended the machine's patience every time (an adjustment
that needs more memory than there is) must not go round for ever: then the run stays as it ended.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timedelta

from tasks.production.run_record import State

_MINUTE = 60
_HOUR = 3600

#: Seconds before the second, third, … beginning, by the state that the one before has ended in.
PAUSES_S: Mapping[State, tuple[int, ...]] = {
    "Crashed": (0, 30, 2 * _MINUTE, 10 * _MINUTE),
    "Failed": (_MINUTE, 5 * _MINUTE, 15 * _MINUTE, _HOUR, _HOUR, _HOUR, _HOUR, _HOUR),
}


def next_beginning(state: State, attempts: int, now: datetime) -> datetime | None:
    """When a run is begun again that has ended for a reason which may pass.

    Parameters
    ----------
    state : in which it has ended.
    attempts : how often it was begun.

    Returns
    -------
    time : None if it is not begun again by itself.
    """
    pauses = PAUSES_S.get(state, ())
    if attempts > len(pauses):
        return None
    return now + timedelta(seconds=pauses[attempts - 1])


def with_prospect(message: str, attempts: int, again_at: datetime | None) -> str:
    """A message on an end, followed by what happens next."""
    if again_at is None:
        times = "once" if attempts == 1 else f"{attempts} times"
        return f"{message} It was begun {times} and is not begun again by itself."
    return f"{message} It is begun again after {again_at:%H:%M} UTC."
