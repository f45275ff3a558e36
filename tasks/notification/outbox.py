"""The outbox: notices wait in the database of production until every address has taken them.

A notice is written in the same transaction as the end of its run. It is sent at least once: whoever is killed
between the answer of a receiver and the note about it sends it again, with the same number. Once noted, it is
never sent again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Literal, TypeAlias

from sqlalchemy import insert, select, update

from tasks.notification.addresses import NoticeAddress, Sent
from tasks.notification.notice import Notice, notice_from
from tasks.production.records import Records
from tasks.production.tables import NOTICE_DELIVERIES, NOTICES

DeliveryState: TypeAlias = Literal["waiting", "delivered", "given_up"]
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
class Patience:
    """How long is waited.

    Attributes
    ----------
    first_s, longest_s : pause after the first failure, doubled each time, and its limit.
    give_up_s : age of a notice at which it is given up.
    """

    first_s: float = 10.0
    longest_s: float = 3600.0
    give_up_s: float = 3 * 86_400.0

    def pause_s(self, attempts: int) -> float:
        """The pause after so many failures."""
        return float(min(self.first_s * 2.0 ** min(attempts - 1, 30), self.longest_s))


@dataclass(frozen=True)
class Outbox:
    """The notices that wait, in the records of production. Errors as of `Records`."""

    records: Records

    def waiting(self) -> tuple[Notice, ...]:
        """The notices that are not done with, the oldest first."""
        chosen = select(NOTICES.c.content).where(NOTICES.c.closed.is_(None))
        rows = self.records.rows(chosen.order_by(NOTICES.c.written, NOTICES.c.id).limit(_BATCH))
        return tuple(notice_from(row.content) for row in rows)

    def delivery(self, notice: Notice, address: NoticeAddress) -> Delivery | None:
        """How far a notice has come to an address; None: it was never sent there."""
        own = (NOTICE_DELIVERIES.c.notice == notice.id) & (NOTICE_DELIVERIES.c.address == address.key)
        for row in self.records.rows(select(NOTICE_DELIVERIES).where(own)):
            return Delivery(row.state, row.attempts, datetime.fromisoformat(row.due), row.said)
        return None

    def note(
        self, notice: Notice, address: NoticeAddress, sent: Sent, now: datetime, patience: Patience
    ) -> Delivery:
        """Note what became of an attempt; what is to be done next."""
        before = self.delivery(notice, address)
        attempts = 1 if before is None else before.attempts + 1
        age = (now - datetime.fromisoformat(notice.ended)).total_seconds()
        state: DeliveryState = "delivered" if sent.accepted else "waiting"
        if not sent.accepted and age > patience.give_up_s:
            state = "given_up"
        due = now + timedelta(seconds=patience.pause_s(attempts))
        values = {"state": state, "attempts": attempts, "due": due.isoformat(), "said": sent.said}
        own = (NOTICE_DELIVERIES.c.notice == notice.id) & (NOTICE_DELIVERIES.c.address == address.key)
        with self.records.writing() as connection:
            if connection.execute(update(NOTICE_DELIVERIES).where(own).values(**values)).rowcount == 0:
                connection.execute(
                    insert(NOTICE_DELIVERIES).values(notice=notice.id, address=address.key, **values)
                )
        return Delivery(state, attempts, due, sent.said)

    def close(self, notices: Sequence[Notice]) -> None:
        """Note that nothing more is to be done about notices."""
        now = datetime.now(UTC).isoformat()
        with self.records.writing() as connection:
            for notice in notices:
                connection.execute(update(NOTICES).where(NOTICES.c.id == notice.id).values(closed=now))
