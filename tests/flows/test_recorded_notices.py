"""What runs without a record put into the outbox, and records from before there was one."""

from __future__ import annotations

import errno
from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import create_engine, text

from flows.runs.project_run import RunRequest
from flows.runs.recorded_run import FlowRunIdentity, carry_out_recorded, tell_without_record
from tasks.production.outbox import Outbox
from tasks.production.records import Records
from tasks.production.run_record import RECORDS_VARIABLE
from tasks.results.summary import Summary
from tests.tasks.production.ended_runs import ended_run


def test_a_calibration_that_is_due_is_told_once_for_a_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    address = str(tmp_path / "records.sqlite")
    identity = FlowRunIdentity("1234", "recalibration-due")
    monkeypatch.delenv(RECORDS_VARIABLE, raising=False)
    tell_without_record(identity, "registry", "RecalibrationDue", "Nobody is told without records.")
    monkeypatch.setenv(RECORDS_VARIABLE, address)
    for _ in range(2):
        tell_without_record(identity, "registry", "RecalibrationDue", "UCE-1 expires in 12 days.")
    (notice,) = Outbox(Records.at(address)).waiting()
    assert (notice.kind, notice.message) == ("recalibration", "UCE-1 expires in 12 days.")
    assert notice.subject == "RecalibrationDue: registry (recalibration-due)"


@pytest.mark.parametrize("deployed", [True, False])
def test_only_a_run_that_a_runner_can_begin_again_is_said_to_be_restarted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write_project: Callable[..., Path], deployed: bool
) -> None:
    def story(_project: object, _store: object) -> Summary:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setenv(RECORDS_VARIABLE, str(tmp_path / "records.sqlite"))
    request = RunRequest(write_project(tmp_path / "block"))
    with pytest.raises(OSError, match="No space"):
        carry_out_recorded(story, request, FlowRunIdentity("1", "aerial-triangulation", deployed))
    records = Records.at(str(tmp_path / "records.sqlite"))
    (run,) = records.runs()
    assert (run.state, run.again_at is not None, run.has_ended) == ("Failed", deployed, not deployed)
    assert ("restarted" in run.message) == deployed
    # Whoever waits for nothing is told at once.
    assert len(Outbox(records).waiting()) == (0 if deployed else 1)


def test_records_from_before_there_was_an_outbox_get_one(tmp_path: Path) -> None:
    records = Records.at(str(tmp_path / "records.sqlite"))
    run = ended_run(records, "Completed")
    engine = create_engine(f"sqlite:///{tmp_path / 'records.sqlite'}")
    with engine.begin() as connection:
        connection.execute(text("DROP TABLE aerocal_notices"))
        connection.execute(text("DROP TABLE aerocal_notice_deliveries"))
    engine.dispose()
    records.prepare()
    assert [one.id for one in records.runs()] == [run]
    ended_run(records, "Failed", number=1)
    assert [notice.state for notice in Outbox(records).waiting()] == ["Failed"]
