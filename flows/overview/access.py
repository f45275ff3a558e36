"""Who may see the page, and what a browser may do with it."""

from __future__ import annotations

import gzip
import hmac
from collections.abc import Sequence

from flask import Flask, Request, Response, request

#: Names under which a browser of this machine reaches a server that listens on loopback only.
_LOOPBACK_NAMES = ["127.0.0.1", "localhost", "[::1]", "::1"]
#: Answers above this size are compressed, bytes.
_COMPRESSED_FROM = 10_000


def page_policy(script_hashes: Sequence[str]) -> str:
    """The Content-Security-Policy of the page: its own files and nothing else.

    Parameters
    ----------
    script_hashes : of the scripts inside the page.
    """
    scripts = " ".join(("'self'", *script_hashes))
    return "; ".join(
        (
            "default-src 'none'",
            f"script-src {scripts}",
            # Grid and plots place their parts with inline styles.
            "style-src 'self' 'unsafe-inline'",
            "img-src 'self' data: blob:",
            "font-src 'self' data:",
            "connect-src 'self'",
            *_CLOSED,
        )
    )


#: What no page here may do.
_CLOSED = ("base-uri 'none'", "form-action 'none'", "frame-ancestors 'none'", "object-src 'none'")
#: Documents of runs draw with inline styles and pictures of their own, and run no script.
DOCUMENT_POLICY = "; ".join(
    (
        "default-src 'none'",
        "style-src 'unsafe-inline'",
        "img-src data:",
        "font-src data:",
        *_CLOSED,
        "sandbox allow-popups",
    )
)


def guard(server: Flask, words: str | None, policy: str, *, loopback: bool) -> None:
    """Ask for the password, and send the headers that protect a browser.

    Parameters
    ----------
    words : ``user:password``; None: nobody is asked.
    policy : Content-Security-Policy of whatever sets none itself.
    loopback : whether it listens for this machine only; then pages of other names that lead here (a name
        server may say so) are refused.
    """
    if loopback:
        server.config["TRUSTED_HOSTS"] = _LOOPBACK_NAMES

    @server.before_request
    def _ask() -> Response | None:
        if words is None or _knows(request, words):
            return None
        return Response(
            "A user and a password are needed: those of the server.",
            401,
            {"WWW-Authenticate": 'Basic realm="aerocal", charset="UTF-8"'},
            mimetype="text/plain",
        )

    @server.after_request
    def _protect(response: Response) -> Response:
        response.headers.setdefault("Content-Security-Policy", policy)
        response.headers["X-Content-Type-Options"] = "nosniff"
        response.headers["Referrer-Policy"] = "no-referrer"
        response.headers["X-Frame-Options"] = "DENY"
        response.headers["Cross-Origin-Opener-Policy"] = "same-origin"
        response.headers.setdefault("Cross-Origin-Resource-Policy", "same-origin")
        if response.mimetype in ("application/json", "text/html"):
            response.headers.setdefault("Cache-Control", "no-store")
        return _compressed(response)


def _knows(asked: Request, words: str) -> bool:
    """Whether a request brings the password; takes as long for a nearly right one as for any other."""
    given = asked.authorization
    if given is None or given.type != "basic":
        return False
    brought = f"{given.username or ''}:{given.password or ''}"
    return hmac.compare_digest(brought.encode(), words.encode())


def _compressed(response: Response) -> Response:
    wanted = request.accept_encodings.quality("gzip") > 0
    if not wanted or response.direct_passthrough or response.mimetype != "application/json":
        return response
    content = response.get_data()
    if len(content) < _COMPRESSED_FROM:
        return response
    response.set_data(gzip.compress(content, 5))
    response.headers["Content-Encoding"] = "gzip"
    response.headers["Vary"] = "Accept-Encoding"
    return response
