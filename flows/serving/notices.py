"""Notices of a server: a thread that delivers what waits in the outbox, never in the way of runs."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Sequence
from types import TracebackType

from tasks.errors import AerocalError
from tasks.notification.addresses import NoticeAddress
from tasks.notification.delivery import Courier
from tasks.notification.notice import Links, NoticeKind
from tasks.notification.outbox import Outbox
from tasks.production.records import Records

#: Seconds between two looks into the outbox.
_LOOK_S = 2.0
#: What the last notices get when the server ends; what is left is delivered after the next start.
_END_S = 20.0


class NoticeThread:
    """Delivers notices while a context lasts, and once more when it ends.

    Parameters
    ----------
    records : hold the outbox.
    addresses, wanted, links : as of `Courier`.
    say : shows a sentence to the user.
    """

    def __init__(
        self,
        records: Records,
        addresses: Sequence[NoticeAddress],
        wanted: Collection[NoticeKind],
        links: Links,
        say: Callable[[str], None],
    ) -> None:
        self._courier = Courier(Outbox(records), addresses, wanted, links, say)
        self._say, self._said = say, ""
        self._ending = threading.Event()
        self._over = threading.Event()
        # A receiver that hangs must not keep the server from ending.
        self._thread = threading.Thread(target=self._run, name="notices", daemon=True)

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ending.set()
        self._thread.join(_END_S)
        self._over.set()

    def _run(self) -> None:
        while not self._ending.wait(_LOOK_S):
            self._deliver()
        self._deliver()

    def _deliver(self) -> None:
        try:
            self._courier.deliver(self._over.is_set)
            self._said = ""
        # Whatever it is: notices wait in the outbox, and the server goes on.
        except Exception as error:
            reason = str(error) if isinstance(error, AerocalError) else type(error).__name__
            if reason != self._said:
                self._say(f"Notices cannot be delivered at the moment: {reason}")
            self._said = reason
