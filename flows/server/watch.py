"""What ``aerocal serve`` watches in threads of its own: inbox, runs that need help, notices.

Prefect ends runs by heartbeats and begins them by schedule; it knows neither deliveries nor the record of
runs, and its notices are not kept while a receiver is away. None of this is ever in the way of runs.

Reconcile the production records and the server's with each other and with the processes alive.

A run writes its own end, into the records first and then to the server. One that was killed, cancelled or
timed out can do neither; one whose server or database was away may have done one of them. Of both, the
record of a decided run holds: its results are there. Everything else is what the server says, which hears of
dead runs from the runner, or because their heartbeats have stopped; of those on this machine, it is told
here. A run that the server no longer knows, because its database was lost or started again, is dropped: its
delivery then gets another one.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

import psutil

from flows.server.api import Api, FlowRun, flow_runs, flow_runs_in, set_state, watch_heartbeats
from flows.server.child import Say
from flows.server.inbox import CalledOffError, Delivery, Scheduled, schedule_deliveries
from flows.server.settings import Settings
from tasks.errors import AerocalError
from tasks.files.machine import machine
from tasks.production.records import Records
from tasks.production.run_record import DECIDED, RunRecord, State

#: A runner that has taken a run begins it within this time, s; it may be loading Prefect on a busy machine.
_TO_BEGIN_S = 300.0
#: A run that has started has noted it within this time, s.
_TO_NOTE_S = 60.0
#: A run of which nothing was noted is taken up if it was ended no longer ago, s.
_TO_BE_ADOPTED_S = 3600.0
#: A runner that lives has ended a cancelled run within this time, s.
_TO_CANCEL_S = 120.0
#: Runs this old are not looked at any more.
_LOOKING_BACK = timedelta(days=3)
#: Types of the server's states in which a run may have recorded nothing yet.
_UNNOTED = ("SCHEDULED", "PENDING", "RUNNING", "CANCELLING", "CANCELLED", "CRASHED")
#: Types of the server's states in which a run that had started waits, and what is to be said about it.
_WAITING: Mapping[str, str] = {
    "SCHEDULED": "",
    "PAUSED": "Suspended: resume it in the dashboard.",
}
_ENDED_HERE = "Its process was terminated from outside."


def reconcile(api: Api, records: Records) -> tuple[RunRecord, ...]:
    """Reconcile both.

    Returns
    -------
    mended : the runs whose end was not noted by themselves, with that end.

    Raises
    ------
    InstallationError
        If server or records cannot be reached.
    """
    _adopt(api, records)
    unfinished = records.runs(states=("Scheduled", "Running"))
    known = flow_runs(api, [run.id for run in unfinished])
    lost = [run.id for run in unfinished if _reconcile(api, records, run, known.get(run.id))]
    _tell_decisions(api, records)
    return tuple(run for run in records.runs_with(lost) if run.state != "Scheduled")


def _adopt(api: Api, records: Records) -> None:
    """Record runs that wait, or were killed or cancelled before they could record their beginning."""
    since = datetime.now(UTC) - _LOOKING_BACK
    found = {
        run.id: run
        for run in flow_runs_in(api, _UNNOTED, since).values()
        if run.deployed and "project" in run.parameters and (run.end is None or run.age_s < _TO_BE_ADOPTED_S)
    }
    known = {run.id for run in records.runs_with(list(found))}
    for run_id in found.keys() - known:
        run = found[run_id]
        project, since = Path(str(run.parameters["project"])), run.since
        story = str((api.get(f"/flows/{run.flow}") or {}).get("name"))
        records.schedule(RunRecord.of(run_id, project, story, "Scheduled", run.message, scheduled=since))


def _reconcile(api: Api, records: Records, run: RunRecord, found: FlowRun | None) -> bool:
    """Reconcile a run that has not ended according to its record; returns whether the record was changed."""
    if found is None:
        records.lose(run.id, "Crashed", "The server no longer knows this run.", may_pass=False)
        return True
    ending = found.end
    if ending is None:
        if found.type in _WAITING and run.state == "Running" and not lives_here(run):
            records.reschedule(run.id, _WAITING[found.type] or found.message)
        ending = _death(api, records, run, found)
    elif ending == "Crashed" and lives_here(run):
        # It was out of sight only (the server was away for longer than its heartbeats may stay out).
        return False
    if ending is None:
        return False
    records.lose(run.id, ending, found.message if found.end else _ENDED_HERE, may_pass=found.deployed)
    return True


def _death(api: Api, records: Records, run: RunRecord, found: FlowRun) -> State | None:
    """Detect a dead run that the server believes alive, and tell the server; None: it may be alive."""
    dead = run.state == "Running" and died_here(run)
    if dead and (again := records.run(run.id)) is not None and again.state != "Running":
        # It has noted its end and gone between the two looks.
        return None
    if found.type == "CANCELLING" and (dead or found.age_s > _TO_CANCEL_S) and not lives_here(run):
        set_state(api, run.id, "CANCELLED", "Cancelled", _ENDED_HERE, force=False)
        return "Cancelled"
    patience_s = {"PENDING": _TO_BEGIN_S, "RUNNING": _TO_NOTE_S}.get(found.type, math.inf)
    stuck = run.state == "Scheduled" and found.age_s > patience_s
    if (dead and found.type == "RUNNING") or stuck:
        set_state(api, run.id, "CRASHED", "Crashed", _ENDED_HERE, force=False)
        return "Crashed"
    return None


def _tell_decisions(api: Api, records: Records) -> None:
    """Report to the server how runs ended that could not report it themselves."""
    open_there = flow_runs_in(api, ("RUNNING", "CRASHED"), datetime.now(UTC) - _LOOKING_BACK)
    decided = (run for run in records.runs_with(list(open_there)) if run.state in DECIDED)
    for run in decided:
        found = open_there[run.id]
        # Somebody may have started it again; then it has come into its state after the end that is noted.
        unheard = run.ended is not None and found.since <= run.ended and died_here(run)
        if found.type == "CRASHED" or unheard:
            kind = "COMPLETED" if run.state == "Completed" else "FAILED"
            set_state(api, run.id, kind, run.state, run.message, force=True)


_MESSAGE = "It was terminated by the machine; completed stages are kept."


def begin_again(api: Api, records: Records) -> tuple[RunRecord, ...]:
    """Schedule the runs again that are due (`tasks.production.run_record`).

    One that belongs to no deployment (it was started by a command, which has ended with it) cannot be started
    by a runner, and one that was cancelled since is not to be; it stays as it ended.

    Returns
    -------
    begun : the runs that wait for a runner now.

    Raises
    ------
    InstallationError
        If server or records cannot be reached.
    """
    due = records.due(datetime.now(UTC))
    if not due:
        return ()
    known = flow_runs(api, [run.id for run in due])
    begun = []
    for run in due:
        found = known.get(run.id)
        if found is None or not found.deployed or found.end == "Cancelled":
            records.give_up(run.id)
        elif found.type in ("CRASHED", "FAILED") and records.begin_again(run, _MESSAGE):
            # Whoever has got the record may tell the server: nobody else will.
            set_state(api, run.id, "SCHEDULED", "AwaitingRetry", _MESSAGE, force=True)
            begun.append(run.id)
    return records.runs_with(begun)


#: A process is older than the run it has started; so much younger, it is another one with the same number.
_YOUNGER = timedelta(seconds=60)


def lives_here(run: RunRecord) -> bool:
    """Whether the run was started on this machine by a process that is still there."""
    return run.host == machine() and _lives(run)


def died_here(run: RunRecord) -> bool:
    """Whether the run was started on this machine by a process that is no longer there."""
    return run.host == machine() and not _lives(run)


def _lives(run: RunRecord) -> bool:
    if run.process is None or run.begun is None:
        return False
    try:
        process = psutil.Process(run.process)
        if process.status() == psutil.STATUS_ZOMBIE:
            return False
        started = datetime.fromtimestamp(process.create_time(), UTC)
        return started < run.begun + _YOUNGER or _carries_out(process, run)
    except psutil.NoSuchProcess:
        return False
    except psutil.AccessDenied:
        return True


def _carries_out(process: psutil.Process, run: RunRecord) -> bool:
    """Whether a process was started by a runner for this run, whatever a clock that was set since says."""
    try:
        return bool(process.environ().get("PREFECT__FLOW_RUN_ID") == run.id)
    except psutil.AccessDenied:
        # Of another user, none of ours.
        return False


class Repeated:
    """Repeats an action in a thread while a context lasts, even if the action fails.

    Parameters
    ----------
    act : what is done; asks the function it is given whether it is called off.
    every_s : seconds between two times.
    say : shows a sentence to the user.
    trouble : what is said if it cannot be done, before the reason; the same reason once.
    grace_s : what it is given to end, s.
    once_more : whether it is done a last time at the end.
    """

    def __init__(
        self,
        act: Callable[[Callable[[], bool]], object],
        every_s: float,
        say: Say,
        trouble: str,
        *,
        grace_s: float,
        once_more: bool = False,
    ) -> None:
        self._act, self._every_s, self._say, self._trouble = act, every_s, say, trouble
        self._grace_s, self._once_more, self._said = grace_s, once_more, ""
        self._ending, self._over = threading.Event(), threading.Event()
        # What hangs (a receiver, a large delivery) must not keep the server from ending.
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        if not self._once_more:
            self._over.set()
        self._thread.join(self._grace_s)
        self._over.set()

    def _run(self) -> None:
        self._do()
        while not self._ending.wait(self._every_s):
            self._do()
        if self._once_more:
            self._do()

    def _do(self) -> None:
        try:
            self._act(self._over.is_set)
            self._said = ""
        except CalledOffError:
            return
        # One defect must not end all that follows.
        except Exception as error:
            known = isinstance(error, AerocalError)
            reason = str(error) if known else f"{type(error).__name__}: {error}"
            if reason != self._said:
                self._say(f"{self._trouble}: {reason}")
            self._said = reason


class Watch:
    """Watches inbox and records.

    Attributes
    ----------
    inbox : what the last look into the inbox has found; None: there is no inbox, or nobody has looked yet.
    """

    def __init__(self, settings: Settings, api: Api, records: Records, say: Say) -> None:
        self.settings, self.api, self.records, self.say = settings, api, records, say
        self.inbox: Scheduled | None = None
        self._known: dict[Delivery, str | None] = {}

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Watch while the context lasts: a large delivery takes minutes to read and must hold up no run."""
        every = partial(Repeated, every_s=self.settings.watch_s, say=self.say, grace_s=5.0)
        with ExitStack() as at_end:
            if self.settings.inbox is not None:
                at_end.enter_context(every(self.look_into_inbox, trouble="A check of the inbox failed"))
            at_end.enter_context(every(self.look_after_runs, trouble="A check of the runs failed"))
            yield

    def look_after_runs(self, _is_over: Callable[[], bool] = lambda: False) -> None:
        """Reconcile the records, start again what is due, and report it.

        Raises
        ------
        InputError, InstallationError
            If server or records cannot be asked.
        """
        watch_heartbeats(self.api)
        for run in reconcile(self.api, self.records):
            self.say(f"Run of {run.project}: {run.state}. {run.message}")
        for run in begin_again(self.api, self.records):
            self.say(f"Run of {run.project} is restarted (restart {run.attempts - 1}).")

    def look_into_inbox(self, is_over: Callable[[], bool] = lambda: False) -> None:
        """Schedule complete deliveries and report it.

        Raises
        ------
        InputError, InstallationError
            If server, records or inbox cannot be asked.
        """
        settings = self.settings
        assert settings.inbox is not None
        found = schedule_deliveries(
            self.api,
            self.records,
            settings.inbox,
            settings.roots,
            settings.story,
            self._known,
            is_over,
            only_look=settings.only_on_schedule,
        )
        for name in found.begun:
            self.say(f"Delivery {name}: a run is scheduled.")
        before = () if self.inbox is None else self.inbox.refused
        self.inbox = found
        for sentence in found.refused:
            if sentence not in before:
                self.say(sentence)
