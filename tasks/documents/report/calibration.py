"""System calibration: what the flight determines, the stages of release, and both methods side by side."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

from tasks.document_kit.table import Cell, Column, Row, Table, decimals_for, numbers, text_column
from tasks.documents.report.material import Material
from tasks.quantities import quantity_words
from tasks.results.calibration_figures import CalibrationFigures, CalibrationVerdictFigure

_VERDICTS = {"not_determinable": "not determinable"}


def calibration_tables(material: Material) -> tuple[Table, ...]:
    """Verdicts, releases, and the comparison with two steps; without a calibration nothing."""
    found = material.figures.calibration
    if found is None:
        return ()
    return _verdicts(material, found), _releases(found), _steps(found)


def _verdicts(material: Material, found: CalibrationFigures) -> Table:
    columns = (
        text_column("parameter", "parameter"),
        text_column("entity", "of"),
        Column("change", "change"),
        Column("sigma", "σ"),
        Column("limit", "limit of σ"),
        Column("sigma_over_prior", "σ/σ prior"),
        text_column("unit", "unit"),
        Column("correlation", "strongest correlation"),
        text_column("correlated_with", "with"),
        text_column("verdict", "verdict"),
    )
    table = material.parameters
    rows_of = {(row["parameter"], row["entity"]): row for row in table.to_dict("records")}
    shown = [item for item in found.parameters if item.verdict != "held"]
    rows = tuple(_verdict_row(item, rows_of[item.parameter, item.entity]) for item in shown)
    held = len(found.parameters) - len(shown)
    note = f"{held} more are held at their given values." if held else ""
    return Table("calibration", "Parameters determined by this flight", columns, rows, note)


def _verdict_row(item: CalibrationVerdictFigure, row: Mapping[Hashable, Any]) -> Row:
    """Values with as many decimals as give σ two digits; what is not determinable has none."""
    known = item.sigma is not None and item.verdict != "not_determinable"
    decimals = decimals_for(item.sigma)
    cells: tuple[Cell, ...] = (
        quantity_words(item.parameter),
        item.entity,
        *numbers((float(row["change"]) if known else None,), decimals, plus=True),
        *numbers((item.sigma,), decimals),
        *numbers((item.limit,), decimals_for(item.limit)),
        *numbers((item.sigma_over_prior,), 2),
        str(row["unit"]),
        *numbers((item.correlation,), 2, plus=True),
        quantity_words(item.correlated_with or ""),
        _VERDICTS.get(item.verdict, item.verdict),
    )
    return Row(f"{item.parameter}@{item.entity}", cells)


def _releases(found: CalibrationFigures) -> Table:
    columns = (
        text_column("stage", "stage"),
        text_column("free", "free"),
        text_column("additional", "additional parameters"),
        text_column("held", "then held fixed, with reason"),
    )
    rows = tuple(
        Row(
            str(number),
            (
                str(number),
                ", ".join(quantity_words(name) for name in release.free) or "nothing",
                release.additional,
                " ".join(f"{quantity_words(name)}: {reason}" for name, reason in release.held.items())
                or "nothing",
            ),
        )
        for number, release in enumerate(found.releases, start=1)
    )
    return Table("calibration-releases", "Parameters freed step by step", columns, rows)


def _steps(found: CalibrationFigures) -> Table:
    columns = (
        text_column("parameter", "parameter"),
        text_column("entity", "of"),
        Column("one_step", "one step"),
        Column("one_step_sigma", "σ"),
        Column("two_step", "two steps"),
        Column("two_step_sigma", "σ"),
        Column("difference", "difference"),
        Column("t", "t"),
        text_column("unit", "unit"),
    )
    compared = () if found.two_step is None else found.two_step.parameters
    rows = []
    for item in compared:
        decimals = decimals_for(min(item.one_step_sigma, item.two_step_sigma))
        cells: tuple[Cell, ...] = (
            quantity_words(item.parameter),
            item.entity,
            *numbers((item.one_step, item.one_step_sigma, item.two_step, item.two_step_sigma), decimals),
            *numbers((item.difference,), decimals, plus=True),
            *numbers((item.t,), 1, plus=True),
            item.unit,
        )
        rows.append(Row(f"{item.parameter}@{item.entity}", cells))
    return Table("calibration-steps", "One-step and two-step calibration", columns, tuple(rows))
