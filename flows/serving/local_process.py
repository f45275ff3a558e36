"""Whether the process of a run on this machine still lives."""

from __future__ import annotations

import socket
from datetime import UTC, datetime, timedelta

import psutil

from tasks.production.run_record import RunRecord

#: A process is older than the run it has begun; so much younger, it is another one with the same number.
_YOUNGER = timedelta(seconds=60)


def lives_here(run: RunRecord) -> bool:
    """Whether the run was begun on this machine by a process that is still there."""
    return run.host == socket.gethostname() and _lives(run)


def died_here(run: RunRecord) -> bool:
    """Whether the run was begun on this machine by a process that is no longer there."""
    return run.host == socket.gethostname() and not _lives(run)


def _lives(run: RunRecord) -> bool:
    if run.process is None or run.begun is None:
        return False
    try:
        process = psutil.Process(run.process)
        started = datetime.fromtimestamp(process.create_time(), UTC)
        return process.status() != psutil.STATUS_ZOMBIE and started < run.begun + _YOUNGER
    except psutil.NoSuchProcess:
        return False
    except psutil.AccessDenied:
        return True
