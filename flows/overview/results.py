"""The documents of runs, at ``/results/RUN/NAME``: checked before they are shown, never a listing."""

from __future__ import annotations

from flask import Flask, Response
from markupsafe import escape

from flows.overview.access import DOCUMENT_POLICY
from flows.overview.sources import Sources
from tasks.errors import AerocalError
from tasks.production.documents import ChangedDocumentError, Document, NoDocumentError, read_document

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
            return _refused(error, 410)
        except NoDocumentError as error:
            return _refused(error, 404)
        except AerocalError as error:
            return _refused(error, 503)
        return _shown(document)

    # Everything else below would be answered with the page.
    for path in ("/results", "/results/", "/results/<path:_rest>"):
        server.add_url_rule(path, view_func=_no_listing)


def _no_listing(_rest: str = "") -> Response:
    return _refused(NoDocumentError("There is nothing here.", "Follow the links of the overview."), 404)


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


def _refused(error: AerocalError, status: int) -> Response:
    response = Response(_REFUSAL.format(sentence=escape(str(error))), status, mimetype="text/html")
    response.headers["Content-Security-Policy"] = DOCUMENT_POLICY
    return response
