"""The history of a registry: what was added, approved and superseded, each event sealed by a digest.

All events of a registry form one chain. The digest of an event covers its own values, the digest of the
record it refers to, and the digest of the event before it. A value that was changed, an event that was taken
out, put in or moved therefore shows, at that event or at the next one. Somebody who recomputes the whole
chain does not show in the registry itself, but against a digest that was noted elsewhere.
"""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from datetime import date, timedelta
from typing import Literal, TypeAlias

from tasks.files.json_text import JSON, json_text

State: TypeAlias = Literal["draft", "approved", "superseded"]

#: What is before the first event.
BEGINNING = "0" * 64
#: The states a record can have before each state; None: no event yet.
PREDECESSORS: dict[str, tuple[str | None, ...]] = {
    "draft": (None,),
    "approved": ("draft",),
    # A superseded one may lose more of what remained of its validity.
    "superseded": ("approved", "superseded"),
}


@dataclass(frozen=True)
class Validity:
    """First and last day on which a calibration is valid; without an end, until further notice."""

    start: date
    end: date | None = None

    def contains(self, day: date) -> bool:
        """Whether it includes a day."""
        return self.start <= day and (self.end is None or day <= self.end)

    def overlaps(self, other: Validity) -> bool:
        """Whether both include some day."""
        return (self.end is None or other.start <= self.end) and (
            other.end is None or self.start <= other.end
        )

    def before(self, day: date) -> Validity | None:
        """What is left before a day; None: nothing."""
        if day <= self.start:
            return None
        last = day - timedelta(days=1)
        return Validity(self.start, last if self.end is None else min(self.end, last))

    def __str__(self) -> str:
        return f"from {self.start}" + ("" if self.end is None else f" to {self.end}")


@dataclass(frozen=True)
class Event:
    """One change of state.

    Attributes
    ----------
    sequence : 1, 2, … over the whole registry.
    calibration : id of the record.
    record_digest : digest of its content.
    state : its new state.
    valid_from, valid_to : on which days it holds from now on, ISO 8601; None: on none, or no end.
    successor : id of the record that superseded it.
    person, at : who and when (UTC).
    note : what that person had to say.
    although : why a record was approved that its own calibration refuses.
    previous : digest of the event before; zeros before the first one.
    digest : of all this.
    """

    sequence: int
    calibration: int
    record_digest: str
    state: str
    valid_from: str | None
    valid_to: str | None
    successor: int | None
    person: str
    at: str
    note: str
    although: str
    previous: str
    digest: str = ""

    @property
    def sealed(self) -> Event:
        """The same event with the digest of its values."""
        return Event(**{**asdict(self), "digest": self.expected_digest})

    @property
    def expected_digest(self) -> str:
        """The digest of its values."""
        content = {name: _plain(value) for name, value in asdict(self).items() if name != "digest"}
        return hashlib.sha256(json_text(content).encode()).hexdigest()

    @property
    def validity(self) -> Validity | None:
        """Days on which the record is valid after this event; None: none."""
        if self.valid_from is None:
            return None
        end = None if self.valid_to is None else date.fromisoformat(self.valid_to)
        return Validity(date.fromisoformat(self.valid_from), end)


def _plain(value: object) -> JSON:
    # A database that was edited may hold anything.
    return value if value is None or isinstance(value, str | int) else repr(value)
