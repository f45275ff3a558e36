"""Runs of two small stages with results on object storage, and what to ask of them."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pandas as pd

from tasks.object_storage.address import ObjectAddress
from tasks.object_storage.workspace import ObjectWorkspace, PublishedManifest
from tasks.results.publish import publish
from tasks.settings.project import Project
from tasks.store.notes import Notes, write_notes
from tasks.store.stage_record import read_records
from tasks.store.store import Store, stored


@stored("make_tables")
def make_tables(folder: Path, *, names: tuple[str, ...], project: Project, value: float) -> None:
    assert project.project.name == "small"
    for name in names:
        pd.DataFrame({"point": [f"{name}-1"], "value": [value]}).to_parquet(folder / f"{name}.parquet")
    write_notes(folder, Notes((), {"sigma0": value}))


@stored("make_notes")
def make_notes(folder: Path, *, value: float) -> None:
    # Another content at every computing, as of two kinds of machines.
    write_notes(folder, Notes((), {"nanoseconds": time.perf_counter_ns(), "value": value}))


TABLES = ("images", "object_points", "residuals")


def run(
    machine: Path,
    address: ObjectAddress,
    project: Project,
    value: float = 1.0,
    names: tuple[str, ...] = TABLES,
    own: tuple[str, ...] = TABLES,
) -> list[str]:
    """A run of two stages on a machine; the stages that were computed."""
    store = Store.of(machine, ObjectWorkspace.at(address))
    store.begin_run()
    stages = [make_tables(store, names=names, project=project, value=value), make_notes(store, value=value)]
    publish(store, project, stages, own)
    return [record.stage for record in read_records(store.folder) if not record.reused]


BOTH = ["make_tables", "make_notes"]


def manifest_at(address: ObjectAddress) -> PublishedManifest:
    manifest = ObjectWorkspace.at(address).manifest()
    assert manifest is not None
    return manifest


def value_of(folder: Path) -> float:
    """The one value that all tables of a run and its summary hold: anything else is a mixture."""
    values = {float(pd.read_parquet(folder / f"{name}.parquet")["value"][0]) for name in TABLES}
    values.add(json.loads((folder / "summary.json").read_text())["sigma0"])
    assert len(values) == 1
    return values.pop()


def object_of(address: ObjectAddress, name: str) -> str:
    return manifest_at(address).artifacts[name].object
