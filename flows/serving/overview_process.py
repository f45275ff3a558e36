"""The production page as a child process: begun again a few times if it ends, never in the way of runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from flows.serving.child import Child, Lifeline
from flows.serving.server_process import ServerAddress

#: How often it is begun again.
RESTARTS = 5
# It only reads: nothing is lost when it is ended at once.
_END_S = 5.0


class OverviewProcess:
    """The production page.

    Parameters
    ----------
    address : where it listens.
    dashboard : address of the server's own pages for browsers.
    environment : names records, roots, registry, server and state folder.
    log : file that its output is appended to.
    say : shows a sentence to the user.
    """

    def __init__(
        self,
        address: ServerAddress,
        dashboard: str,
        environment: Mapping[str, str],
        log: Path,
        say: Callable[[str], None],
    ) -> None:
        self._arguments = (address.host, str(address.port), dashboard)
        self._environment, self._log, self._say = environment, log, say
        self._restarts_left = RESTARTS
        self._lifeline = Lifeline()
        self._child: Child | None = self._begun()

    def look(self) -> None:
        """Begin it again if it has ended by itself; after some times, do without it."""
        if self._child is None:
            return
        if not self._child.ended:
            self._child.begin_log_anew()
            return
        reason = self._child.last_lines(1)
        self.end()
        if self._restarts_left == 0:
            self._say(f"The production page has ended {RESTARTS + 1} times; runs go on without it: {reason}")
            return
        self._restarts_left -= 1
        self._say(f"The production page has ended and is begun again. Its log is {self._log}.")
        self._child = self._begun()

    def end(self) -> None:
        """End it."""
        if self._child is not None:
            self._child.end_group(_END_S)
            self._child = None

    def _begun(self) -> Child:
        return Child(
            "flows.overview",
            *self._arguments,
            environment=self._environment,
            log=self._log,
            lifeline=self._lifeline,
        )
