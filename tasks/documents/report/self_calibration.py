"""Self-calibration: every additional parameter that was offered with what was decided, and the tests."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Mapping
from typing import Any

from tasks.document_kit.row_table import Shown, flag_of, number_of, omitted, table_of, text_of
from tasks.document_kit.table import Table, decimals_for
from tasks.documents.report.correlations import natural_key
from tasks.documents.report.material import Material

MOST_ROWS = 200
_LEVEL = re.compile(r" \((two-sided, [^()]*)\)$")
_DECISIONS = {"is significant": "significant", "is eliminated": "eliminated", "is kept": "kept"}


def offered_table(material: Material) -> Table:
    """The additional parameters that were offered, with as many decimals as give their σ two digits."""
    table = material.self_calibration
    name, caption = "self-calibration", "Additional parameters"
    if table.empty:
        return table_of(name, caption, _offered(""), (), "")
    keys = (table["entity"] + "@" + table["parameter"]).tolist()
    ordered = table.iloc[sorted(range(len(keys)), key=lambda row: natural_key(keys[row]))]
    listed = ordered.head(MOST_ROWS)
    note = omitted(listed, ordered, "self_calibration.parquet")
    level = common_level(table["reason"].tolist())
    if level:
        note = f"{note} Tests of t are {level}.".strip()
    return table_of(name, caption, _offered(level), listed, "{parameter}@{entity}", note)


def _offered(level: str) -> tuple[Shown, ...]:
    """The columns; what was eliminated has no value and no effect."""

    def decision(row: Mapping[Hashable, Any]) -> str:
        reason = str(row["reason"]).removesuffix(f" ({level})")
        return f"{_DECISIONS[str(row['decision'])]}: {reason}"

    def partner(row: Mapping[Hashable, Any]) -> str:
        """What it is correlated with; its entity only where it is another one."""
        same = row["correlated_entity"] == row["entity"]
        return str((row["correlated_parameter"] if same else row["correlated_with"]) or "")

    def effect(name: str, heading: str) -> Shown:
        def read(row: Mapping[Hashable, Any]) -> float | None:
            return None if row["decision"] == "is eliminated" else float(row[name])

        return number_of(name, heading, "µm", 2, of=read)

    return (
        text_of("parameter", "parameter"),
        text_of("entity", "of"),
        text_of("meaning", "meaning"),
        number_of("value", "value", decimals="sigma"),
        number_of("sigma", "σ", decimals="sigma"),
        text_of("unit", "unit"),
        number_of("t", "t", decimals=1, plus=True),
        effect("effect_max_um", "largest effect"),
        effect("effect_rms_um", "RMS effect"),
        text_of("decision", "decision", decision),
        number_of("total_correlation", "total correlation", decimals=3),
        number_of("strongest_correlation", "strongest correlation", decimals=2, plus=True),
        text_of("correlated_with", "with", partner),
        number_of("t_of_all", "t with all", decimals=1, plus=True),
        text_of("formula", "formula"),
    )


def common_level(reasons: Iterable[str]) -> str:
    """The level in brackets at the end of the reasons, where all that have one have the same; else empty."""
    found = {match[1] for reason in reasons if (match := _LEVEL.search(reason))}
    return found.pop() if len(found) == 1 else ""


def group_table(material: Material) -> Table:
    """F-tests of the parts of the selection against zero."""
    figures = material.figures.self_calibration
    shown = (
        text_of("group", "group"),
        *_F_TEST,
        flag_of("significant", "verdict", "contributes", "does not differ from zero"),
    )
    caption = "F-tests of whole groups against zero"
    return table_of("self-calibration-groups", caption, shown, figures.groups if figures else (), "{group}")


def flight_table(material: Material) -> Table:
    """F-tests whether the additional parameters of a camera differ between flights."""
    figures = material.figures.self_calibration
    shown = (
        text_of("first", "first"),
        text_of("second", "second"),
        *_F_TEST,
        flag_of("differ", "verdict", "differ", "do not differ"),
    )
    caption, tests = "F-tests of the difference between flights", figures.flights if figures else ()
    return table_of("self-calibration-flights", caption, shown, tests, "{first}|{second}")


_F_TEST = (
    number_of("parameters", "parameters"),
    number_of("statistic", "F", decimals=2),
    number_of("critical", "limit (α = 1 %)", decimals=2),
    number_of(
        "probability",
        "probability by chance",
        decimals=lambda test: max(4, decimals_for(test.probability, 1)),
    ),
)
