"""Who may see the production page, what a browser may do with it, and the documents of runs.

Documents are served at ``/results/RUN/NAME`` and checked before they are shown; there is never a listing.
"""

from __future__ import annotations

import gzip
from collections.abc import Sequence

from dash.exceptions import DependencyException
from flask import Flask, Request, Response, request
from markupsafe import escape

from flows.overview.sources import Sources
from flows.server.door import ENTRANCE, LONGEST_KEY, Asked, Door
from tasks.errors import AerocalError
from tasks.production.documents import ChangedDocumentError, Document, NoDocumentError, read_document

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


def guard(server: Flask, door: Door, policy: str) -> None:
    """Check access, and send the headers that protect a browser.

    Parameters
    ----------
    policy : Content-Security-Policy of answers that do not set one.
    """

    @server.before_request
    def _ask() -> Response | None:
        asked = _asked(request)
        is_key = asked.path == ENTRANCE and (request.content_length or 0) <= LONGEST_KEY
        answer = door.answer(asked, request.get_data() if is_key else b"")
        if answer is None:
            return None
        if answer.headers:
            return Response(answer.text, answer.status, answer.headers)
        return Response(answer.text, answer.status, mimetype="text/plain")

    @server.errorhandler(DependencyException)
    def _nothing(_error: DependencyException) -> Response:
        return Response("Page not found.", 404, mimetype="text/plain")

    @server.after_request
    def _protect(response: Response) -> Response:
        response.headers.setdefault("Content-Security-Policy", policy)
        response.headers["X-Content-Type-Options"] = "nosniff"
        response.headers["Referrer-Policy"] = "no-referrer"
        response.headers["X-Frame-Options"] = "DENY"
        response.headers["Cross-Origin-Opener-Policy"] = "same-origin"
        response.headers["Cross-Origin-Resource-Policy"] = "same-origin"
        if response.mimetype in ("application/json", "text/html"):
            response.headers.setdefault("Cache-Control", "no-store")
        return _compressed(response)


def _asked(asked: Request) -> Asked:
    headers = tuple((name.lower(), value) for name, value in asked.headers.items())
    return Asked(asked.method, asked.path, headers)


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


_REFUSAL = """<!DOCTYPE html><html lang="en"><meta charset="utf-8"><title>Not shown</title>
<style>body{{font:16px/1.5 system-ui,sans-serif;max-width:44rem;margin:4rem auto;padding:0 1rem}}</style>
<h1>Not shown</h1><p>{sentence}</p></html>"""


def add_results(server: Flask, sources: Sources) -> None:
    """Let a server hand out documents."""

    @server.get("/results/<run>/<name>")
    def _results(run: str, name: str) -> Response:
        try:
            document = read_document(sources.records, run, name, sources.roots.folders)
        except ChangedDocumentError as error:
            return _refused_document(error, 410)
        except NoDocumentError as error:
            return _refused_document(error, 404)
        except AerocalError as error:
            return _refused_document(error, 503)
        return _shown(document)

    # Everything else below would be answered with the page.
    for path in ("/results", "/results/", "/results/<path:_rest>"):
        server.add_url_rule(path, view_func=_no_listing)


def _no_listing(_rest: str = "") -> Response:
    return _refused_document(NoDocumentError("Page not found.", "Use the links of the production page."), 404)


def _shown(document: Document) -> Response:
    response = Response(document.content, mimetype=document.media_type)
    if document.media_type == "text/html":
        response.headers["Content-Security-Policy"] = DOCUMENT_POLICY
    else:
        # The viewer of a PDF needs its own scripts; the file brings none into our pages.
        response.headers["Content-Security-Policy"] = (
            "default-src 'none'; style-src 'unsafe-inline'; object-src 'self'"
        )
        response.headers["Content-Disposition"] = f'inline; filename="{document.name}"'
    response.headers["Cache-Control"] = "no-store"
    return response


def _refused_document(error: AerocalError, status: int) -> Response:
    response = Response(_REFUSAL.format(sentence=escape(str(error))), status, mimetype="text/html")
    response.headers["Content-Security-Policy"] = DOCUMENT_POLICY
    return response
