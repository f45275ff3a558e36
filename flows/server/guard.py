"""The door in front of Prefect's server: an ASGI application around another one."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from flows.server.door import ENTRANCE, ENTRANCE_HEADERS, ENTRANCE_PAGE, Asked, Door, basic

#: What says nothing but that a server is there.
_OPEN = ("/api/health", "/api/ready")
#: The host that Prefect's server names when it calls itself (automations), without any port.
_IN_PROCESS = "prefect-in-memory"
#: Pages of FastAPI that load their scripts from hosts of others.
_FOREIGN = ("/docs", "/redoc", "/docs/oauth2-redirect")
#: A key is short.
_MOST_BYTES = 4_096


class Guard:
    """Admits permitted requests; websockets check the password themselves, in their first message.

    Parameters
    ----------
    app : what is behind the door.
    """

    def __init__(self, app: Any, door: Door) -> None:
        self.app, self.door = app, door

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Answer, or pass the request on."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        asked = _asked(scope)
        if asked.one("host") == _IN_PROCESS and not asked.all("origin") and self.door.knows(asked):
            await self.app(scope, receive, send)
            return
        refusal = self.door.refusal(asked)
        if scope["type"] == "websocket":
            if refusal is None:
                await self.app(scope, receive, send)
            else:
                await send({"type": "websocket.close", "code": 1008})
        elif refusal is not None:
            await _say(send, refusal.status, refusal.sentence)
        elif asked.path == ENTRANCE:
            await self._enter(asked, receive, send)
        elif asked.path in _OPEN and asked.method in ("GET", "HEAD"):
            await self.app(scope, receive, send)
        elif not self.door.knows(asked):
            await _unknown(asked, send)
        elif asked.path.removeprefix("/api").rstrip("/") in _FOREIGN or "\0" in asked.path:
            await _say(send, 404, "Page not found.")
        else:
            await self.app(_with_password(scope, self.door.password), receive, send)

    async def _enter(self, asked: Asked, receive: Any, send: Any) -> None:
        if asked.method != "POST":
            await _answer(send, 200, ENTRANCE_PAGE, ENTRANCE_HEADERS)
        elif self.door.opens(asked, await _content(receive)):
            await _answer(send, 204, "", {"Set-Cookie": self.door.cookie(asked), "Cache-Control": "no-store"})
        else:
            await _say(send, 403, "This key is not valid.")


def _asked(scope: Any) -> Asked:
    headers = tuple(
        (name.decode("latin-1").lower(), value.decode("latin-1")) for name, value in scope["headers"]
    )
    return Asked(scope.get("method", "GET"), scope["path"], headers)


def _with_password(scope: Any, password: str) -> Any:
    """The request of a known browser, as Prefect wants it."""
    headers = [(name, value) for name, value in scope["headers"] if name.lower() != b"authorization"]
    return {**scope, "headers": [*headers, (b"authorization", basic(password).encode())]}


async def _content(receive: Any) -> bytes:
    content = b""
    while len(content) <= _MOST_BYTES:
        message = await receive()
        content += bytes(message.get("body", b""))
        if not message.get("more_body"):
            return content
    return b""


async def _unknown(asked: Asked, send: Any) -> None:
    if asked.is_for_a_page:
        await _answer(send, 401, ENTRANCE_PAGE, ENTRANCE_HEADERS)
    else:
        await _say(send, 401, "Unauthorized")


async def _say(send: Any, status: int, sentence: str) -> None:
    # Prefect's clients read this key.
    headers = {"Content-Type": "application/json", "Cache-Control": "no-store"}
    await _answer(send, status, json.dumps({"exception_message": sentence}), headers)


async def _answer(send: Any, status: int, content: str, headers: Mapping[str, str]) -> None:
    coded = [(name.lower().encode(), value.encode("latin-1")) for name, value in headers.items()]
    await send({"type": "http.response.start", "status": status, "headers": coded})
    await send({"type": "http.response.body", "body": content.encode()})
