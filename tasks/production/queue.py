"""What waits and what is being computed, as the server knows it, or else the records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from tasks.production.run_record import RunRecord

#: From when on a run that should have begun is late, as the server counts.
LATE = timedelta(seconds=15)


@dataclass(frozen=True)
class QueuedRun:
    """A run that waits, or is in work.

    Attributes
    ----------
    run : its id.
    name : project and story, or what the server calls it.
    state : of the server (``Scheduled``, ``Late``, ``Pending``, ``Running``, ``AwaitingRetry`` …).
    due : from when on it may begin, UTC.
    begun : UTC; None: not yet.
    """

    run: str
    name: str
    state: str
    due: datetime
    begun: datetime | None

    def waiting_since(self, now: datetime) -> datetime | None:
        """Since when it could have begun; None: it has, or its time has not come."""
        return None if self.begun is not None or self.due > now else self.due


def queue_of_records(runs: Sequence[RunRecord]) -> tuple[QueuedRun, ...]:
    """The queue as far as the records know it: without runs that were started in the dashboard and wait."""
    return tuple(
        QueuedRun(run.id, f"{run.project} · {run.story}", run.state, run.scheduled, run.begun)
        for run in runs
        if not run.has_ended
    )


def in_order(queue: Sequence[QueuedRun]) -> tuple[QueuedRun, ...]:
    """Runs in work first, then what waits, in the order of their turn."""
    return tuple(sorted(queue, key=lambda one: (one.begun is None, one.begun or one.due, one.run)))


def times_from(text: str | None) -> datetime | None:
    """A time as the server writes it."""
    if not text:
        return None
    time = datetime.fromisoformat(text)
    return time if time.tzinfo is not None else time.replace(tzinfo=UTC)
