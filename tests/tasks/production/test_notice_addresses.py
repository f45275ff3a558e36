"""Addresses are secrets: understood or refused, and never shown."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.production.notice import wanted_kinds
from tasks.production.notice_addresses import configured_addresses, send_test_message
from tests.tasks.production.receivers import web_receiver

SECRET = "hunter2"


@pytest.mark.parametrize("url", [f"jsno://user:{SECRET}@host", SECRET, f"json://:{SECRET}:x@@/", "json://"])
def test_a_malformed_address_is_refused_and_not_repeated(
    url: str, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.DEBUG), pytest.raises(InputError) as refused:
        configured_addresses({"AEROCAL_NOTIFY": f"json://127.0.0.1 {url}"})
    assert "Address 2" in str(refused.value)
    shown = (str(refused.value), repr(refused.value), caplog.text, *capfd.readouterr())
    assert not any(SECRET in text for text in shown)


def test_addresses_come_from_the_environment_and_a_private_file(tmp_path: Path) -> None:
    file = tmp_path / "addresses"
    file.write_text(f"json://127.0.0.1/{SECRET}\nmailto://{SECRET}:x@example.org\n")
    file.chmod(0o600)
    variables = {"AEROCAL_NOTIFY": "json://127.0.0.1/a\njson://127.0.0.1/a", "AEROCAL_NOTIFY_FILE": str(file)}
    found = configured_addresses(variables)
    assert [str(one) for one in found] == ["address 1 (json)", "address 3 (json)", "address 4 (mailto)"]
    assert SECRET not in repr(found)
    assert len({one.key for one in found}) == 3
    assert [one.key for one in configured_addresses(variables)] == [one.key for one in found]
    file.chmod(0o644)
    with pytest.raises(InputError, match="chmod 600"):
        configured_addresses(variables)
    with pytest.raises(InputError, match="cannot be read"):
        configured_addresses({"AEROCAL_NOTIFY_FILE": str(tmp_path / "none")})


def test_a_test_message_says_what_became_of_it_at_every_address() -> None:
    with web_receiver() as good, web_receiver(answers=[403]) as bad:
        sent = send_test_message({"AEROCAL_NOTIFY": f"{good.address} {bad.address}"})
        assert [one["title"] for one in good.accepted] == ["Test: test (notify)"]
    assert [(outcome.accepted, outcome.said) for outcome in sent.values()] == [
        (True, "accepted"),
        (False, "refused with status 403"),
    ]
    with pytest.raises(InputError, match="no address"):
        send_test_message({})


def test_kinds_that_do_not_exist_name_the_nearest() -> None:
    assert wanted_kinds("gate, success") == {"gate", "success"}
    with pytest.raises(InputError, match="failure"):
        wanted_kinds("gate,failrue")
    with pytest.raises(InputError, match="names nothing"):
        wanted_kinds(" , ")
