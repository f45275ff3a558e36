"""The documents of a certificate from one content: certificate.json, certificate.html and certificate.pdf.

JSON has everything the certificate prints, for programs. Numbers stand as
``{"value": full value or null, "shown": as printed}``, texts as texts. ``record`` is the whole record, so
that the verification code can be computed from this file alone.

The page is self-contained. The PDF is A4, tagged (PDF/UA-1), with the fonts of typst, and made without
network access. Its template reads the same tree that certificate.json holds. Texts reach it as data, so
nothing in a name can be markup. There is no date in the file and system fonts are left out: the same content
gives the same bytes on every machine with the same version of typst.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, cast

import typst

from tasks.calibration.record import CalibrationRecord
from tasks.document_kit.table import Number
from tasks.document_kit.templates import rendered
from tasks.documents.certificate.content import (
    CertificateContent,
    CorrelationMatrix,
    Fact,
    Facts,
    Figure,
    Listing,
    Sentences,
    SideBySide,
    Signatures,
    Words,
)
from tasks.documents.report.export import drawing_rules, standing_alone
from tasks.documents.report.page import TEMPLATES as REPORT_TEMPLATES
from tasks.files.json_text import JSON, attributes, json_text

FORMAT = "aerocal-certificate"
VERSION = 1
_KINDS = {
    Words: "words",
    Sentences: "sentences",
    Facts: "facts",
    CorrelationMatrix: "matrix",
    Figure: "figure",
    SideBySide: "side_by_side",
    Signatures: "signatures",
}
_ON_THE_PAGE_ONLY = ("drawing", "joint")
#: Package data: part of the digest of every source that reaches this module.
TEMPLATES = Path(__file__).parent / "templates"
#: The drawings in the font of the document; names in them are as small as on the page otherwise.
_FONT = 'text { font-family: "Libertinus Serif"; font-size: 14px; } .label { font-size: 15px; }'


def twin_of(content: CertificateContent, record: CalibrationRecord) -> Mapping[str, JSON]:
    """The certificate as JSON, with its record."""
    return {**document_of(content), "record": record.model_dump(mode="json")}


def document_of(content: CertificateContent) -> Mapping[str, JSON]:
    """What is printed, as JSON."""
    names = ("title", "camera", "project", "subject", "file", "verdict", "sentence", "code", "short_code")
    sections = [_plain(section) for section in content.sections]
    return {"format": FORMAT, "version": VERSION, **attributes(content, *names), "sections": sections}


def _plain(part: Any) -> Any:
    """A part of the content as JSON: its fields by name, and the kind of a block."""
    if isinstance(part, Number):
        return {"value": float(part.value or 0.0) if part.exists else None, "shown": str(part)}
    if isinstance(part, Listing):
        return _listing(part)
    if isinstance(part, tuple):
        return [_plain(one) for one in part]
    if not is_dataclass(part):
        return part
    names = [field.name for field in fields(part) if field.name not in _ON_THE_PAGE_ONLY]
    told = {name: _plain(getattr(part, name)) for name in names}
    told |= {"kind": _KINDS[type(part)]} if type(part) in _KINDS else {}
    return told | ({"shown": part.shown} if isinstance(part, Fact) else {})


def _listing(block: Listing) -> JSON:
    table = block.table
    columns = [{**vars(column), "wide": column.name in block.wide} for column in table.columns]
    rows = [{"key": row.key, "cells": _plain(row.cells)} for row in table.rows]
    return {"kind": "table", **attributes(table, "name", "caption", "note"), "columns": columns, "rows": rows}


def page_of(content: CertificateContent) -> str:
    """The certificate as a page."""
    return rendered("certificate.html.j2", TEMPLATES, REPORT_TEMPLATES, content=content)


def pdf_of(content: CertificateContent) -> bytes:
    """The certificate as a PDF."""
    # Several files as a mapping are documented by typst, but missing in its type stubs.
    sources = cast(bytes, sources_of(content))
    return typst.compile(
        sources,
        format="pdf",
        ignore_system_fonts=True,
        pdf_standards="ua-1",
        timestamp=0,
    )


def sources_of(content: CertificateContent) -> dict[str, bytes]:
    """The files that typst reads: the template, the content, and the drawings."""
    rules = "\n".join([*_drawing_rules(), _FONT])
    drawings = {f"{one.name}.svg": standing_alone(str(one.drawing), rules) for one in content.figures}
    texts = {
        "main.typ": (TEMPLATES / "certificate.typ").read_text(encoding="utf-8"),
        "content.json": json_text(document_of(content)),
        **drawings,
    }
    return {name: text.encode() for name, text in texts.items()}


def _drawing_rules() -> list[str]:
    """The rules of the page that concern drawings."""
    sheets = (REPORT_TEMPLATES / "style.css", TEMPLATES / "certificate.css")
    return [drawing_rules(sheet.read_text(encoding="utf-8")) for sheet in sheets]
