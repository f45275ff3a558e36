"""A further runner takes the runs that it can read, and no others."""

from __future__ import annotations

import asyncio
import logging
from pathlib import Path
from uuid import uuid4

import pytest
from prefect.client.schemas.objects import FlowRun

from flows.server.roots import roots_of
from flows.serving.deployments import Readable


def test_runs_outside_its_folders_are_left_to_others_and_said_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for name in ("root", "inbox"):
        (tmp_path / name / "block").mkdir(parents=True)
        (tmp_path / name / "block" / "project.toml").touch()
    delivered, below = (str(tmp_path / name / "block") for name in ("inbox", "root"))
    runs = [FlowRun(flow_id=uuid4(), parameters={"project": name}) for name in (delivered, below, "block")]
    unreadable = [FlowRun(flow_id=uuid4(), parameters={"project": "gone"}), FlowRun(flow_id=uuid4())]

    async def found() -> list[FlowRun]:
        return [*runs, *unreadable]

    asked = Readable(roots_of([tmp_path / "root"])).only(found)
    with caplog.at_level(logging.WARNING, logger="aerocal"):
        for _ in range(2):
            assert asyncio.run(asked()) == runs[1:]  # type: ignore[arg-type]
    said = [record.getMessage() for record in caplog.records]
    assert len(said) == 3
    assert said[0] == (
        f"a run of {delivered} is left to other runners: this one can read projects in {tmp_path / 'root'} "
        "only (--root)"
    )
