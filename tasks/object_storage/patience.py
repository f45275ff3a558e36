"""Transfers outlast an outage: they are tried again with growing pauses, and people are told meanwhile."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import TypeVar

from tasks.object_storage.address import ObjectAddress
from tasks.object_storage.failure import failure_of, refused
from tasks.storage.installation import InstallationError

R = TypeVar("R")

_FIRST_PAUSE_S = 1.0
_LONGEST_PAUSE_S = 30.0
_log = logging.getLogger("aerocal")


def patiently(
    request: Callable[[], R],
    address: ObjectAddress,
    patience_s: float,
    *,
    pause: Callable[[float], None] = time.sleep,
    now: Callable[[], float] = time.monotonic,
) -> R:
    """Carry out a request, again and again while the storage does not answer.

    Parameters
    ----------
    request : may be repeated from its beginning. That an object does not exist (FileNotFoundError) is an
        answer, and passes, as what is wrong on this machine does.
    patience_s : time after which it is given up.
    pause, now : the clock.

    Raises
    ------
    InstallationError
        If the storage does not answer for so long, or refuses in a way that waiting does not change.
    """
    began, pause_s, interrupted = now(), _FIRST_PAUSE_S, False
    while True:
        try:
            answer = request()
        except OSError as error:
            if error.errno is not None:
                # Of a file of this machine (a full disk), or "no such object": nothing else has a number.
                raise
            failure = failure_of(error, address)
            if failure.remedy is not None:
                raise refused(failure, address) from error
            waited = now() - began
            if waited >= patience_s:
                raise _given_up(address, failure.reason, waited) from error
            pause_s_now = min(pause_s, max(patience_s - waited, 0.1))
            _log.warning(
                "%s does not answer (%s); trying again in %.0f s, for up to %s",
                address, failure.reason, pause_s_now, _duration(patience_s - waited),
            )  # fmt: skip
            pause(pause_s_now)
            pause_s, interrupted = min(2.0 * pause_s, _LONGEST_PAUSE_S), True
        else:
            if interrupted:
                _log.info("%s answers again after %s", address, _duration(now() - began))
            return answer


def _given_up(address: ObjectAddress, reason: str, waited_s: float) -> InstallationError:
    return InstallationError(
        f"{address} has not answered for {_duration(waited_s)} ({reason}).",
        "Run again when it does; what is done already is kept on this machine.",
    )


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
