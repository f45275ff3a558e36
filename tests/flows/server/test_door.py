"""Who is let in at a port: which names, origins, kinds of content, password and cookies."""

from __future__ import annotations

import json
from collections.abc import Mapping

import pytest

from flows.server.door import Asked, Door, basic, door_from, door_of

DOOR = door_of("ann:secret", ["Office", "127.3.2.1"], ["https://aerocal.example.org/", None])


def asked(method: str = "GET", path: str = "/api/flow_runs/filter", **headers: str) -> Asked:
    given = {"host": "127.0.0.1:4200", **{name.replace("_", "-"): value for name, value in headers.items()}}
    return Asked(method, path, tuple(given.items()))


def status(one: Asked, door: Door = DOOR) -> int | None:
    refusal = door.refusal(one)
    return None if refusal is None else refusal.status


@pytest.mark.parametrize(
    "host",
    ["127.0.0.1:4200", "127.0.0.1", "[::1]:4200", "LOCALHOST:4200", "office:4200", "office.", "10.0.0.5:4200",
     "aerocal.example.org"],
)  # fmt: skip
def test_the_names_of_this_machine_and_addresses_are_answered(host: str) -> None:
    assert status(asked(host=host)) is None


@pytest.mark.parametrize(
    "host",
    ["evil.example:4200", "localhost.evil.example", "127.0.0.1.evil.example", "", "office@evil.example",
     "office:x", "office/evil", "[evil]:4200", "office, evil.example", "office evil.example"],
)  # fmt: skip
def test_other_names_that_lead_here_are_not(host: str) -> None:
    assert status(asked(host=host)) == 400


def test_one_host_is_asked_for_and_not_two() -> None:
    assert status(Asked("GET", "/", ())) == 400
    assert status(Asked("GET", "/", (("host", "localhost"), ("host", "localhost")))) == 400


@pytest.mark.parametrize("origin", ["http://127.0.0.1:4200", "https://aerocal.example.org"])
def test_our_pages_may_ask(origin: str) -> None:
    assert status(asked(origin=origin)) is None


@pytest.mark.parametrize(
    "origin",
    ["null", "http://evil.example", "http://127.0.0.1:4201", "http://127.0.0.1", "http://127.0.0.1:4200.evil.example",
     "http://aerocal.example.org", "file://", ""],
)  # fmt: skip
def test_pages_of_other_origins_may_not_even_with_the_words(origin: str) -> None:
    assert status(asked(origin=origin, authorization=basic(DOOR.password))) == 403


@pytest.mark.parametrize(
    ("kind", "expected"),
    [("application/json", None), ("Application/JSON; charset=utf-8", None), ("text/plain", 415), ("", 415),
     ("application/x-www-form-urlencoded", 415), ("text/plain;application/json", 415)],
)  # fmt: skip
def test_only_json_is_taken(kind: str, expected: int | None) -> None:
    for method in ("POST", "PUT", "PATCH", "DELETE"):
        assert status(asked(method, content_type=kind, content_length="2")) == expected
        assert status(asked(method, content_type=kind, transfer_encoding="chunked")) == expected
    assert status(asked("POST")) is None


def cookie_of(door: Door, **headers: str) -> str:
    return door.cookie(asked("POST", "/enter", **headers)).partition(";")[0]


def test_password_and_cookie_are_known_and_nothing_else_is() -> None:
    assert DOOR.knows(asked(authorization=basic("ann:secret")))
    assert DOOR.knows(asked(cookie=f"other=1; {cookie_of(DOOR)}"))
    name, _, value = cookie_of(DOOR).partition("=")
    other = door_of("ann:secrets", [], [])
    wrong: list[Mapping[str, str]] = [
        {},
        *(
            {"authorization": text}
            for text in ("Basic", "Basic x", "Bearer ann:secret", "ann:secret", "Basic é")
        ),
        *(
            {"authorization": basic(password)}
            for password in ("", "ann:", "ann:secret ", "ann:secretx", DOOR.key, value)
        ),
        *(
            {"cookie": text}
            for text in (f"{name}=", f"{name}={DOOR.key}", f"{name}={value}x", f"x={value}", "é")
        ),
        {"cookie": cookie_of(other)},
    ]
    for headers in wrong:
        assert not DOOR.knows(asked(**headers)), headers


def test_the_entrance_opens_for_key_and_password_and_gives_a_cookie_no_script_can_read() -> None:
    for key in (DOOR.key, "ann:secret", f" {DOOR.key}\n"):
        assert DOOR.opens(asked("POST"), json.dumps({"key": key}).encode()), key
    known = asked("POST", cookie=cookie_of(DOOR))
    assert DOOR.opens(known, b'{"key": ""}')
    for content in (
        b'{"key": ""}',
        b'{"key": "x"}',
        b'{"key": null}',
        b"[]",
        b"",
        b"\xff",
        b'"key"',
        b"[" * 9_999,
    ):
        assert not DOOR.opens(asked("POST"), content), content
    given = DOOR.cookie(asked("POST"))
    assert "HttpOnly; SameSite=Strict" in given
    assert "Secure" not in given
    assert "; Secure" in DOOR.cookie(asked("POST", origin="https://aerocal.example.org"))
    for shown in (given, DOOR.link):
        assert "secret" not in shown


def test_what_a_process_is_told_is_the_same_door_without_the_words() -> None:
    assert door_from(DOOR.password, DOOR.as_variable()) == DOOR
    assert "secret" not in DOOR.as_variable()
    for password in (None, ""):
        with pytest.raises(ValueError, match="no password"):
            door_from(password, DOOR.as_variable())
