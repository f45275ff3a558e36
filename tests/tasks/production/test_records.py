"""What production remembers of a run, from its delivery to its end."""

from __future__ import annotations

import json
import os
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from sqlalchemy import event, text, update

from tasks.errors import InputError
from tasks.files.installation import InstallationError
from tasks.production.outbox import Outbox
from tasks.production.records import Records, configured_records
from tasks.production.run_record import RECORDS_VARIABLE, RunRecord, StageTime, project_name
from tasks.production.tables import SCHEMA
from tests.tasks.forked import in_processes

NOON = datetime(2026, 11, 20, 12, tzinfo=UTC)
RUN = RunRecord(
    "one", "block-7", "/data/block-7/project.toml", "/data/block-7/results", "story", "Scheduled", "", NOON
)
HOSTILE = "'; DROP TABLE aerocal_runs; -- <script>alert(1)</script> \u202e ω"


def found(records: Records) -> RunRecord:
    run = records.run("one")
    assert run is not None
    return run


def test_records_that_do_not_exist_are_empty_and_reading_makes_none(records: Records) -> None:
    assert records.runs() == ()
    assert records.run("one") is None
    assert records.of_deliveries(["key"]).get("key") is None
    if records.address.file is not None:
        assert not records.address.file.exists()


def test_a_run_is_remembered_from_delivery_to_end(records: Records) -> None:
    records.schedule(replace(RUN, delivery="key"))
    assert records.of_deliveries(["key"]).get("key") == replace(RUN, delivery="key")
    records.begin(replace(RUN, message="begun"))
    begun = records.run("one")
    assert begun is not None
    assert (begun.state, begun.delivery, begun.scheduled, begun.attempts) == ("Running", "key", NOON, 1)
    assert begun.process == os.getpid()
    assert begun.begun is not None
    assert not begun.has_ended
    stages = (StageTime("bundle_adjustment", 1.25, False), StageTime("write_report", 0.0, True))
    summary = {"sigma0": 1.02, "rmse_check_m": [0.01, None, float("nan")], "gates": []}
    records.end("one", "GateFailed", "Gates not passed: sigma0.", stages=stages, summary=summary)
    ended = records.run("one")
    assert ended is not None
    assert (ended.state, ended.message, ended.stages) == ("GateFailed", "Gates not passed: sigma0.", stages)
    assert (ended.figures.sigma0, ended.figures.rmse_check_m) == (1.02, (0.01, None, None))
    (row,) = records.rows(text("SELECT summary FROM aerocal_runs"))
    assert json.loads(row.summary) == {"sigma0": 1.02, "rmse_check_m": [0.01, None, None], "gates": []}
    assert ended.ended is not None
    assert ended.begun == begun.begun
    assert ended.ended >= begun.begun


def test_a_decided_end_is_final_until_somebody_begins_the_run_again(records: Records) -> None:
    records.begin(RUN)
    records.end("one", "Completed", "done")
    records.lose("one", "Crashed", "too late")
    records.end("one", "Failed", "too late", may_pass=True)
    assert found(records).state == "Completed"
    assert found(records).message == "done"
    assert found(records).again_at is None
    records.begin(RUN)
    assert (found(records).state, found(records).ended, found(records).attempts) == ("Running", None, 1)


def test_a_run_that_was_only_out_of_sight_notes_its_end_all_the_same(records: Records) -> None:
    records.begin(RUN)
    records.lose("one", "Crashed", "no sign of life")
    records.end("one", "GateFailed", "sigma0")
    assert (found(records).state, found(records).message, found(records).again_at) == (
        "GateFailed",
        "sigma0",
        None,
    )


def test_a_run_that_the_machine_has_ended_is_due_and_begun_again_once(records: Records) -> None:
    records.begin(replace(RUN, delivery="key"))
    records.lose("one", "Crashed", "killed.")
    (due,) = records.due(datetime.now(UTC))
    assert due.id == "one"
    assert not due.has_ended
    assert due.message.startswith("killed. It is restarted after ")
    assert records.begin_again(due, "Finished stages are kept.")
    assert not records.begin_again(due, "Finished stages are kept."), "somebody else has"
    waiting = records.of_deliveries(["key"]).get("key")
    assert waiting is not None
    assert (waiting.state, waiting.ended, waiting.attempts) == ("Scheduled", None, 2)
    assert records.due(datetime.now(UTC)) == ()


def test_a_run_that_ends_the_machine_every_time_is_given_up(records: Records) -> None:
    records.schedule(RUN)
    later = datetime.now(UTC) + timedelta(days=1)
    for attempt in range(1, 5):
        # Killed before it could note that it had started (every second time).
        if attempt % 2:
            records.begin(RUN)
        records.lose("one", "Crashed", "out of memory.")
        (due,) = records.due(later)
        assert due.attempts == attempt
        assert records.begin_again(due, "again")
    records.begin(RUN)
    records.lose("one", "Crashed", "out of memory.")
    assert records.due(later) == ()
    assert found(records).has_ended
    assert found(records).message == (
        "out of memory. It was started 5 times and is not restarted automatically."
    )
    records.begin(RUN)
    assert found(records).attempts == 1, "somebody has asked for it anew"


def test_what_may_pass_is_tried_again_and_what_may_not_is_not(records: Records) -> None:
    later = datetime.now(UTC) + timedelta(days=1)
    records.begin(RUN)
    records.end("one", "Failed", "A defect.")
    assert (found(records).again_at, found(records).message) == (None, "A defect.")
    records.begin(RUN)
    records.end("one", "Failed", "No space left.", may_pass=True)
    assert [run.id for run in records.due(later)] == ["one"]
    assert records.due(datetime.now(UTC)) == (), "somebody has to make room first"
    assert records.due(datetime.now(UTC) - timedelta(minutes=30)) == ()
    behind = datetime.now(UTC) - timedelta(hours=2)
    assert [run.id for run in records.due(behind)] == ["one"], "the clock of the runner was ahead"
    records.give_up("one")
    assert records.due(later) == ()
    for state in ("Cancelled", "TimedOut"):
        records.begin(RUN)
        records.lose("one", state, "as asked")  # type: ignore[arg-type]
        assert records.due(later) == ()
        assert found(records).message == "as asked"


def test_a_run_that_nobody_can_begin_again_is_not_said_to_be(records: Records) -> None:
    """One that a command has started, e.g."""
    records.begin(RUN)
    records.end("one", "Failed", "The disk is full.", may_pass=True)
    assert "The disk is full. It is restarted after" in found(records).message
    records.give_up("one")
    assert found(records).message == "The disk is full. It is not restarted automatically."
    (notice,) = Outbox(records).waiting()
    assert notice.message == found(records).message


def test_a_run_that_began_before_its_delivery_was_noted_belongs_to_it(records: Records) -> None:
    records.begin(RUN)
    records.schedule(replace(RUN, delivery="key"))
    known = records.of_deliveries(["key"]).get("key")
    assert known is not None
    assert (known.id, known.state) == ("one", "Running")


def test_scheduling_a_known_run_changes_nothing(records: Records) -> None:
    records.begin(RUN)
    records.schedule(replace(RUN, project="another"))
    assert [(run.project, run.state) for run in records.runs()] == [("block-7", "Running")]


def test_a_run_that_is_scheduled_and_begun_at_once_is_recorded_once(records: Records) -> None:
    records.prepare()
    with ThreadPoolExecutor(2) as both:
        with records.writing() as connection:
            if not records.address.is_file:
                # Both find no record of the run; neither can write one yet.
                connection.execute(text("LOCK TABLE aerocal_runs IN SHARE MODE"))
            noted = [both.submit(records.schedule, replace(RUN, delivery="key"))]
            noted.append(both.submit(records.begin, RUN))
            assert not wait(noted, 1.5).done
        for one in noted:
            one.result(30)
    assert (found(records).state, found(records).delivery) == ("Running", "key")
    assert len(records.runs()) == 1


def test_runs_come_latest_first_and_can_be_chosen(records: Records) -> None:
    for number in range(4):
        records.schedule(replace(RUN, id=str(number), scheduled=NOON + timedelta(hours=number)))
    records.begin(replace(RUN, id="1"))
    assert [run.id for run in records.runs()] == ["3", "2", "1", "0"]
    assert [run.id for run in records.runs(states=("Running",))] == ["1"]
    assert [run.id for run in records.runs(most=2)] == ["3", "2"]
    assert [run.id for run in records.runs(id="2")] == ["2"]


def test_any_text_comes_back_as_it_was(records: Records) -> None:
    records.schedule(replace(RUN, id=HOSTILE, project=HOSTILE, message=HOSTILE, delivery=HOSTILE))
    found = records.of_deliveries([HOSTILE]).get(HOSTILE)
    assert found is not None
    assert (found.id, found.project, found.message) == (HOSTILE, HOSTILE, HOSTILE)
    assert len(records.runs()) == 1


def test_processes_that_begin_at_once_make_the_tables_once(records: Records) -> None:
    address = records.address
    place = str(address.file) if address.is_file else address.url.render_as_string(hide_password=False)
    place = place.replace("postgresql+pg8000", "postgresql")

    def begin_five(index: int) -> str:
        own = Records.at(place)
        for number in range(5):
            own.begin(RunRecord(f"{index}-{number}", "p", "", "", "s", "Running", "", NOON))
        return "begun"

    assert in_processes(4, begin_five) == ["begun"] * 4
    assert len(records.runs()) == 20


def test_tables_of_another_version_are_refused(records: Records) -> None:
    records.prepare()
    with records.engine.connect() as connection, connection.begin():
        connection.execute(update(SCHEMA).values(version=99))
    with pytest.raises(InputError, match="version 99"):
        records.runs()
    with pytest.raises(InputError, match="version 99"):
        records.begin(RUN)


def test_the_environment_names_the_records(tmp_path: Path) -> None:
    assert configured_records({}) is None
    found = configured_records({RECORDS_VARIABLE: str(tmp_path / "r.sqlite")})
    assert found is not None
    assert found.address.file == tmp_path / "r.sqlite"


@pytest.mark.parametrize(
    ("file", "name"),
    [("/data/block-7/project.toml", "block-7"), ("/data/strict.toml", "strict"), ("block-7.2", "block-7.2")],
)
def test_a_project_is_called_by_its_folder(file: str, name: str) -> None:
    assert project_name(Path(file)) == name


def test_a_full_disk_is_called_so(tmp_path: Path) -> None:
    records = Records.at(str(tmp_path / "records.sqlite"))
    records.prepare()
    event.listen(records.engine, "connect", lambda file, _: file.execute("PRAGMA max_page_count = 1"))
    with pytest.raises(InstallationError, match="There is no space left on the disk of"):
        records.schedule(replace(RUN, message="long " * 10_000))
    assert records.runs() == ()
