"""What is refused before anything is asked of object storage; the rest is in tests/service."""

from __future__ import annotations

from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.object_storage.address import address_of
from tasks.object_storage.fetch import fetch_results


def test_results_cannot_go_into_a_file(tmp_path: Path) -> None:
    (tmp_path / "report.html").touch()
    with pytest.raises(InputError, match="This is a file, not a folder"):
        fetch_results(address_of("s3://surveys/block"), tmp_path / "report.html")
