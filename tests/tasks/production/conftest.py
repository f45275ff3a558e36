"""Every test of the records on SQLite; with `make service-test` on a PostgreSQL server as well."""

from __future__ import annotations

from pathlib import Path

import pytest

from tasks.production.records import Records


@pytest.fixture(params=["sqlite", pytest.param("postgresql", marks=pytest.mark.service)])
def records(request: pytest.FixtureRequest, tmp_path: Path) -> Records:
    """Records that do not exist yet."""
    if request.param == "sqlite":
        return Records.at(str(tmp_path / "state" / "records.sqlite"))
    return Records.at(request.getfixturevalue("postgresql").emptied())
