"""What ``aerocal serve`` watches in threads of its own: inbox, runs that need help, notices.

Prefect ends runs by heartbeats and begins them by schedule; it knows neither deliveries nor the record of
runs, and its notices are not kept while a receiver is away. None of this is ever in the way of runs.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

from flows.server.api import Api, watch_heartbeats
from flows.server.child import Say
from flows.server.inbox import CalledOffError, Scheduled, schedule_deliveries
from flows.server.reconciliation import begin_again, reconcile
from flows.server.settings import Settings
from tasks.errors import AerocalError
from tasks.production.records import Records


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
        self._verified: set[str] = set()

    def look(self, is_over: Callable[[], bool] = lambda: False) -> None:
        """Do what is due and report it; a failure is reported once.

        Raises
        ------
        InputError, InstallationError
            If server, records or inbox cannot be asked.
        """
        watch_heartbeats(self.api)
        for run in reconcile(self.api, self.records):
            self.say(f"Run of {run.project}: {run.state}. {run.message}")
        for run in begin_again(self.api, self.records):
            self.say(f"Run of {run.project} is restarted (restart {run.attempts - 1}).")
        if self.settings.inbox is None or self.settings.only_on_schedule:
            return
        roots, story = self.settings.roots, self.settings.story
        found = schedule_deliveries(
            self.api, self.records, self.settings.inbox, roots, story, self._verified, is_over
        )
        for name in found.begun:
            self.say(f"Delivery {name}: a run is scheduled.")
        before = () if self.inbox is None else self.inbox.refused
        self.inbox = found
        for sentence in found.refused:
            if sentence not in before:
                self.say(sentence)
