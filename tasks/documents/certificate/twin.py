"""certificate.json: everything the certificate prints, for programs; the PDF is made from the same tree.

Numbers stand as ``{"value": full value or null, "shown": as printed}``, texts as texts. ``record`` is the
whole record, so that the verification code can be computed from this file alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from tasks.calibration.record import CalibrationRecord
from tasks.document_kit.table import Number
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
from tasks.files.json_text import JSON, attributes

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
