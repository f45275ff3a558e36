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
    Facts,
    Figure,
    Listing,
    Section,
    Sentences,
    SideBySide,
    Words,
)
from tasks.files.json_text import JSON

FORMAT = "aerocal-certificate"
VERSION = 1


def twin_of(content: CertificateContent, record: CalibrationRecord) -> Mapping[str, JSON]:
    """The certificate as JSON, with its record."""
    return {**document_of(content), "record": record.model_dump(mode="json")}


def document_of(content: CertificateContent) -> Mapping[str, JSON]:
    """What is printed, as JSON."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "title": content.title,
        "camera": content.camera,
        "project": content.project,
        "subject": content.subject,
        "file": content.file,
        "verdict": content.verdict,
        "sentence": content.sentence,
        "code": content.code,
        "short_code": content.short_code,
        "sections": [_section(section) for section in content.sections],
    }


def _section(section: Section) -> JSON:
    return {
        "name": section.name,
        "heading": section.heading,
        "blocks": [_block(block) for block in section.blocks],
    }


def _block(block: Block) -> JSON:
    if isinstance(block, Words):
        return {"kind": "words", "tone": block.tone, "text": block.text}
    if isinstance(block, Sentences):
        return {"kind": "sentences", "heading": block.heading, "items": list(block.items)}
    if isinstance(block, Facts):
        return _facts(block)
    if isinstance(block, Listing):
        return _listing(block)
    if isinstance(block, CorrelationMatrix):
        return _matrix(block)
    if isinstance(block, Figure):
        return {
            "kind": "figure",
            "name": block.name,
            "caption": block.caption,
            "alternative": block.alternative,
            "width": block.width,
        }
    if isinstance(block, SideBySide):
        return {"kind": "side_by_side", "blocks": [_block(each) for each in block.blocks]}
    places: list[JSON] = [
        {"role": place.role, "name": place.name, "filled": place.filled} for place in block.places
    ]
    return {"kind": "signatures", "places": places}


def _facts(block: Facts) -> JSON:
    facts: list[JSON] = [
        {
            "key": fact.key,
            "label": fact.label,
            "values": [_cell(value) for value in fact.values],
            "unit": fact.unit,
            "shown": fact.shown,
        }
        for fact in block.facts
    ]
    return {"kind": "facts", "name": block.name, "heading": block.heading, "facts": facts}


def _listing(block: Listing) -> JSON:
    table = block.table
    columns: list[JSON] = [
        {
            "name": column.name,
            "heading": column.heading,
            "unit": column.unit,
            "numeric": column.numeric,
            "wide": column.name in block.wide,
        }
        for column in table.columns
    ]
    rows: list[JSON] = [{"key": row.key, "cells": [_cell(cell) for cell in row.cells]} for row in table.rows]
    return {
        "kind": "table",
        "name": table.name,
        "caption": table.caption,
        "columns": columns,
        "rows": rows,
        "note": table.note,
    }


def _matrix(block: CorrelationMatrix) -> JSON:
    rows: list[JSON] = [
        [
            {"value": cell.value, "shown": cell.shown, "colour": cell.colour, "inverse": cell.inverse}
            for cell in row
        ]
        for row in block.rows
    ]
    return {
        "kind": "matrix",
        "name": block.name,
        "caption": block.caption,
        "labels": list(block.labels),
        "rows": rows,
        "note": block.note,
    }


def _cell(cell: Cell) -> JSON:
    if isinstance(cell, str):
        return cell
    return {
        "value": float(cell.value) if cell.value is not None and cell.exists else None,
        "shown": str(cell),
    }
