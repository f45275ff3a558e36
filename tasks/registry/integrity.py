"""Content that the registry did not write: edited records, a history with gaps, misplaced values."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any

from pydantic import ValidationError

from tasks.registry.calibration_file import SealedRecord
from tasks.registry.contents import Contents, Finding, StoredCalibration
from tasks.registry.history import BEGINNING, PREDECESSORS, Event
from tasks.registry.identity import CameraBody

_DAY = re.compile(r"\d{4}-\d{2}-\d{2}")


@dataclass(frozen=True)
class Rows:
    """Rows of the tables as they are.

    Attributes
    ----------
    head : of ``registry_head``.
    calibrations : by id.
    events : by sequence.
    """

    head: Sequence[Mapping[str, Any]]
    calibrations: Sequence[Mapping[str, Any]]
    events: Sequence[Mapping[str, Any]]


def contents_of(rows: Rows) -> Contents:
    """The records that fit their history, and everything that does not fit."""
    events = tuple(Event(**row) for row in rows.events)
    by_record: dict[Any, list[Event]] = {}
    for event in events:
        by_record.setdefault(event.calibration, []).append(event)
    findings = [*_chain_findings(events), *_head_findings(rows, by_record)]
    for row in rows.calibrations:
        own = by_record.get(row["id"], [])
        findings += [*_record_findings(row, own), *_state_findings(row["id"], own)]
    known = {row["id"] for row in rows.calibrations}
    for missing, own in by_record.items():
        if missing not in known:
            sentence = (
                f"Calibration {missing} is missing; event {own[0].sequence} of the history refers to it "
                f"(digest {_short(own[0].record_digest)})."
            )
            findings.append(Finding(sentence))
    findings += [] if findings else _version_findings(rows)
    doubtful = {finding.calibration for finding in findings}
    stored = tuple(
        StoredCalibration(
            row["id"], row["version"], SealedRecord(row["content"]), tuple(by_record[row["id"]])
        )
        for row in rows.calibrations
        if row["id"] not in doubtful
    )
    findings += _overlaps(stored)
    return Contents(stored, tuple(findings), events)


def _overlaps(stored: Sequence[StoredCalibration]) -> Iterator[Finding]:
    """Calibrations of one camera and mounting that hold on the same day: an approval leaves no such days."""
    held = [(item, item.validity) for item in stored if item.validity is not None]
    for (old, one), (new, other) in combinations(held, 2):
        same = old.camera.camera_key == new.camera.camera_key
        if same and old.camera.mounting_key == new.camera.mounting_key and one.overlaps(other):
            sentence = (
                f"Calibrations {old.id} and {new.id} of the same camera hold {one} and {other}: the event "
                "that ended one of them was removed."
            )
            yield from (Finding(sentence, item.id) for item in (old, new))


def _chain_findings(events: Sequence[Event]) -> Iterator[Finding]:
    """Events whose digest does not cover their values, and places where the chain is broken."""
    for event in events:
        if event.digest != event.expected_digest:
            yield Finding(
                f"Event {event.sequence} ({event.state}, calibration {event.calibration}): its values do "
                "not match its digest; one of them was changed.",
                event.calibration,
            )
    first = [Event(0, 0, "", "", None, None, None, "", "", "", "", "", BEGINNING)]
    for before, event in pairwise([*first, *events]):
        place = f"before event {event.sequence} ({event.state}, calibration {event.calibration})"
        if event.sequence != before.sequence + 1:
            yield Finding(f"The history has a gap {place}: an event was removed.")
        elif event.previous != before.digest:
            yield Finding(
                f"The history does not continue {place}: an event was changed, removed, inserted or moved."
            )


def _head_findings(rows: Rows, by_record: Mapping[Any, Sequence[Event]]) -> Iterator[Finding]:
    """The registry's counters compared with its content."""
    if len(rows.head) != 1:
        yield Finding("The row of registry_head is missing.")
        return
    head, count = rows.head[0], len(rows.events)
    if head["events"] != count:
        yield Finding(
            f"The registry has counted {head['events']} events, but there are {count}: some were removed or "
            "inserted."
        )
    elif head["digest"] != (rows.events[-1]["digest"] if count else BEGINNING):
        yield Finding("The last event is not the one written last by the registry.")
    # A record without a history is named by itself.
    known = sum(row["id"] in by_record for row in rows.calibrations)
    if head["calibrations"] != known:
        yield Finding(
            f"The registry has counted {head['calibrations']} calibrations with a history, but there are "
            f"{known}."
        )


def _record_findings(row: Mapping[str, Any], events: Sequence[Event]) -> Iterator[Finding]:
    """Content and columns of a record against its digest and its first event."""
    number, content = row["id"], str(row["content"])
    name = f"Calibration {number} ({row['camera']}, version {row['version']})"
    if not events:
        yield Finding(f"{name} has no history: it was inserted without aerocal.", number)
        return
    digest = hashlib.sha256(content.encode()).hexdigest()
    expected = events[0].record_digest
    if digest != expected:
        yield Finding(
            f"{name}: its content has the digest {_short(digest)}, but the history says "
            f"{_short(expected)}; the content was changed.",
            number,
        )
        return
    try:
        camera = CameraBody.of_calibration(SealedRecord(content).record)
        record = SealedRecord(content).record
    except ValidationError:
        yield Finding(
            f"{name}: its content is not a calibration that this version of aerocal can read.", number
        )
        return
    flown = record.flight.flown
    columns = {
        "digest": digest,
        "camera_key": camera.camera_key,
        "mounting_key": camera.mounting_key,
        "camera": camera.name,
        "flown": None if flown is None else flown.isoformat(),
        "verdict": record.verdict,
    }
    for column, value in columns.items():
        if row[column] != value:
            yield Finding(f"{name}: {column} is '{row[column]}', but its content says '{value}'.", number)
    if any(event.record_digest != digest for event in events):
        yield Finding(f"{name}: an event of its history refers to different content.", number)


def _state_findings(number: int, events: Sequence[Event]) -> Iterator[Finding]:
    """Whether the states follow each other as they must."""
    before: str | None = None
    for event in events:
        if before not in PREDECESSORS.get(event.state, ()):
            yield Finding(
                f"Calibration {number}: its history goes from {before or 'nothing'} to {event.state} (event "
                f"{event.sequence}); an event in between was removed.",
                number,
            )
            return
        days = [day for day in (event.valid_from, event.valid_to) if day is not None]
        if not all(_DAY.fullmatch(str(day)) for day in days):
            yield Finding(f"Calibration {number}: event {event.sequence} has no dates.", number)
            return
        before = event.state


def _version_findings(rows: Rows) -> Iterator[Finding]:
    """Whether the versions of each camera are counted 1, 2, …; of a registry in which all else is right."""
    counted: dict[str, int] = {}
    for row in rows.calibrations:
        due = counted[row["camera_key"]] = counted.get(row["camera_key"], 0) + 1
        if row["version"] != due:
            yield Finding(f"Calibration {row['id']}: version {row['version']} where {due} is due.", row["id"])


def _short(digest: str) -> str:
    return f"{digest[:12]}…"
