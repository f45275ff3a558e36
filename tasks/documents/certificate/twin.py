"""certificate.json: everything the certificate prints, for programs; the PDF is made from the same tree.

Numbers stand as ``{"value": full value or null, "shown": as printed}``, texts as texts. ``record`` is the
whole record, so that the verification code can be computed from this file alone.
"""

from __future__ import annotations

from collections.abc import Mapping

from tasks.calibration.record import CalibrationRecord
from tasks.document_kit.table import Cell
from tasks.documents.certificate.content import (
    Block,
    CertificateContent,
    CorrelationMatrix,
    Fact,
    Facts,
    Figure,
    Listing,
    Sentences,
    SideBySide,
    Words,
)
from tasks.files.json_text import JSON, attributes

FORMAT = "aerocal-certificate"
VERSION = 1


def twin_of(content: CertificateContent, record: CalibrationRecord) -> Mapping[str, JSON]:
    """The certificate as JSON, with its record."""
    return {**document_of(content), "record": record.model_dump(mode="json")}


def document_of(content: CertificateContent) -> Mapping[str, JSON]:
    """What is printed, as JSON."""
    names = ("title", "camera", "project", "subject", "file", "verdict", "sentence", "code", "short_code")
    sections = [
        {**attributes(section, "name", "heading"), "blocks": [_block(block) for block in section.blocks]}
        for section in content.sections
    ]
    return {"format": FORMAT, "version": VERSION, **attributes(content, *names), "sections": sections}


def _block(block: Block) -> JSON:
    if isinstance(block, Words):
        return {"kind": "words", **attributes(block, "tone", "text")}
    if isinstance(block, Sentences):
        return {"kind": "sentences", **attributes(block, "heading", "items")}
    if isinstance(block, Facts):
        facts = [_fact(fact) for fact in block.facts]
        return {"kind": "facts", **attributes(block, "name", "heading"), "facts": facts}
    if isinstance(block, Listing):
        return _listing(block)
    if isinstance(block, CorrelationMatrix):
        rows = [
            [attributes(cell, "value", "shown", "colour", "inverse") for cell in row] for row in block.rows
        ]
        return {"kind": "matrix", **attributes(block, "name", "caption", "labels", "note"), "rows": rows}
    if isinstance(block, Figure):
        return {"kind": "figure", **attributes(block, "name", "caption", "alternative", "width")}
    if isinstance(block, SideBySide):
        return {"kind": "side_by_side", "blocks": [_block(each) for each in block.blocks]}
    return {
        "kind": "signatures",
        "places": [attributes(place, "role", "name", "filled") for place in block.places],
    }


def _fact(fact: Fact) -> JSON:
    return {
        **attributes(fact, "key", "label", "unit", "shown"),
        "values": [_cell(one) for one in fact.values],
    }


def _listing(block: Listing) -> JSON:
    table = block.table
    columns = [
        {**attributes(column, "name", "heading", "unit", "numeric"), "wide": column.name in block.wide}
        for column in table.columns
    ]
    rows = [{"key": row.key, "cells": [_cell(cell) for cell in row.cells]} for row in table.rows]
    return {"kind": "table", **attributes(table, "name", "caption", "note"), "columns": columns, "rows": rows}


def _cell(cell: Cell) -> JSON:
    if isinstance(cell, str):
        return cell
    return {
        "value": float(cell.value) if cell.value is not None and cell.exists else None,
        "shown": str(cell),
    }
