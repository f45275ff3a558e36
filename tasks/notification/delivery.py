"""Deliver what waits in the outbox: each notice to each address, until it is taken or given up."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from datetime import UTC, datetime, timedelta

from tasks.notification.addresses import NoticeAddress
from tasks.notification.notice import Links, Notice, NoticeKind
from tasks.notification.outbox import Outbox, Patience

#: An address that has failed is left alone for so long, whatever else waits for it.
_RESTED = timedelta(seconds=5)


class Courier:
    """Delivers notices.

    Parameters
    ----------
    outbox : where they wait.
    addresses : where they go.
    wanted : kinds that are told; others are done with at once.
    links : where readers find more.
    say : is told about failures, a sentence.
    """

    def __init__(
        self,
        outbox: Outbox,
        addresses: Sequence[NoticeAddress],
        wanted: Collection[NoticeKind],
        links: Links,
        say: Callable[[str], None],
        patience: Patience | None = None,
    ) -> None:
        self.outbox, self.addresses, self.wanted, self.links = outbox, addresses, wanted, links
        self.say, self.patience = say, patience or Patience()
        self._rests: dict[str, datetime] = {}

    def deliver(self, is_over: Callable[[], bool] = lambda: False) -> int:
        """Send what is due; how many notices are still waiting.

        Parameters
        ----------
        is_over : asked between two messages; the rest then waits for the next time.

        Raises
        ------
        InputError, InstallationError
            As of `Outbox`.
        """
        waiting = self.outbox.waiting()
        done: list[Notice] = []
        for notice in waiting:
            if is_over():
                break
            addresses = self.addresses if notice.kind in self.wanted else ()
            # Every address gets its turn, whatever the others say.
            brought = [self._bring(notice, address) for address in addresses]
            if all(brought):
                done.append(notice)
        if done:
            self.outbox.close(done)
        return len(waiting) - len(done)

    def _bring(self, notice: Notice, address: NoticeAddress) -> bool:
        """Send a notice to an address if it is due; whether nothing more is to be done there."""
        before, now = self.outbox.delivery(notice, address), datetime.now(UTC)
        if before is not None and before.state != "waiting":
            return True
        if (before is not None and now < before.due) or now < self._rests.get(address.key, now):
            return False
        sent = address.send(notice, self.links)
        now = datetime.now(UTC)
        after = self.outbox.note(notice, address, sent, now, self.patience)
        if not sent.accepted:
            self._rests[address.key] = now + min(after.due - now, _RESTED)
        if after.state == "given_up":
            self.say(f"The notice '{notice.subject}' is given up: {address} is {sent.said}.")
        elif not sent.accepted and after.attempts == 1:
            self.say(f"The notice '{notice.subject}' is sent again later: {address} is {sent.said}.")
        return after.state != "waiting"
