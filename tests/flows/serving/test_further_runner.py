"""A further runner takes the runs that it can read, and no others."""

from __future__ import annotations

import asyncio
import logging
from pathlib import Path
from uuid import UUID, uuid4

import pytest
from prefect.client.schemas.objects import FlowRun

from flows.server.roots import roots_of
from flows.serving.readable import Folders, Readable

DEPLOYMENT = uuid4()


def projects(folder: Path, *names: str) -> None:
    """Make projects."""
    for name in names:
        (folder / name).mkdir(parents=True)
        (folder / name / "project.toml").touch()


def run_of(project: str, deployment: UUID | None = DEPLOYMENT) -> FlowRun:
    return FlowRun(flow_id=uuid4(), deployment_id=deployment, parameters={"project": project})


def taken(runs: list[FlowRun], own: list[Path], of_server: list[Path], *, times: int = 1) -> list[FlowRun]:
    """What a runner with these folders takes of runs on a server with those."""

    async def found() -> list[FlowRun]:
        return runs

    async def folders() -> Folders:
        return {DEPLOYMENT: tuple(of_server)}

    asked = Readable(roots_of(own), folders).only(found)
    return [asyncio.run(asked()) for _ in range(times)][-1]  # type: ignore[arg-type]


def test_runs_outside_its_folders_are_left_to_others_and_said_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    root, inbox = tmp_path / "root", tmp_path / "inbox"
    projects(tmp_path, "root/block", "inbox/block")
    delivered, below, relative = map(run_of, (str(inbox / "block"), str(root / "block"), "block"))
    unreadable = [run_of("gone"), FlowRun(flow_id=uuid4())]
    with caplog.at_level(logging.WARNING, logger="aerocal"):
        runs = [delivered, below, relative, *unreadable]
        assert taken(runs, [root], [root, inbox], times=2) == [below, relative]
    said = [record.getMessage() for record in caplog.records]
    assert len(said) == 3
    assert said[0] == (
        f"a run of {inbox / 'block'} is left to other runners: this one can read projects in {root} only "
        "(--root)"
    )


def test_a_relative_path_is_taken_only_if_it_is_the_same_project_for_the_server(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    projects(tmp_path, "first/both", "second/both", "second/alone")
    both, alone = run_of("both"), run_of("alone")
    runs, of_server = [both, alone], [first, second]
    assert taken(runs, [first, second], of_server) == runs
    # Under one folder that holds both of the server, its relative paths are others.
    assert taken(runs, [tmp_path], of_server) == []
    assert taken(runs, [tmp_path, first, second], of_server) == runs
    # What is in the folder that comes first for the server, a runner without it does not know.
    assert taken(runs, [second], of_server) == []
    assert taken(runs, [first], of_server) == [both]
    caplog.clear()
    with caplog.at_level(logging.WARNING, logger="aerocal"):
        assert taken(runs, [second, first], of_server) == [alone]
    assert [record.getMessage() for record in caplog.records] == [
        f"a run of both is left to other runners: the path is relative to the folders of the server, "
        f"{first}, {second}, where it may be another project than in those of this one, {second}, {first} "
        "(--root)"
    ]
    assert taken([run_of("both", None)], [first], of_server) == []
