"""Whatever is edited behind the registry's back is found, named, and never served."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest
from sqlalchemy import Connection, delete, insert, select, text, update

from tasks.errors import InputError
from tasks.registry.history import Event
from tasks.registry.registry import Registry
from tasks.registry.tables import CALIBRATIONS, COVARIANCES, EVENTS, HEAD, PARAMETERS
from tasks.settings.registry import registry_address
from tests.postgresql_server import PostgresqlServer
from tests.tasks.registry.records import add, approve, changed, record

Edit = Callable[[Connection], object]


def fill(registry: Registry) -> None:
    """Three calibrations of a camera: superseded, approved, draft; six events."""
    for number in range(3):
        add(registry, record(changed(number)))
    approve(registry, 1, date(2024, 3, 1))
    approve(registry, 2, date(2024, 9, 1))


@pytest.fixture(scope="module")
def filled_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("registry") / "filled.sqlite"
    fill(Registry.at(registry_address(str(file))))
    return file


@pytest.fixture(scope="module")
def filled_database(postgresql: PostgresqlServer) -> str:
    """The name of a database that is only copied."""
    fill(Registry.at(registry_address(postgresql.copied("template0", "filled"))))
    return "filled"


@pytest.fixture
def filled(registry: Registry, filled_file: Path, request: pytest.FixtureRequest) -> Registry:
    place = registry.database.address.file
    if place is not None:
        shutil.copy(filled_file, place)
        return registry
    server, source = (request.getfixturevalue(name) for name in ("postgresql", "filled_database"))
    return Registry.at(registry_address(server.copied(source, "edited")), wait_s=20.0)


def edit(registry: Registry, *edits: Edit) -> None:
    """Edit the tables as somebody with the database's own tools would."""
    with registry.database.engine.connect() as connection:
        if connection.dialect.name == "sqlite":
            # SQLite's own shell does not enforce foreign keys; a server's owner may drop them.
            connection.connection.driver_connection.execute("PRAGMA foreign_keys = OFF")  # type: ignore[union-attr]
        else:
            for table in (EVENTS, PARAMETERS, COVARIANCES):
                name = f"{table.name}_calibration_fkey"
                connection.execute(text(f"ALTER TABLE {table.name} DROP CONSTRAINT IF EXISTS {name}"))
        for one in edits:
            one(connection)
        connection.commit()


def of_record(number: int, /, **values: object) -> Edit:
    return lambda c: c.execute(update(CALIBRATIONS).where(CALIBRATIONS.c.id == number).values(**values))


def of_event(sequence: int, /, **values: object) -> Edit:
    return lambda c: c.execute(update(EVENTS).where(EVENTS.c.sequence == sequence).values(**values))


def without_event(sequence: int) -> Edit:
    return lambda c: c.execute(delete(EVENTS).where(EVENTS.c.sequence == sequence))


def forged_content(number: int) -> Edit:
    """A focal length 10 µm longer, and nothing else."""

    def forge(connection: Connection) -> None:
        row = select(CALIBRATIONS.c.content).where(CALIBRATIONS.c.id == number)
        content = json.loads(connection.execute(row).scalar_one())
        content["parameters"][0]["value"] += 0.01
        of_record(number, content=json.dumps(content, sort_keys=True, ensure_ascii=False))(connection)

    return forge


def with_fitting_digest(number: int) -> Edit:
    """The digest column made to fit the forged content."""

    def forge(connection: Connection) -> None:
        row = select(CALIBRATIONS.c.content).where(CALIBRATIONS.c.id == number)
        content = str(connection.execute(row).scalar_one())
        of_record(number, digest=hashlib.sha256(content.encode()).hexdigest())(connection)

    return forge


def swapped(one: int, other: int) -> Edit:
    """Two events change places."""

    def swap(connection: Connection) -> None:
        for before, after in ((one, -1), (other, one), (-1, other)):
            of_event(before, sequence=after)(connection)

    return swap


def forged_event(connection: Connection) -> None:
    """The third calibration approved by an event that is sealed and chained as it should be."""
    last = Event(**connection.execute(select(EVENTS).order_by(EVENTS.c.sequence.desc())).mappings().first())  # type: ignore[arg-type]
    digest = connection.execute(select(CALIBRATIONS.c.digest).where(CALIBRATIONS.c.id == 3)).scalar_one()
    forged = replace(
        last, sequence=last.sequence + 1, calibration=3, record_digest=digest, state="approved",
        valid_from="2025-01-01", valid_to=None, successor=None, previous=last.digest,
    ).sealed  # fmt: skip
    values = {column.name: getattr(forged, column.name) for column in EVENTS.c}
    connection.execute(insert(EVENTS).values(**values))


def deleted_record(number: int) -> tuple[Edit, ...]:
    """A record with its rows and its whole history."""
    return (
        *(
            lambda c, t=table: c.execute(delete(t).where(t.c.calibration == number))  # type: ignore[misc]
            for table in (PARAMETERS, COVARIANCES, EVENTS)
        ),
        lambda c: c.execute(delete(CALIBRATIONS).where(CALIBRATIONS.c.id == number)),
    )


def copied_record(connection: Connection) -> None:
    row = dict(connection.execute(select(CALIBRATIONS).where(CALIBRATIONS.c.id == 2)).mappings().one())
    values = {**row, "id": 4, "version": 4, "digest": "f" * 64}
    connection.execute(insert(CALIBRATIONS).values(**values))


# What is done, what is said of it, and which records are then no longer served.
CASES: dict[str, tuple[tuple[Edit, ...], str, str]] = {
    "content": ((forged_content(2),), r"Calibration 2 \(UCE, version 2\): its content has the digest", "2"),
    "content and digest": ((forged_content(2), with_fitting_digest(2)), "the content was changed", "2"),
    "content is not JSON": ((of_record(2, content="{}"),), "the content was changed", "2"),
    "digest": ((of_record(2, digest="0" * 64),), "digest is '0000", "2"),
    "verdict": (
        (of_record(2, verdict="refused"),),
        "verdict is 'refused', but its content says 'accepted'",
        "2",
    ),
    "camera": ((of_record(2, camera_key="{}"),), "camera_key is '{}'", "2"),
    "mounting": ((of_record(2, mounting_key="{}"),), "mounting_key is '{}'", "2"),
    "flown": ((of_record(2, flown="2020-01-01"),), "flown is '2020-01-01'", "2"),
    "version": ((of_record(2, version=9),), "version 9 where 2 is due", "2"),
    "validity": (
        (of_event(4, valid_from="2020-01-01"),),
        "Event 4 .approved, calibration 1.: its values",
        "1",
    ),
    "who": ((of_event(5, person="eve"),), "Event 5 .approved, calibration 2.: its values", "2"),
    "when": ((of_event(5, at="2020-01-01T00:00:00Z"),), "Event 5", "2"),
    "note": ((of_event(1, note="eve"),), "Event 1 .draft, calibration 1.", "1"),
    "reason": ((of_event(5, although="eve"),), "Event 5", "2"),
    "successor": ((of_event(6, successor=3),), "Event 6 .superseded, calibration 1.", "1"),
    "whose event": ((of_event(5, calibration=3),), "calibration 3.: its values do not", "3"),
    "first event removed": ((without_event(1),), "gap before event 2 .draft, calibration 2.", "123"),
    "middle event removed": ((without_event(4),), "gap before event 5 .approved, calibration 2.", "123"),
    "last event removed": ((without_event(6),), "counted 6 events, but there are 5", "123"),
    "reordered": ((swapped(2, 3),), "does not continue before event 2", "123"),
    "event put in": ((forged_event,), "counted 6 events, but there are 7", "123"),
    "event in place of another": ((without_event(6), forged_event), "not the one written last by", "123"),
    "record removed": ((deleted_record(2)[-1],), "Calibration 2 is missing; event 2 of the history", "123"),
    "record and history removed": (deleted_record(3), "gap before event 4|counted 3 calibrations", "123"),
    "record put in": ((copied_record,), "Calibration 4 .* has no history", "4"),
    "head": ((lambda c: c.execute(delete(HEAD)),), "registry_head is missing", "123"),
    "parameter": (
        (lambda c: c.execute(update(PARAMETERS).where(PARAMETERS.c.calibration == 2).values(value=1.0)),),
        "Calibration 2 .*: table calibration_parameters differs from the record in 7 row",
        "2",
    ),
    "covariance": (
        (
            lambda c: c.execute(
                update(COVARIANCES).where(COVARIANCES.c.calibration == 2).values(covariance=0.0)
            ),
        ),
        "Calibration 2 .*: table calibration_covariances differs",
        "2",
    ),
    "rows of no calibration": (
        (
            lambda c: c.execute(
                insert(PARAMETERS).values(
                    calibration=9, parameter="x", entity="y", unit="m", value=1.0, verdict="weak"
                )
            ),
        ),
        "calibration_parameters has rows of a calibration 9",
        "",
    ),
    "parameter removed": (
        (lambda c: c.execute(delete(PARAMETERS).where(PARAMETERS.c.parameter == "bluh:9")),),
        "table calibration_parameters differs from the record in 1 row",
        "123",
    ),
}


@pytest.mark.parametrize("kind", CASES)
def test_every_edit_is_found_and_named_and_never_served(filled: Registry, kind: str) -> None:
    assert not filled.verified().findings
    edits, words, concerned = CASES[kind]
    edit(filled, *edits)
    findings = " ".join(finding.sentence for finding in filled.verified().findings)
    assert re.search(words, findings), findings
    for number in "1234" if "4" in concerned else "123":
        if number in concerned:
            with pytest.raises(InputError, match="The registry was edited") as error:
                filled.calibration(number)
            assert "verify" in error.value.remedy
        else:
            assert filled.calibration(number).id == int(number)


@pytest.mark.parametrize("kind", ["content", "middle event removed", "record removed"])
def test_nothing_is_written_into_a_registry_that_was_edited(filled: Registry, kind: str) -> None:
    edit(filled, *CASES[kind][0])
    with pytest.raises(InputError, match="The registry was edited"):
        approve(filled, 3, date(2025, 1, 1))
    with pytest.raises(InputError, match="The registry was edited"):
        add(filled, record(changed(5)))


def test_a_missing_table_is_said_in_a_sentence(filled: Registry) -> None:
    edit(filled, lambda c: c.execute(text("DROP TABLE calibration_events")))
    with pytest.raises(InputError, match=r"was edited: .*calibration_events"):
        filled.contents()


def cut_behind(sequence: int) -> Edit:
    """The history without its last events, the head set back as if they had never been."""

    def cut(connection: Connection) -> None:
        connection.execute(delete(EVENTS).where(EVENTS.c.sequence > sequence))
        digest = connection.execute(select(EVENTS.c.digest).where(EVENTS.c.sequence == sequence)).scalar_one()
        connection.execute(update(HEAD).values(events=sequence, digest=digest))

    return cut


def test_a_history_cut_at_its_end_is_found_by_whoever_has_seen_it(
    filled: Registry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not filled.verified().findings
    edit(filled, cut_behind(4))
    sentence = filled.verified().findings[0].sentence
    assert "The history has 4 events and does not contain the state" in sentence
    with pytest.raises(InputError, match="The registry was edited"):
        filled.calibration("1")
    with pytest.raises(InputError, match="The registry was edited"):
        approve(filled, 3, date(2025, 1, 1))
    # Deleting what was seen is the way to accept a backup that was restored.
    Path(sentence.split("delete ")[1].rstrip(".")).unlink()
    assert not filled.verified().findings
    monkeypatch.setenv("AEROCAL_STATE", str(tmp_path / "of another user"))
    assert not filled.verified().findings


def test_a_supersession_that_was_cut_off_leaves_two_that_hold_on_one_day(
    filled: Registry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    edit(filled, cut_behind(5))
    monkeypatch.setenv("AEROCAL_STATE", str(tmp_path / "of another user"))
    found = {finding.calibration: finding.sentence for finding in filled.verified().findings}
    assert set(found) == {1, 2}
    assert "Calibrations 1 and 2 of the same camera hold from 2024-03-01 and from 2024-09-01" in found[1]
    assert filled.calibration("3").id == 3
    with pytest.raises(InputError, match="The registry was edited"):
        filled.calibration("2")


def test_whoever_recomputes_the_whole_chain_is_found_by_a_digest_noted_elsewhere(
    filled: Registry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    noted = filled.contents().digest
    add(filled, record(changed(4)))
    assert noted in {event.digest for event in filled.contents().events}

    def rewritten(connection: Connection) -> None:
        rows = connection.execute(select(EVENTS).order_by(EVENTS.c.sequence)).mappings().all()
        before = "0" * 64
        for row in rows:
            person = "eve" if row["sequence"] == 5 else row["person"]
            event = replace(Event(**row), person=person, previous=before).sealed
            values = {"person": person, "previous": before, "digest": event.digest}
            of_event(event.sequence, **values)(connection)
            before = event.digest
        connection.execute(update(HEAD).values(digest=before))

    edit(filled, rewritten)
    # Who has seen it before knows; the registry alone cannot.
    assert "rewritten, or an older backup" in filled.verified().findings[0].sentence
    monkeypatch.setenv("AEROCAL_STATE", str(tmp_path / "of another user"))
    assert not filled.verified().findings
    assert noted not in {event.digest for event in filled.contents().events}
