"""Where golden tests find what is not with the other real data."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def dbat() -> Path:
    """A checkout of DBAT's public repository, with its text files and reports."""
    folder = os.environ.get("AEROCAL_DBAT")
    if not folder:
        pytest.skip("a checkout of DBAT's repository is needed in AEROCAL_DBAT")
    return Path(folder)
