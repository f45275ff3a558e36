"""Add calibrations to a registry, approve them, read them; nothing is ever changed or removed.

Its history may grow, but never shrink. Whoever owns the database can drop the last event and set the head
back; nothing in the registry then shows it. What was seen of it is therefore kept elsewhere, in the state
folder of this user, and a history that does not contain it was cut or rewritten, or comes from an older
backup.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from sqlalchemy import Connection, delete, insert, inspect, select, update

from tasks.database.address import DatabaseAddress
from tasks.database.engine import WAIT_S
from tasks.errors import InputError
from tasks.files.json_text import read_json, replace_json
from tasks.files.state_folder import state_folder
from tasks.plain_text import is_blank
from tasks.registry.approval import Approval, approved_meanwhile, require_approvable, superseded_by
from tasks.registry.calibration_file import SealedRecord
from tasks.registry.contents import Contents, Finding, StoredCalibration
from tasks.registry.database import RegistryDatabase
from tasks.registry.history import BEGINNING, Event, Validity
from tasks.registry.identity import CameraBody
from tasks.registry.integrity import Rows, contents_of
from tasks.registry.query_tables import record_row_findings, row_findings, write_rows
from tasks.registry.radiometric import RadiometricResult, findings
from tasks.registry.tables import CALIBRATIONS, EVENTS, HEAD, RADIOMETRIC, RADIOMETRIC_HEAD
from tasks.store.stage_record import utc_now


def witness_file(address: DatabaseAddress) -> Path:
    """File with the last seen state of a registry."""
    return state_folder() / "registries" / f"{hashlib.sha256(str(address).encode()).hexdigest()[:16]}.json"


def lost_state(address: DatabaseAddress, events: Sequence[Event]) -> tuple[Finding, ...]:
    """A finding if the last seen state is not part of a history."""
    seen = _seen(address)
    if seen is None or any(event.digest == seen["state"] for event in events):
        return ()
    return (
        Finding(
            f"The history has {len(events)} events and does not contain the state "
            f"{str(seen['state'])[:12]}…, the last of {seen['events']} that this user saw on "
            f"{str(seen['at'])[:10]}: events were removed or rewritten, or an older backup was restored. "
            f"If that was intended, delete {witness_file(address)}."
        ),
    )


def remember(address: DatabaseAddress, events: Sequence[Event]) -> None:
    """Keep the state of a sound registry; a user without a writable folder has no witness."""
    seen = _seen(address)
    if not events or (seen is not None and seen["events"] == len(events)):
        return
    file = witness_file(address)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        state, at = events[-1].digest, utc_now()
        replace_json(file, {"registry": str(address), "events": len(events), "state": state, "at": at})
    except OSError:
        return


def _seen(address: DatabaseAddress) -> dict[str, object] | None:
    try:
        content = read_json(witness_file(address))
    except (OSError, ValueError):
        return None
    known = isinstance(content, dict) and {"events", "state", "at"} <= content.keys()
    return dict(content) if isinstance(content, dict) and known else None


@dataclass(frozen=True)
class Signature:
    """The person responsible for an action, and a comment.

    Raises
    ------
    InputError
        If the name is blank.
    """

    person: str
    note: str = ""

    def __post_init__(self) -> None:
        if is_blank(self.person):
            raise InputError(
                "The name of the person responsible is blank.", "Give it: --by NAME.", entity="--by"
            )


@dataclass(frozen=True)
class Registry:
    """A registry of calibrations in a database."""

    database: RegistryDatabase

    @classmethod
    def at(cls, address: DatabaseAddress, wait_s: float = WAIT_S) -> Registry:
        """The registry at an address.

        Parameters
        ----------
        wait_s : how long a writer waits for another one.
        """
        return cls(RegistryDatabase.at(address, wait_s))

    def contents(self) -> Contents:
        """Everything in it, checked against its history.

        Raises
        ------
        InputError
            If there is no registry.
        InstallationError
            If the database cannot be reached.
        """
        with self.database.reading() as connection:
            return self._witnessed(connection)

    def verified(self) -> Contents:
        """As `contents`, with the tables of parameters and covariances also checked against the records."""
        with self.database.reading() as connection:
            contents = self._witnessed(connection)
            return replace(contents, findings=(*contents.findings, *row_findings(connection, contents)))

    def calibration(self, text: str) -> StoredCalibration:
        """The record with an id, or with a digest that begins so; its rows in the query tables are checked.

        Raises
        ------
        InputError
            If there is none, or it was edited.
        """
        with self.database.reading() as connection:
            contents = self._witnessed(connection)
            found = contents.calibration(text)
            differing = tuple(record_row_findings(connection, found))
        replace(contents, findings=differing).require_sound((found.id,))
        return found

    def add(self, sealed: SealedRecord, signature: Signature) -> StoredCalibration:
        """Add a record as the next version of its camera, as a draft.

        Raises
        ------
        InputError
            If it is there already, or the registry was edited.
        """
        with self.database.writing() as connection:
            contents = self._held_against_witness(connection)
            contents.require_untouched()
            there = next((i for i in contents.calibrations if i.sealed.digest == sealed.digest), None)
            if there is not None:
                raise InputError(
                    f"This calibration is already in the registry: it is {there.label}, added by "
                    f"{there.events[0].person} on {there.events[0].at[:10]}.",
                    f"`aerocal registry show {there.id}` shows it.",
                )
            number = _insert_record(connection, sealed)
            (event,) = _append(connection, [_event(number, sealed.digest, "draft", signature)])
            added = _contents(connection)
        remember(self.database.address, added.events)
        return next(item for item in added.calibrations if item.id == event.calibration)

    def radiometric(self) -> tuple[RadiometricResult, ...]:
        """Radiometric examinations, oldest first.

        Raises
        ------
        InputError
            If there is no registry, or one of them was edited.
        """
        with self.database.reading() as connection:
            return _radiometric(connection)

    def add_radiometric(self, content: str, signature: Signature) -> RadiometricResult:
        """Add a radiometric examination as the next version of its camera.

        Raises
        ------
        InputError
            If it is there already, or the registry was edited.
        """
        with self.database.writing() as connection:
            known = _radiometric(connection)
            made = RadiometricResult(len(known) + 1, 1, content, signature.person, utc_now(), signature.note)
            there = next((one for one in known if one.digest == made.digest), None)
            if there is not None:
                raise InputError(
                    f"This examination is in the registry already: radiometric result {there.id} of "
                    f"{there.record.label}, added by {there.person} on {there.at[:10]}.",
                    "Nothing is to be done.",
                )
            version = 1 + sum(one.record.camera_key == made.record.camera_key for one in known)
            made = replace(made, version=version, previous=known[-1].seal if known else BEGINNING)
            made = replace(made, seal=made.expected_seal)
            connection.execute(
                insert(RADIOMETRIC).values(
                    {column.name: getattr(made, column.name) for column in RADIOMETRIC.c}
                )
            )
            connection.execute(delete(RADIOMETRIC_HEAD))
            connection.execute(insert(RADIOMETRIC_HEAD).values(one=1, results=made.id, seal=made.seal))
        return made

    def approve(self, approval: Approval, signature: Signature, although: str = "") -> tuple[Event, ...]:
        """Carry out an approval, and supersede the calibration that was in force.

        Parameters
        ----------
        approval : what was looked at before deciding.
        although : why a record is approved that its own calibration refuses.

        Returns
        -------
        events : what happened, the approval first.

        Raises
        ------
        InputError
            If the record was edited or cannot be approved, or another approval of the same camera came
            between looking and deciding.
        """
        with self.database.writing() as connection:
            contents = self._held_against_witness(connection)
            contents.require_untouched()
            chosen = contents.calibration(str(approval.chosen.id))
            approved_meanwhile(contents, approval)
            require_approvable(contents, chosen, approval.validity, although)
            digest = chosen.sealed.digest
            events = [
                replace(
                    _event(chosen.id, digest, "approved", signature, approval.validity), although=although
                )
            ]
            for old, left in superseded_by(contents, chosen, approval.validity):
                event = _event(old.id, old.sealed.digest, "superseded", Signature(signature.person), left)
                events.append(replace(event, successor=chosen.id))
            appended = _append(connection, events)
        remember(self.database.address, (*contents.events, *appended))
        return appended

    def _held_against_witness(self, connection: Connection) -> Contents:
        """Contents, with a finding if this user has seen a state that is no longer part of the history."""
        contents = _contents(connection)
        lost = lost_state(self.database.address, contents.events)
        return replace(contents, findings=(*contents.findings, *lost))

    def _witnessed(self, connection: Connection) -> Contents:
        """The same for a committed state, which is remembered if there is no finding."""
        contents = self._held_against_witness(connection)
        if not contents.findings:
            remember(self.database.address, contents.events)
        return contents


def _radiometric(connection: Connection) -> tuple[RadiometricResult, ...]:
    """The radiometric results, if they are as they were written."""
    if not inspect(connection).has_table(RADIOMETRIC.name):
        return ()
    rows = connection.execute(select(RADIOMETRIC).order_by(RADIOMETRIC.c.id)).mappings()
    results = tuple(RadiometricResult(**row) for row in rows)
    heads = [dict(row) for row in connection.execute(select(RADIOMETRIC_HEAD)).mappings()]
    wrong = tuple(findings(results, heads[0] if heads else None))
    if wrong:
        raise InputError("The registry was edited: " + " ".join(wrong[:3]), "Restore it from a backup.")
    return results


def _contents(connection: Connection) -> Contents:
    def rows(statement: object) -> list[dict[str, object]]:
        return [dict(row) for row in connection.execute(statement).mappings()]  # type: ignore[call-overload]

    return contents_of(
        Rows(
            rows(select(HEAD)),
            rows(select(CALIBRATIONS).order_by(CALIBRATIONS.c.id)),
            rows(select(EVENTS).order_by(EVENTS.c.sequence)),
        )
    )


def _event(
    number: int, digest: str, state: str, signature: Signature, validity: Validity | None = None
) -> Event:
    """An event that is not yet in the history."""
    start = None if validity is None else validity.start.isoformat()
    end = None if validity is None or validity.end is None else validity.end.isoformat()
    person, note = signature.person, signature.note
    return Event(0, number, digest, state, start, end, None, person, utc_now(), note, "", BEGINNING)


def _insert_record(connection: Connection, sealed: SealedRecord) -> int:
    """Write a record with its rows; returns its id."""
    record = sealed.record
    camera = CameraBody.of_calibration(record)
    number = int(connection.execute(select(HEAD.c.calibrations)).scalar_one()) + 1
    same = select(CALIBRATIONS.c.id).where(CALIBRATIONS.c.camera_key == camera.camera_key)
    version = len(connection.execute(same).all()) + 1
    flown = record.flight.flown
    connection.execute(
        insert(CALIBRATIONS).values(
            id=number,
            camera_key=camera.camera_key,
            mounting_key=camera.mounting_key,
            version=version,
            digest=sealed.digest,
            camera=camera.name,
            flown=None if flown is None else flown.isoformat(),
            verdict=record.verdict,
            content=sealed.content,
        )
    )
    write_rows(connection, number, record)
    connection.execute(update(HEAD).values(calibrations=number))
    return number


def _append(connection: Connection, events: Sequence[Event]) -> tuple[Event, ...]:
    """Seal events, chain them to the last one, and write them."""
    head = connection.execute(select(HEAD.c.events, HEAD.c.digest)).one()
    sequence, digest, sealed = int(head.events), str(head.digest), list[Event]()
    for event in events:
        sequence += 1
        sealed.append(replace(event, sequence=sequence, previous=digest).sealed)
        digest = sealed[-1].digest
    connection.execute(
        insert(EVENTS), [{column.name: getattr(e, column.name) for column in EVENTS.c} for e in sealed]
    )
    connection.execute(update(HEAD).values(events=sequence, digest=digest))
    return tuple(sealed)
