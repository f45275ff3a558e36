"""What ``aerocal serve`` looks after while server and runners work: the inbox, and runs that need help."""

from __future__ import annotations

import time

from flows.serving.api import Api
from flows.serving.deliveries import schedule_deliveries
from flows.serving.heartbeats import watch_heartbeats
from flows.serving.inbox_news import forget_inbox_news, keep_inbox_news
from flows.serving.options import ServeOptions
from flows.serving.reconciliation import reconcile
from flows.serving.resumption import begin_again
from flows.serving.supervision import Say
from tasks.errors import AerocalError
from tasks.production.records import Records


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
        found = schedule_deliveries(self.api, self.records, inbox, roots, story, self._verified)
        for name in found.begun:
            self.say(f"Delivery {name}: a run is scheduled.")
        keep_inbox_news(self.options.state, found.waiting, found.refused)
        return list(found.refused)
