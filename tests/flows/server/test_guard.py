"""The door in front of Prefect's server, over an application that says who has come in."""

from __future__ import annotations

import asyncio
from typing import Any

import httpx
import pytest

from flows.server.door import basic, door_of
from flows.server.prefect_server import Guard

DOOR = door_of("ann:secret", [], [])
KNOWN = {"Authorization": basic(DOOR.password)}


async def _inside(scope: Any, _receive: Any, send: Any) -> None:
    """Says which password it was brought."""
    said = dict(scope["headers"]).get(b"authorization", b"none")
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": said})


def calls(*requests: httpx.Request) -> list[httpx.Response]:
    """The answers to requests, one after the other, by one browser."""

    async def ask() -> list[httpx.Response]:
        transport = httpx.ASGITransport(app=Guard(_inside, DOOR))
        async with httpx.AsyncClient(transport=transport) as client:
            return [await client.send(request) for request in requests]

    return asyncio.run(ask())


def request(method: str, path: str, host: str = "127.0.0.1:4200", **more: Any) -> httpx.Request:
    return httpx.Request(method, f"http://{host}{path}", **more)


def test_the_link_lets_a_browser_in_and_what_is_inside_gets_the_words() -> None:
    page = {"Accept": "text/html"}
    (stranger, program, door) = calls(
        request("GET", "/v2/", headers=page), request("GET", "/v2/"), request("GET", "/enter", headers=page)
    )
    assert (stranger.status_code, program.status_code, door.status_code) == (401, 401, 200)
    assert "not known yet" in stranger.text
    assert program.json() == {"exception_message": "Unauthorized"}
    wrong, right = calls(
        request("POST", "/enter", json={"key": "x"}), request("POST", "/enter", json={"key": DOOR.key})
    )
    assert (wrong.status_code, right.status_code) == (403, 204)
    assert "set-cookie" not in wrong.headers
    cookie = right.headers["set-cookie"].partition(";")[0]
    (inside,) = calls(request("GET", "/api/x", headers={"Cookie": cookie, "Authorization": "Basic wrong"}))
    assert inside.text == basic(DOOR.password)


def test_what_says_only_that_a_server_is_there_is_open_and_nothing_beside_it() -> None:
    paths = ("/api/health", "/api/ready", "/api/health/", "/health", "/api/health/x", "/API/health")
    answers = calls(*(request("GET", path) for path in paths), request("POST", "/api/health"))
    assert [answer.status_code for answer in answers] == [200, 200, 401, 401, 401, 401, 401]


@pytest.mark.parametrize(
    "path", ["/docs", "/api/docs", "/redoc", "/api/redoc/", "/docs/oauth2-redirect", "/a%00"]
)
def test_pages_that_load_from_others_are_not_there(path: str) -> None:
    stranger, known = calls(request("GET", path), request("GET", path, headers=KNOWN))
    assert (stranger.status_code, known.status_code) == (401, 404)


def test_nobody_gets_in_under_the_name_that_the_server_calls_itself_by() -> None:
    """Automations do so within its process, where there is no door."""
    answers = calls(
        request("POST", "/api/x", "prefect-in-memory", json={}, headers=KNOWN),
        request("POST", "/api/x", "prefect-in-memory", json={}),
        request("POST", "/api/x", "prefect-in-memory:4200", json={}, headers=KNOWN),
    )
    assert [one.status_code for one in answers] == [400, 400, 400]


@pytest.mark.parametrize("size", [5_000, 100_000])
def test_a_long_key_is_not_read_to_its_end(size: int) -> None:
    (answer,) = calls(request("POST", "/enter", json={"key": "x" * size}))
    assert answer.status_code == 403
