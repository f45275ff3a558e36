"""Self-calibration: every additional parameter that was offered with what was decided, and the tests."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Mapping
from typing import Any

from tasks.document_kit.table import Cell, Column, Row, Table, decimals_for, numbers, text_column
from tasks.documents.report.correlations import natural_key
from tasks.documents.report.material import Material

MOST_ROWS = 200
_LEVEL = re.compile(r" \((two-sided, [^()]*)\)$")
_DECISIONS = {"is significant": "significant", "is eliminated": "eliminated", "is kept": "kept"}


def offered_table(material: Material) -> Table:
    """The additional parameters that were offered to the adjustment."""
    columns = (
        text_column("parameter", "parameter"),
        text_column("entity", "of"),
        text_column("meaning", "meaning"),
        Column("value", "value"),
        Column("sigma", "σ"),
        text_column("unit", "unit"),
        Column("t", "t"),
        Column("effect_max_um", "largest effect", "µm"),
        Column("effect_rms_um", "RMS effect", "µm"),
        text_column("decision", "decision"),
        Column("total_correlation", "total correlation"),
        Column("strongest_correlation", "strongest correlation"),
        text_column("correlated_with", "with"),
        Column("t_of_all", "t with all"),
        text_column("formula", "formula"),
    )
    table = material.self_calibration
    if table.empty:
        return Table("self-calibration", "Additional parameters", columns, ())
    keys = table["entity"] + "@" + table["parameter"]
    ordered = table.loc[sorted(table.index, key=lambda row: natural_key(keys[row]))]
    shown = ordered.head(MOST_ROWS)
    note = ""
    if len(shown) < len(ordered):
        note = f"The first {len(shown)} of {len(ordered):,}; all in self_calibration.parquet."
    tail = common_level(table["reason"].tolist())
    if tail:
        note = f"{note} Tests of t are {tail}.".strip()
    rows = tuple(_row(row, tail) for row in shown.to_dict("records"))
    return Table("self-calibration", "Additional parameters", columns, rows, note)


def common_level(reasons: Iterable[str]) -> str:
    """The level in brackets at the end of the reasons, where all that have one have the same; else empty."""
    found = {match[1] for reason in reasons if (match := _LEVEL.search(reason))}
    return found.pop() if len(found) == 1 else ""


def _row(row: Mapping[Hashable, Any], level: str) -> Row:
    """A parameter with as many decimals as give its σ two digits; what was eliminated has no value."""
    gone = row["decision"] == "is eliminated"
    effects = [None if gone else float(row[name]) for name in ("effect_max_um", "effect_rms_um")]
    decimals = decimals_for(float(row["sigma"]))
    reason = str(row["reason"]).removesuffix(f" ({level})")
    cells: tuple[Cell, ...] = (
        str(row["parameter"]),
        str(row["entity"]),
        str(row["meaning"]),
        *numbers((row["value"], row["sigma"]), decimals),
        str(row["unit"]),
        *numbers((row["t"],), 1, plus=True),
        *numbers(effects, 2),
        f"{_DECISIONS[str(row['decision'])]}: {reason}",
        *numbers((row["total_correlation"],), 3),
        *numbers((row["strongest_correlation"],), 2, plus=True),
        _partner(row),
        *numbers((row["t_of_all"],), 1, plus=True),
        str(row["formula"]),
    )
    return Row(f"{row['parameter']}@{row['entity']}", cells)


def _partner(row: Mapping[Hashable, Any]) -> str:
    """What a parameter is correlated with; its entity only where it is another one."""
    same = row["correlated_entity"] == row["entity"]
    return str((row["correlated_parameter"] if same else row["correlated_with"]) or "")


def group_table(material: Material) -> Table:
    """F-tests of the parts of the selection against zero."""
    figures = material.figures.self_calibration
    rows = [
        Row(
            test.group,
            (
                test.group,
                *_test_cells(test.parameters, test.statistic, test.critical, test.probability),
                "contributes" if test.significant else "does not differ from zero",
            ),
        )
        for test in (figures.groups if figures else ())
    ]
    columns = (text_column("group", "group"), *_TEST_COLUMNS)
    return Table("self-calibration-groups", "F-tests of whole groups against zero", columns, tuple(rows))


def flight_table(material: Material) -> Table:
    """F-tests whether the additional parameters of a camera differ between flights."""
    figures = material.figures.self_calibration
    rows = [
        Row(
            f"{test.first}|{test.second}",
            (
                test.first,
                test.second,
                *_test_cells(test.parameters, test.statistic, test.critical, test.probability),
                "differ" if test.differ else "do not differ",
            ),
        )
        for test in (figures.flights if figures else ())
    ]
    columns = (text_column("first", "first"), text_column("second", "second"), *_TEST_COLUMNS)
    caption = "F-tests of the difference between flights"
    return Table("self-calibration-flights", caption, columns, tuple(rows))


_TEST_COLUMNS = (
    Column("parameters", "parameters"),
    Column("statistic", "F"),
    Column("critical", "limit (α = 1 %)"),
    Column("probability", "probability by chance"),
    text_column("verdict", "verdict"),
)


def _test_cells(parameters: int, statistic: float, critical: float, probability: float) -> tuple[Cell, ...]:
    return (
        *numbers((float(parameters),), 0),
        *numbers((statistic, critical), 2),
        *numbers((probability,), max(4, decimals_for(probability, 1))),
    )
