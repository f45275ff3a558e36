"""Several processes write at once, or are killed while they write: nothing is lost, nothing is half."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from datetime import date
from typing import Any

import pytest
from sqlalchemy import event, func, select

from tasks.database.address import DatabaseAddress
from tasks.errors import InputError
from tasks.files.installation import InstallationError
from tasks.registry.approval import approval_of
from tasks.registry.history import Validity
from tasks.registry.registry import Registry, Signature
from tasks.registry.tables import CALIBRATIONS, METADATA
from tests.tasks.forked import FORK, in_processes
from tests.tasks.registry.records import add, approve, changed, record

START = date(2024, 3, 1)


def test_processes_that_add_at_once_lose_nothing(address: DatabaseAddress) -> None:
    """They also make the tables at the same moment."""

    def work(index: int) -> int:
        registry = Registry.at(address)
        return [add(registry, record(changed(10 * index + k))).version for k in range(3)][-1]

    answers = in_processes(4, work)
    assert all(answer.isdecimal() for answer in answers), answers
    found = Registry.at(address).verified()
    assert not found.findings
    assert [item.version for item in found.calibrations] == list(range(1, 13))
    expected = {record(changed(10 * i + k)).digest for i in range(4) for k in range(3)}
    assert {item.sealed.digest for item in found.calibrations} == expected


def test_processes_that_add_the_same_record_get_it_once(address: DatabaseAddress) -> None:
    answers = in_processes(3, lambda _: add(Registry.at(address), record()).id)
    assert sorted(answers)[0] == "1"
    refused = [answer for answer in answers if "already in the registry" in answer]
    assert len(refused) == 2, answers
    assert len(Registry.at(address).verified().calibrations) == 1


def test_processes_that_approve_different_successors_get_one_conflict(address: DatabaseAddress) -> None:
    registry = Registry.at(address)
    for number in range(3):
        add(registry, record(changed(number)))
    approve(registry, 1, START)
    seen = registry.contents()

    def work(index: int) -> str:
        approval = approval_of(seen, str(2 + index), Validity(date(2024, 9, 1)))
        return str(len(Registry.at(address).approve(approval, Signature(f"person {index}"))))

    answers = in_processes(2, work)
    assert sorted(answers)[0] == "2"  # approved, and the first one superseded
    winner = answers.index("2")
    assert f"In the meantime, person {winner} has approved calibration {2 + winner}" in answers[1 - winner]
    found = Registry.at(address).verified()
    assert not found.findings
    assert found.calibration(str(2 + winner)).state == "approved"
    assert found.calibration(str(3 - winner)).state == "draft"


def killed_at(statement: int, action: Callable[[Registry], object], address: DatabaseAddress) -> bool:
    """Let a process carry out an action and kill it before its statement of that number (0: its commit).

    Returns
    -------
    killed : false if it came to its end before that statement.
    """
    told, tell = FORK.Pipe(duplex=False)

    def run() -> None:
        registry, sent = Registry.at(address), [0]

        def stop() -> None:
            tell.send("here")
            time.sleep(600)

        def count(*_: Any) -> None:
            sent[0] += 1
            if sent[0] == statement:
                stop()

        event.listen(registry.database.engine, "before_cursor_execute", count)
        if statement == 0:
            event.listen(registry.database.engine, "commit", lambda _: stop())
        action(registry)
        tell.send("done")
        # Without what the process that was copied would do at its end (a worker of pytest-xdist fails there).
        os._exit(0)

    process = FORK.Process(target=run)
    process.start()
    assert told.poll(60)
    killed = told.recv() == "here"
    if killed:
        assert process.pid is not None
        os.kill(process.pid, signal.SIGKILL)
    process.join(30)
    assert process.exitcode == (-signal.SIGKILL if killed else 0)
    return killed


def rows(registry: Registry) -> dict[str, int]:
    with registry.database.reading() as connection:
        return {
            table.name: connection.execute(select(func.count()).select_from(table)).scalar_one()
            for table in METADATA.tables.values()
        }


@pytest.mark.parametrize("what", ["add", "approve"])
def test_a_writer_killed_at_any_statement_leaves_nothing_half(
    address: DatabaseAddress, registry: Registry, what: str
) -> None:
    for number in range(2):
        add(registry, record(changed(number)))
    approve(registry, 1, START)
    approval = approval_of(registry.contents(), "2", Validity(date(2024, 9, 1)))
    actions: dict[str, Callable[[Registry], object]] = {
        "add": lambda r: add(r, record(changed(7))),
        "approve": lambda r: r.approve(approval, Signature("ben")),
    }
    before, digest = rows(registry), registry.contents().digest
    assert killed_at(0, actions[what], address)
    statement = 0
    while True:
        found = registry.verified()
        assert not found.findings
        assert (rows(registry), found.digest) == (before, digest)
        statement += 1
        if not killed_at(statement, actions[what], address):
            break
    assert statement > 8
    # The last one was let live: whoever comes after a killed one finds the way free.
    found = registry.verified()
    assert not found.findings
    assert found.digest != digest


def test_a_writer_that_hangs_is_named_and_waited_for_only_so_long(address: DatabaseAddress) -> None:
    registry, impatient = Registry.at(address), Registry.at(address, wait_s=1.0)
    add(registry, record())
    with registry.database.writing(), pytest.raises(InstallationError, match="locked by another process"):
        add(impatient, record(changed(1)))
    assert len(impatient.contents().calibrations) == 1
    add(impatient, record(changed(1)))


def test_readers_are_not_kept_waiting_and_see_nothing_unfinished(address: DatabaseAddress) -> None:
    registry = Registry.at(address)
    add(registry, record())
    with registry.database.writing() as connection:
        connection.execute(CALIBRATIONS.update().values(verdict="refused"))
        assert not Registry.at(address, wait_s=1.0).verified().findings
        connection.rollback()


def test_what_another_program_puts_in_at_the_same_time_is_a_conflict(registry: Registry) -> None:
    """It does not keep to our locks, so a unique constraint has the last word."""
    stored = add(registry, record())

    def put_in() -> None:
        with registry.database.writing() as connection:
            row = connection.execute(select(CALIBRATIONS)).mappings().one()
            connection.execute(CALIBRATIONS.insert().values({**row, "id": 2, "digest": "0" * 64}))

    with pytest.raises(InputError, match="Another program has written") as error:
        put_in()
    assert "Nothing was changed" in error.value.remedy
    assert [item.id for item in registry.contents().calibrations] == [stored.id]
