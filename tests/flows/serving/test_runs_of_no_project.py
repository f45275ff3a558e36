"""Runs of no project: what the search of inbox and folders tells when it cannot be done."""

from __future__ import annotations

from pathlib import Path

import pytest

from flows.server.inbox import INBOX_VARIABLE
from flows.server.roots import ROOTS_VARIABLE, as_variable, roots_of
from tasks.production.outbox import Outbox
from tasks.production.records import Records
from tasks.production.run_record import RECORDS_VARIABLE

pytestmark = pytest.mark.prefect


@pytest.mark.parametrize(("flow", "about"), [("inbox", "inbox"), ("clean_up", "output folders")])
def test_a_nightly_search_of_folders_that_are_gone_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, flow: str, about: str
) -> None:
    from flows.serving import deployed

    (tmp_path / "inbox").mkdir()
    for name, value in (
        (ROOTS_VARIABLE, as_variable(roots_of([tmp_path / "inbox"]))),
        (INBOX_VARIABLE, str(tmp_path / "inbox")),
        (RECORDS_VARIABLE, str(tmp_path / "records.sqlite")),
        ("PREFECT_API_URL", "http://127.0.0.1:9/api"),
    ):
        monkeypatch.setenv(name, value)
    (tmp_path / "inbox").rmdir()
    state = getattr(deployed, flow).fn()
    assert (state.type.value, state.name) == ("FAILED", "InputError")
    (notice,) = Outbox(Records.at(str(tmp_path / "records.sqlite"))).waiting()
    assert (notice.kind, notice.project, notice.state) == ("failure", about, "InputError")
    assert str(tmp_path / "inbox") in notice.message
