"""The door in front of Prefect's server: an ASGI application around another one."""

from __future__ import annotations

from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

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
        headers = tuple(
            (name.decode("latin-1").lower(), value.decode("latin-1")) for name, value in scope["headers"]
        )
        asked = Asked(scope.get("method", "GET"), scope["path"], headers)
        known = self.door.knows(asked)
        if known and asked.one("host") == _IN_PROCESS and not asked.all("origin"):
            await self.app(scope, receive, send)
        elif scope["type"] == "websocket":
            if self.door.refusal(asked) is None:
                await self.app(scope, receive, send)
            else:
                await send({"type": "websocket.close", "code": 1008})
        else:
            answer = await self._answer(asked, Request(scope, receive), known=known)
            if answer is None:
                await self.app(_with_password(scope, self.door.password) if known else scope, receive, send)
            else:
                await answer(scope, receive, send)

    async def _answer(self, asked: Asked, request: Request, *, known: bool) -> Response | None:
        """The answer of the door; None: the request may pass."""
        refusal = self.door.refusal(asked)
        if refusal is not None:
            return _said(refusal.status, refusal.sentence)
        if asked.path == ENTRANCE:
            if asked.method != "POST":
                return Response(ENTRANCE_PAGE, 200, ENTRANCE_HEADERS)
            if not self.door.opens(asked, await _content(request)):
                return _said(403, "This key is not valid.")
            return Response(None, 204, {"Set-Cookie": self.door.cookie(asked), "Cache-Control": "no-store"})
        if asked.path in _OPEN and asked.method in ("GET", "HEAD"):
            return None
        if not known:
            page = Response(ENTRANCE_PAGE, 401, ENTRANCE_HEADERS)
            return page if asked.is_for_a_page else _said(401, "Unauthorized")
        if asked.path.removeprefix("/api").rstrip("/") in _FOREIGN or "\0" in asked.path:
            return _said(404, "Page not found.")
        return None


def _with_password(scope: Any, password: str) -> Any:
    """The request of a known browser, as Prefect wants it."""
    headers = [(name, value) for name, value in scope["headers"] if name.lower() != b"authorization"]
    return {**scope, "headers": [*headers, (b"authorization", basic(password).encode())]}


async def _content(request: Request) -> bytes:
    content = b""
    async for piece in request.stream():
        content += piece
        if len(content) > _MOST_BYTES:
            return b""
    return content


def _said(status: int, sentence: str) -> Response:
    # Prefect's clients read this key.
    return JSONResponse({"exception_message": sentence}, status, {"Cache-Control": "no-store"})
