"""The program of the server: Prefect's own, made to work with the SQLAlchemy that is installed.

Since SQLAlchemy 2.1 a bulk INSERT refuses values of hybrid properties that do not say what becomes of them;
2.0 left them alone. Prefect 3.8 hands such a value (the state of a flow run, stored by other means) to the
INSERT of every scheduled run, so no schedule would ever begin anything. Here those properties are told to
leave the values alone again, in the server's process only. On SQLite, transactions wait for each other.

The dashboard's pages ask a provider of usage statistics for settings even where statistics are off. A
Content-Security-Policy lets them speak to their own server and nobody else. In front of all of it stands our
door (`flows.server.door`, an ASGI application around Prefect's); whoever has passed it is not asked by the
pages again.
"""

from __future__ import annotations

import os
from collections.abc import MutableMapping
from functools import wraps
from typing import Any, cast
from urllib.parse import urlsplit

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from flows.server.door import (
    DOOR_VARIABLE,
    ENTRANCE,
    ENTRANCE_HEADERS,
    ENTRANCE_PAGE,
    Asked,
    Door,
    basic,
    door_from,
)
from flows.server.server_process import SERVER_PASSWORD

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


def main() -> None:
    """Serve Prefect's application where its settings say, until asked to end.

    ``prefect server start`` does the same, after a greeting without dates and with logs of another form; its
    command line takes as long to load as a tenth of the server.
    """
    leave_hybrid_values_alone()
    begin_writing_at_once()
    door = door_from(os.environ.get(SERVER_PASSWORD), os.environ.get(DOOR_VARIABLE))
    leave_the_login_to_the_door()
    keep_pages_to_this_server(os.environ.get("PREFECT_SERVER_UI_API_URL", ""), door)

    import uvicorn
    from prefect.server.api import server
    from prefect.settings import get_current_settings

    settings = get_current_settings().server.api
    uvicorn.run(
        server.create_app(final=True),
        host=settings.host,
        port=settings.port,
        timeout_keep_alive=settings.keepalive_timeout,
        ws_ping_interval=settings.websocket_ping_interval,
        ws_ping_timeout=settings.websocket_ping_timeout,
        # Prefect has set up the logs of both, with dates.
        log_config=None,
    )


def leave_hybrid_values_alone() -> None:
    """Let bulk INSERTs of Prefect's tables pass over hybrid properties, as SQLAlchemy 2.0 did."""
    from prefect.server.database import orm_models
    from sqlalchemy.ext.hybrid import hybrid_property

    for table in (orm_models.FlowRun, orm_models.TaskRun, orm_models.FlowRunState, orm_models.TaskRunState):
        for kind in table.__mro__:
            for member in vars(kind).values():
                if isinstance(member, hybrid_property) and getattr(member, "bulk_dml_setter", None) is None:
                    member.bulk_dml_setter = cast(Any, _leave_alone)


def _leave_alone(_table: type, _values: MutableMapping[str, object], _value: object) -> None:
    """Leave the value of a property in a bulk INSERT unchanged."""


def begin_writing_at_once() -> None:
    """Make a transaction on SQLite that may write wait for its turn before it reads.

    Prefect begins them reading. One that then writes while another has done so is refused at once ("database
    is locked"), however long SQLite was told to wait; seen several times a run.
    """
    from prefect.server.database import configurations

    kind, mode = configurations.AioSqliteConfiguration, configurations.SQLITE_BEGIN_MODE
    begin_transaction, begin = kind.begin_transaction, kind.begin_sqlite_stmt

    def begin_writing(self: Any, session: Any, *_: Any, **_for_update: Any) -> Any:
        return begin_transaction(self, session, with_for_update=True)

    def begin_once(self: Any, connection: Any) -> None:
        begin(self, connection)
        if mode.get() is not None:
            # What is asked within, on another connection, reads; it would wait for the one around it.
            mode.set("DEFERRED")

    kind.begin_transaction = begin_writing  # type: ignore[method-assign]
    kind.begin_sqlite_stmt = begin_once  # type: ignore[assignment,method-assign]


def leave_the_login_to_the_door() -> None:
    """Turn off the password prompt of the dashboard's pages: whoever sees them has been admitted."""
    from prefect.server.api import server
    from prefect.server.schemas.ui import UISettings
    from pydantic import field_validator

    class Settings(UISettings):
        @field_validator("auth", mode="before")
        @classmethod
        def _nobody(cls, _value: object) -> None:
            return None

    vars(server)["UISettings"] = Settings


def keep_pages_to_this_server(api: str, door: Door) -> None:
    """Have every page of the dashboard speak to this server only, and nobody else to it.

    Parameters
    ----------
    api : address of the API as browsers know it; only its path, or "", if it is that of the page.
    door : who is let in.
    """
    from prefect.server.api import server
    from starlette.middleware import Middleware

    create_app = server.create_app
    policy = connections_policy(api)

    @wraps(create_app)
    def create_quiet_app(*args: Any, **kwargs: Any) -> Any:
        app = create_app(*args, **kwargs)
        app.user_middleware[:0] = [Middleware(Guard, door=door), Middleware(_PagePolicy, policy=policy)]
        return app

    server.create_app = create_quiet_app


def connections_policy(api: str) -> str:
    """What the pages may connect to, as a Content-Security-Policy."""
    parts = urlsplit(api)
    places = ["'self'"]
    if parts.netloc:
        socket = {"http": "ws", "https": "wss"}[parts.scheme]
        places += [f"{parts.scheme}://{parts.netloc}", f"{socket}://{parts.netloc}"]
    return f"connect-src {' '.join(places)}; object-src 'none'; base-uri 'self'; frame-ancestors 'self'"


class _PagePolicy:
    """Adds the policy to every HTML answer."""

    def __init__(self, app: Any, policy: str) -> None:
        self.app = app
        self.policy = policy.encode()

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        async def send_with_policy(message: Any) -> None:
            if message["type"] == "http.response.start":
                headers = message.setdefault("headers", [])
                if any(name == b"content-type" and value.startswith(b"text/html") for name, value in headers):
                    headers.append((b"content-security-policy", self.policy))
            await send(message)

        await self.app(scope, receive, send_with_policy if scope["type"] == "http" else send)


if __name__ == "__main__":
    main()
