"""Fixtures of the tests against services."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path

import pytest

from tasks.object_storage.address import ObjectAddress
from tasks.settings.load import load_project
from tasks.settings.project import Project
from tests.conftest import PROJECT
from tests.service.object_server import BUCKET, ObjectServer, running_object_server

_prefixes = (f"tests/{number}" for number in itertools.count())


@pytest.fixture(scope="session")
def object_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ObjectServer]:
    with running_object_server(tmp_path_factory.mktemp("object-server")) as server:
        server.make_bucket(BUCKET)
        yield server


@pytest.fixture
def server(object_server: ObjectServer, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> ObjectServer:
    object_server.gate.reset()
    for name, value in object_server.environment().items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("AEROCAL_S3_PATIENCE", "20")
    monkeypatch.setenv("AEROCAL_WORKSPACES", str(tmp_path / "workspaces"))
    return object_server


@pytest.fixture
def address() -> ObjectAddress:
    return ObjectAddress(BUCKET, next(_prefixes))


@pytest.fixture
def project(tmp_path: Path) -> Project:
    folder = tmp_path / "delivery"
    folder.mkdir()
    (folder / "image_points.csv").write_text("image,point,x,y\n1,a,10,10\n2,a,20,20\n")
    (folder / "exposures.csv").write_text(
        "image,camera,strip,x,y,z,omega,phi,kappa\n1,C,s,0,0,100,0,0,0\n2,C,s,10,0,100,0,0,0\n"
    )
    (folder / "project.toml").write_text(PROJECT)
    return load_project(folder / "project.toml")
