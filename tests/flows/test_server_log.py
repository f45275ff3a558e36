"""Lines of the server have a date, or are JSON."""

from __future__ import annotations

import json
import os
import re
from datetime import UTC, datetime, timedelta, timezone

import pytest

from flows.command.server_log import as_json, dated, said_as

NOW = datetime(2026, 11, 23, 14, 5, 6, 789_000, tzinfo=timezone(timedelta(hours=1)))


def test_every_line_has_date_time_and_zone() -> None:
    assert dated("The server is up.", NOW) == "2026-11-23 14:05:06+0100 The server is up."
    assert dated("one\ntwo", NOW).splitlines() == [
        "2026-11-23 14:05:06+0100 one",
        "2026-11-23 14:05:06+0100 two",
    ]


def test_json_is_one_line_whatever_is_said() -> None:
    said = as_json('a "quoted"\nσ0', NOW.astimezone(UTC))
    assert "\n" not in said
    assert json.loads(said) == {
        "time": "2026-11-23T13:05:06.789+00:00",
        "source": "aerocal",
        "message": 'a "quoted"\nσ0',
    }


def test_what_is_no_screen_gets_dates_and_programs_get_json(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("PREFECT_LOGGING_HANDLERS_CONSOLE_FORMATTER", raising=False)
    said_as("text")("It runs.")
    assert "PREFECT_LOGGING_HANDLERS_CONSOLE_FORMATTER" not in os.environ
    monkeypatch.setenv("PREFECT_LOGGING_HANDLERS_CONSOLE_FORMATTER", "json")
    said_as("json")("It ends.")
    first, second = capsys.readouterr().out.splitlines()
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d[+-]\d{4} It runs\.", first)
    assert json.loads(second)["message"] == "It ends."
