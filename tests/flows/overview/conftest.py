"""A production page over records of a test, without any server."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from flask.testing import FlaskClient

from flows.overview.application import application
from flows.overview.sources import Sources
from flows.serving.api import Api
from flows.serving.roots import Roots
from tasks.production.records import Records

DASHBOARD = "http://127.0.0.1:4200"


@pytest.fixture
def records(tmp_path: Path) -> Records:
    return Records.at(str(tmp_path / "state" / "records.sqlite"))


@pytest.fixture
def sources(records: Records, tmp_path: Path) -> Sources:
    """Sources whose server does not answer: nobody listens on port 9 of this machine."""
    (tmp_path / "root").mkdir()
    roots = Roots(((tmp_path / "root").resolve(),))
    return Sources(records, DASHBOARD, roots, Api("http://127.0.0.1:9/api"), None, None, tmp_path / "state")


@pytest.fixture
def browse() -> Callable[..., FlaskClient]:
    """What asks a page over sources, listening at a host."""

    def made(sources: Sources, host: str = "127.0.0.1") -> FlaskClient:
        return application(sources, host).server.test_client()

    return made
