"""What ``aerocal serve`` looks after while server and runners work: the inbox, and runs that need help."""

from __future__ import annotations

import threading
import time

from flows.serving.api import Api
from flows.serving.deliveries import schedule_deliveries
from flows.serving.heartbeats import watch_heartbeats
from flows.serving.inbox import CalledOffError
from flows.serving.inbox_news import forget_inbox_news, keep_inbox_news
from flows.serving.options import ServeOptions
from flows.serving.reconciliation import reconcile
from flows.serving.resumption import begin_again
from flows.serving.supervision import Say
from tasks.errors import AerocalError
from tasks.production.records import Records

#: What a look in work is given to end, s.
_END_S = 5.0


class Watch:
    """Looks into inbox and records every so often.

    Parameters
    ----------
    options : of the server.
    say : shows a sentence to the user.
    """

    def __init__(self, options: ServeOptions, api: Api, records: Records, say: Say) -> None:
        self.options, self.api, self.records, self.say = options, api, records, say
        self._verified: set[str] = set()
        self._said: set[str] = set()
        self._next = time.monotonic()
        self._over = threading.Event()
        # Not in the way of an end: what it has begun may take as long as a delivery is large.
        self._thread = threading.Thread(target=self._look_again_and_again, daemon=True)

    def __enter__(self) -> Watch:
        """Look from now on, beside everything else."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Look no more."""
        self._over.set()
        self._thread.join(_END_S)

    def _look_again_and_again(self) -> None:
        while not self._over.wait(1.0):
            try:
                self.look()
            except CalledOffError:
                return
            # One defect must not end all looks.
            except Exception as error:
                self.say(f"A look after inbox and runs broke off: {type(error).__name__}: {error}")
                self._next = time.monotonic() + self.options.watch_s

    def look(self) -> None:
        """Look if it is time; say what cannot be done, once."""
        if time.monotonic() < self._next:
            return
        try:
            news = self._look_after_all()
        except AerocalError as error:
            news = [str(error)]
        for sentence in news:
            if sentence not in self._said:
                self.say(sentence)
        self._said = set(news)
        self._next = time.monotonic() + self.options.watch_s

    def _look_after_all(self) -> list[str]:
        """Do what is to be done; sentences on what cannot be."""
        watch_heartbeats(self.api)
        for run in reconcile(self.api, self.records):
            self.say(f"Run of {run.project}: {run.state}. {run.message}")
        for run in begin_again(self.api, self.records):
            self.say(f"Run of {run.project} is begun again, for the {run.attempts - 1}. time.")
        if self.options.inbox is None:
            forget_inbox_news(self.options.state)
            return []
        roots, story = self.options.roots, self.options.runner.story
        inbox = self.options.inbox
        found = schedule_deliveries(
            self.api, self.records, inbox, roots, story, self._verified, self._over.is_set
        )
        for name in found.begun:
            self.say(f"Delivery {name}: a run is scheduled.")
        keep_inbox_news(self.options.state, found.waiting, found.refused)
        return list(found.refused)
