"""The outbox: notices wait in the database of production until every address has taken them.

Neither Prefect's notifications nor apprise keep what a receiver did not take. A notice is written in the
same transaction as the end of its run. It is sent at least once: whoever is killed between the answer of a
receiver and the note about it sends it again, with the same number. Once noted, it is never sent again.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Literal, TypeAlias

from sqlalchemy import insert, select, update

from tasks.patience import Patience
from tasks.production.notice import Links, Notice, NoticeKind, notice_from
from tasks.production.notice_addresses import NoticeAddress, Sent
from tasks.production.records import Records
from tasks.production.tables import NOTICE_DELIVERIES, NOTICES

DeliveryState: TypeAlias = Literal["waiting", "delivered", "given_up"]
#: With a receiver that does not take a notice; its age counts.
PATIENCE = Patience(10.0, 3600.0, 3 * 86_400.0)
#: Notices that are looked at in one pass.
_BATCH = 200


@dataclass(frozen=True)
class Delivery:
    """One notice on its way to one address.

    Attributes
    ----------
    state : what has become of it.
    attempts : how often it was sent.
    due : when it may be sent again.
    said : what became of the last attempt.
    """

    state: DeliveryState
    attempts: int
    due: datetime
    said: str


@dataclass(frozen=True)
class Outbox:
    """The notices that wait, in the records of production. Errors as of `Records`."""

    records: Records

    def waiting(self) -> tuple[Notice, ...]:
        """The notices that are not finished, the oldest first."""
        chosen = select(NOTICES.c.content).where(NOTICES.c.closed.is_(None))
        rows = self.records.rows(chosen.order_by(NOTICES.c.written, NOTICES.c.id).limit(_BATCH))
        return tuple(notice_from(row.content) for row in rows)

    def delivery(self, notice: Notice, address: NoticeAddress) -> Delivery | None:
        """State of a notice for an address; None: it was never sent there."""
        own = (NOTICE_DELIVERIES.c.notice == notice.id) & (NOTICE_DELIVERIES.c.address == address.key)
        for row in self.records.rows(select(NOTICE_DELIVERIES).where(own)):
            return Delivery(row.state, row.attempts, row.due, row.said)
        return None

    def note(
        self, notice: Notice, address: NoticeAddress, sent: Sent, now: datetime, patience: Patience
    ) -> Delivery:
        """Record the outcome of an attempt; returns what to do next."""
        before = self.delivery(notice, address)
        attempts = 1 if before is None else before.attempts + 1
        age = (now - datetime.fromisoformat(notice.ended)).total_seconds()
        state: DeliveryState = "delivered" if sent.accepted else "waiting"
        if not sent.accepted and age > patience.total_s:
            state = "given_up"
        due = now + timedelta(seconds=patience.pause_s(attempts))
        values = {"state": state, "attempts": attempts, "due": due, "said": sent.said}
        own = (NOTICE_DELIVERIES.c.notice == notice.id) & (NOTICE_DELIVERIES.c.address == address.key)
        with self.records.writing() as connection:
            if connection.execute(update(NOTICE_DELIVERIES).where(own).values(**values)).rowcount == 0:
                connection.execute(
                    insert(NOTICE_DELIVERIES).values(notice=notice.id, address=address.key, **values)
                )
        return Delivery(state, attempts, due, sent.said)

    def close(self, notices: Sequence[Notice]) -> None:
        """Mark notices as finished."""
        now = datetime.now(UTC)
        with self.records.writing() as connection:
            for notice in notices:
                connection.execute(update(NOTICES).where(NOTICES.c.id == notice.id).values(closed=now))


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
        self.say, self.patience = say, patience or PATIENCE
        self._rests: dict[str, datetime] = {}

    def deliver(self, is_over: Callable[[], bool] = lambda: False) -> int:
        """Send what is due; returns how many notices are still waiting.

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
        """Send a notice to an address if it is due; returns whether that address is finished."""
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
            self.say(f"The notice '{notice.subject}' is dropped: {address} is {sent.said}.")
        elif not sent.accepted and after.attempts == 1:
            self.say(f"The notice '{notice.subject}' will be retried: {address} is {sent.said}.")
        return after.state != "waiting"
