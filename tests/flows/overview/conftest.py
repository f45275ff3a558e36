"""A production page over records of a test, without any server."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from zoneinfo import ZoneInfo

import pytest
from flask.testing import FlaskClient

from flows.overview.application import application
from flows.overview.sources import Sources
from flows.server.api import Api
from flows.server.door import basic, door_of
from flows.server.roots import Roots
from tasks.production.records import Records

DASHBOARD = "http://127.0.0.1:4200"
DOOR = door_of("ann:secret", ["office"], [None])


@pytest.fixture
def records(tmp_path: Path) -> Records:
    return Records.at(str(tmp_path / "state" / "records.sqlite"))


@pytest.fixture
def sources(records: Records, tmp_path: Path) -> Sources:
    """Sources whose server does not answer: nobody listens on port 9 of this machine."""
    (tmp_path / "root").mkdir()
    roots = Roots(((tmp_path / "root").resolve(),))
    api = Api("http://127.0.0.1:9/api")
    return Sources(records, DASHBOARD, roots, api, DOOR, None, lambda: None, ZoneInfo("UTC"))


@pytest.fixture
def browse() -> Callable[..., FlaskClient]:
    """What asks a page over sources, with the password or another one; None: without any."""

    def made(sources: Sources, password: str | None = DOOR.password) -> FlaskClient:
        client = application(sources).server.test_client()
        if password is not None:
            client.environ_base["HTTP_AUTHORIZATION"] = basic(password)
        return client

    return made
