"""Fixtures of the tests against services."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path

import pytest

from tasks.object_storage.address import ObjectAddress
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
