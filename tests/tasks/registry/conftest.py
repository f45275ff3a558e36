"""Every test of a registry on SQLite; with `make service-test` on a PostgreSQL server as well."""

from __future__ import annotations

from pathlib import Path

import pytest

from tasks.database.address import DatabaseAddress
from tasks.registry.registry import Registry
from tasks.settings.registry import registry_address


@pytest.fixture(params=["sqlite", pytest.param("postgresql", marks=pytest.mark.service)])
def address(request: pytest.FixtureRequest, tmp_path: Path) -> DatabaseAddress:
    """Where a new registry can be made."""
    if request.param == "sqlite":
        return registry_address(str(tmp_path / "registry.sqlite"))
    return registry_address(request.getfixturevalue("postgresql").emptied())


@pytest.fixture
def registry(address: DatabaseAddress) -> Registry:
    """A registry that does not exist yet."""
    return Registry.at(address, wait_s=20.0)
