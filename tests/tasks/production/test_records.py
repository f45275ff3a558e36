"""What production remembers of a run, from its delivery to its end."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from sqlalchemy import update

from tasks.errors import InputError
from tasks.production.records import Records, configured_records, project_name
from tasks.production.run_record import RunRecord, StageTime
from tasks.production.tables import SCHEMA
from tasks.production.variable import RECORDS_VARIABLE

NOON = datetime(2026, 11, 20, 12, tzinfo=UTC)
RUN = RunRecord(
    "one", "block-7", "/data/block-7/project.toml", "/data/block-7/results", "story", "Scheduled", "", NOON
)
HOSTILE = "'; DROP TABLE aerocal_runs; -- <script>alert(1)</script> \u202e ω"


def test_records_that_do_not_exist_are_empty_and_reading_makes_none(records: Records) -> None:
    assert records.runs() == ()
    assert records.run("one") is None
    assert records.of_delivery("key") is None
    if records.address.file is not None:
        assert not records.address.file.exists()


def test_a_run_is_remembered_from_delivery_to_end(records: Records) -> None:
    records.schedule(replace(RUN, delivery="key"))
    assert records.of_delivery("key") == replace(RUN, delivery="key")
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
    assert ended.summary == {"sigma0": 1.02, "rmse_check_m": [0.01, None, None], "gates": []}
    assert ended.ended is not None
    assert ended.begun == begun.begun
    assert ended.ended >= begun.begun


def test_an_end_is_final_until_the_run_begins_again(records: Records) -> None:
    records.begin(RUN)
    records.end("one", "Completed", "done")
    records.end("one", "Crashed", "too late")
    found = records.run("one")
    assert found is not None
    assert (found.state, found.message) == ("Completed", "done")
    records.begin(RUN)
    again = records.run("one")
    assert again is not None
    assert (again.state, again.ended, again.attempts) == ("Running", None, 2)


def test_a_run_that_was_ended_by_the_machine_waits_again(records: Records) -> None:
    records.begin(replace(RUN, delivery="key"))
    records.end("one", "Crashed", "killed")
    records.reschedule("one", "Finished stages are kept.")
    found = records.of_delivery("key")
    assert found is not None
    assert (found.state, found.ended, found.message) == ("Scheduled", None, "Finished stages are kept.")


def test_scheduling_a_known_run_changes_nothing(records: Records) -> None:
    records.begin(RUN)
    records.schedule(replace(RUN, project="another"))
    assert [(run.project, run.state) for run in records.runs()] == [("block-7", "Running")]


def test_runs_come_latest_first_and_can_be_chosen(records: Records) -> None:
    for number in range(4):
        records.schedule(replace(RUN, id=str(number), scheduled=NOON + timedelta(hours=number)))
    records.begin(replace(RUN, id="1"))
    assert [run.id for run in records.runs()] == ["3", "2", "1", "0"]
    assert [run.id for run in records.runs(states=("Running",))] == ["1"]
    assert [run.id for run in records.runs(since=NOON + timedelta(hours=2))] == ["3", "2"]


def test_any_text_comes_back_as_it_was(records: Records) -> None:
    records.schedule(replace(RUN, id=HOSTILE, project=HOSTILE, message=HOSTILE, delivery=HOSTILE))
    found = records.of_delivery(HOSTILE)
    assert found is not None
    assert (found.id, found.project, found.message) == (HOSTILE, HOSTILE, HOSTILE)
    assert len(records.runs()) == 1


def test_processes_that_begin_at_once_make_the_tables_once(records: Records) -> None:
    script = (
        "import sys\n"
        "from datetime import UTC, datetime\n"
        "from tasks.production.records import Records\n"
        "from tasks.production.run_record import RunRecord\n"
        "records = Records.at(sys.argv[1])\n"
        "now = datetime.now(UTC)\n"
        "for n in range(5):\n"
        "    records.begin(RunRecord(f'{sys.argv[2]}-{n}', 'p', '', '', 's', 'Running', '', now))\n"
    )
    address = records.address
    place = str(address.file) if address.is_file else address.url.render_as_string(hide_password=False)
    place = place.replace("postgresql+pg8000", "postgresql")
    children = [subprocess.Popen([sys.executable, "-c", script, place, str(n)]) for n in range(4)]
    assert [child.wait(100) for child in children] == [0, 0, 0, 0]
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
    ("file", "name"), [("/data/block-7/project.toml", "block-7"), ("/data/strict.toml", "strict")]
)
def test_a_project_is_called_by_its_folder(file: str, name: str) -> None:
    assert project_name(Path(file)) == name
