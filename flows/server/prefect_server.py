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
from typing import Any, cast

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from flows.server.door import (
    DOOR_VARIABLE,
    ENTRANCE,
    LONGEST_KEY,
    Answer,
    Asked,
    Door,
    basic,
    door_from,
)
from flows.server.server_process import SERVER_PASSWORD

#: What says nothing but that a server is there.
_OPEN = ("/api/health", "/api/ready")
#: Pages of FastAPI that load their scripts from hosts of others.
_FOREIGN = ("/docs", "/redoc", "/docs/oauth2-redirect")


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
        if scope["type"] == "http":
            content = await _content(Request(scope, receive)) if asked.path == ENTRANCE else b""
            answer = self.door.answer(asked, content)
            if answer is None and _is_foreign(asked.path):
                answer = Answer(404, "Page not found.")
            if answer is None:
                await self.app(_with_password(scope, self.door.password), receive, send)
            elif answer.status == 401 and asked.path in _OPEN and asked.method in ("GET", "HEAD"):
                await self.app(scope, receive, send)
            else:
                await _response(answer)(scope, receive, send)
        elif self.door.refusal(asked) is None:
            await self.app(scope, receive, send)
        else:
            await send({"type": "websocket.close", "code": 1008})


def _is_foreign(path: str) -> bool:
    return path.removeprefix("/api").rstrip("/") in _FOREIGN or "\0" in path


def _with_password(scope: Any, password: str) -> Any:
    """The request of a known browser, as Prefect wants it."""
    headers = [(name, value) for name, value in scope["headers"] if name.lower() != b"authorization"]
    return {**scope, "headers": [*headers, (b"authorization", basic(password).encode())]}


async def _content(request: Request) -> bytes:
    content = b""
    async for piece in request.stream():
        content += piece
        if len(content) > LONGEST_KEY:
            return b""
    return content


def _response(answer: Answer) -> Response:
    if answer.headers:
        return Response(answer.text, answer.status, answer.headers)
    # Prefect's clients read this key.
    said = {"exception_message": answer.text}
    return JSONResponse(said, answer.status, {"Cache-Control": "no-store"})


def main() -> None:
    """Serve Prefect's application where its settings say, until asked to end.

    ``prefect server start`` does the same, after a greeting without dates and with logs of another form; its
    command line takes as long to load as a tenth of the server.
    """
    leave_hybrid_values_alone()
    begin_writing_at_once()
    door = door_from(os.environ.get(SERVER_PASSWORD), os.environ.get(DOOR_VARIABLE))
    leave_the_login_to_the_door()

    import uvicorn
    from prefect.server.api import server
    from prefect.settings import get_current_settings

    settings = get_current_settings().server.api
    pages = _PagePolicy(server.create_app(final=True))
    # Around the application: what the server asks itself (automations) comes through no door.
    uvicorn.run(
        Guard(pages, door),
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


_POLICY = b"connect-src 'self'; object-src 'none'; base-uri 'self'; frame-ancestors 'self'"


class _PagePolicy:
    """Has every page of the dashboard speak to this server only: adds the policy to every HTML answer."""

    def __init__(self, app: Any) -> None:
        self.app = app

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        async def send_with_policy(message: Any) -> None:
            if message["type"] == "http.response.start":
                headers = message.setdefault("headers", [])
                if any(name == b"content-type" and value.startswith(b"text/html") for name, value in headers):
                    headers.append((b"content-security-policy", _POLICY))
            await send(message)

        await self.app(scope, receive, send_with_policy if scope["type"] == "http" else send)


if __name__ == "__main__":
    main()
