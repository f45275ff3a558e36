"""The outbox: notices wait in the database of production until every address has taken them.

Neither Prefect's notifications nor apprise keep what a receiver did not take. A notice is written in the
same transaction as the end of its run. It is sent at least once: whoever is killed between the answer of a
receiver and the note about it sends it again, with the same number. Once noted, it is never sent again.
"""

from __future__ import annotations

import time
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
_OPEN = NOTICES.c.closed.is_(None)


@dataclass(frozen=True)
class Delivery:
    """One notice on its way to one address.

    Attributes
    ----------
    state : what has become of it.
    attempts : how often it was sent.
    due : when it may be sent again.
    """

    state: DeliveryState
    attempts: int
    due: datetime


@dataclass(frozen=True)
class Outbox:
    """The notices that wait, in the records of production. Errors as of `Records`."""

    records: Records

    def waiting(self) -> tuple[Notice, ...]:
        """The notices that are not finished, the oldest first."""
        chosen = select(NOTICES.c.content).where(_OPEN).order_by(NOTICES.c.written, NOTICES.c.id)
        return tuple(notice_from(row.content) for row in self.records.rows(chosen))

    def deliveries(self) -> dict[tuple[str, str], Delivery]:
        """What has become of them so far, by id of the notice and key of the address."""
        sent = NOTICE_DELIVERIES.c
        chosen = select(NOTICE_DELIVERIES).join(NOTICES, NOTICES.c.id == sent.notice).where(_OPEN)
        return {
            (row.notice, row.address): Delivery(row.state, row.attempts, row.due)
            for row in self.records.rows(chosen)
        }

    def note(
        self, notice: Notice, address: NoticeAddress, sent: Sent, before: Delivery | None, patience: Patience
    ) -> Delivery:
        """Record the outcome of an attempt; returns what to do next.

        Parameters
        ----------
        before : what had become of the notice at this address; None: it was never sent there.
        """
        now, attempts = datetime.now(UTC), 1 if before is None else before.attempts + 1
        age = (now - datetime.fromisoformat(notice.ended)).total_seconds()
        state: DeliveryState = "delivered" if sent.accepted else "waiting"
        if not sent.accepted and age > patience.total_s:
            state = "given_up"
        after = Delivery(state, attempts, now + timedelta(seconds=patience.pause_s(attempts)))
        values = {**vars(after), "said": sent.said}
        own = {"notice": notice.id, "address": address.key}
        with self.records.writing() as connection:
            if before is None:
                connection.execute(insert(NOTICE_DELIVERIES).values(**own, **values))
            else:
                connection.execute(update(NOTICE_DELIVERIES).filter_by(**own).values(**values))
        return after

    def close(self, notices: Sequence[Notice]) -> None:
        """Mark notices as finished."""
        now = datetime.now(UTC)
        with self.records.writing() as connection:
            for notice in notices:
                connection.execute(update(NOTICES).where(NOTICES.c.id == notice.id).values(closed=now))


#: An address that has failed is left alone for so long, s, whatever else waits for it.
_RESTED_S = 5.0


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
        patience: Patience = PATIENCE,
    ) -> None:
        self.outbox, self.addresses, self.wanted, self.links = outbox, addresses, wanted, links
        self.say, self.patience = say, patience
        self._rests: dict[str, float] = {}

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
        if not waiting:
            return 0
        before = self.outbox.deliveries()
        done: list[Notice] = []
        for notice in waiting:
            if is_over():
                break
            addresses = self.addresses if notice.kind in self.wanted else ()
            # Every address gets its turn, whatever the others say.
            brought = [self._bring(notice, one, before.get((notice.id, one.key))) for one in addresses]
            if all(brought):
                done.append(notice)
        if done:
            self.outbox.close(done)
        return len(waiting) - len(done)

    def _bring(self, notice: Notice, address: NoticeAddress, before: Delivery | None) -> bool:
        """Send a notice to an address if it is due; returns whether that address is finished."""
        if before is not None and before.state != "waiting":
            return True
        now, longest = datetime.now(UTC), timedelta(seconds=self.patience.longest_s)
        # A time further off than any pause was written by a clock that ran ahead.
        early = before is not None and now < before.due <= now + longest
        if early or time.monotonic() < self._rests.get(address.key, 0.0):
            return False
        sent = address.send(notice, self.links)
        after = self.outbox.note(notice, address, sent, before, self.patience)
        if not sent.accepted:
            pause_s = min(self.patience.pause_s(after.attempts), _RESTED_S)
            self._rests[address.key] = time.monotonic() + pause_s
        if after.state == "given_up":
            self.say(f"The notice '{notice.subject}' is dropped: {address} is {sent.said}.")
        elif not sent.accepted and after.attempts == 1:
            self.say(f"The notice '{notice.subject}' will be retried: {address} is {sent.said}.")
        return after.state != "waiting"
