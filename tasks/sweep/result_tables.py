"""Tables of the page of a sweep: σ0 and differences by scenario, published numbers next to ours."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import pandas as pd

from tasks.document_kit.row_table import number_of, table_of, text_of
from tasks.document_kit.table import Cell, Column, Number, Row, Table, numbers, text_column
from tasks.files.json_text import from_json
from tasks.settings.published_sweep import PublishedTable

Role = Literal["control", "check"]
#: In the order of the page.
ROLES: tuple[Role, ...] = ("check", "control")
_AXES = ("x", "y", "z")
_WORDS = {"control": "control points", "check": "check points"}
#: Before the name of a published number in the page.
PUBLISHED = "published_"


@dataclass(frozen=True, eq=False)
class SweepResults:
    """What the page shows.

    Attributes
    ----------
    table : sweep.parquet in the order of the project file.
    published : the published table, if the project names one.
    """

    table: pd.DataFrame
    published: PublishedTable | None

    @property
    def blocks(self) -> tuple[str, ...]:
        """Names of the sub-blocks in their order."""
        return tuple(dict.fromkeys(self.table["block"]))

    def of_block(self, block: str) -> pd.DataFrame:
        """The scenarios of a sub-block that were computed."""
        return self.table[(self.table["block"] == block) & (self.table["status"] == "done")]

    def printed(self, row: pd.Series) -> Mapping[str, float]:
        """The published numbers of a scenario by name; empty if there are none.

        ``sigma0_ratio`` is taken from the printed σ0.
        """
        if self.published is None:
            return {}
        figures = self.published.figures
        own = dict(figures.get((row["block"], row["control"], row["variant"]), {}))
        first = self.table[(self.table["block"] == row["block"]) & (self.table["control"] == row["control"])]
        reference = figures.get((row["block"], row["control"], first["variant"].iloc[0]), {})
        if "sigma0_um" in own and "sigma0_um" in reference:
            own["sigma0_ratio"] = own["sigma0_um"] / reference["sigma0_um"]
        return own


def has_points(scenarios: pd.DataFrame, role: Role) -> pd.DataFrame:
    """The scenarios with points of a role."""
    return scenarios[scenarios[f"{role}_points"].fillna(0) > 0]


def rms_table(results: SweepResults, block: str, role: Role) -> Table:
    """σ0 and RMS differences of every scenario of a sub-block at its points of a role."""
    figures = (
        Column("sigma0_um", "σ0", "µm"),
        Column("sigma0_ratio", "σ0 ratio"),
        *(Column(f"rmse_{role}_{axis}_m", f"RMS {axis.upper()}", "m") for axis in _AXES),
    )
    caption = f"{block}: σ0, and RMS differences at the {_WORDS[role]}"
    return _compared(results, block, role, f"{role}-{results.blocks.index(block)}", caption, figures)


def largest_table(results: SweepResults, block: str, role: Role) -> Table:
    """Largest differences of every scenario of a sub-block at its points of a role."""
    figures = tuple(Column(f"max_{role}_{axis}_m", f"largest {axis.upper()}", "m") for axis in _AXES)
    caption = f"{block}: largest differences at the {_WORDS[role]}"
    return _compared(results, block, role, f"largest-{role}-{results.blocks.index(block)}", caption, figures)


def _compared(
    results: SweepResults, block: str, role: Role, name: str, caption: str, figures: tuple[Column, ...]
) -> Table:
    """A row for each scenario; a figure published for any of them has a column with the published values."""
    scenarios = has_points(results.of_block(block), role)
    printed = [results.printed(row) for _, row in scenarios.iterrows()]
    compared = {column.name for column in figures if any(column.name in one for one in printed)}
    columns = [
        text_column("control", "control"),
        text_column("variant", "variant"),
        Column(f"{role}_points", _WORDS[role]),
        Column("parameters_kept", "parameters kept"),
    ]
    for column in figures:
        columns.append(column)
        if column.name in compared:
            columns.append(Column(f"{PUBLISHED}{column.name}", "print", column.unit))
    rows, above = [], ""
    for (_, row), of_print in zip(scenarios.iterrows(), printed, strict=True):
        # The choice of control points is named once, as printed tables do.
        cells: list[Cell] = ["" if row["control"] == above else str(row["control"]), str(row["variant"])]
        above = row["control"]
        cells += [Number(row[f"{role}_points"]), Number(row["parameters_kept"])]
        for column in figures:
            cells.append(Number(float(row[column.name]), 3))
            if column.name in compared:
                decimals = 2 if column.name == "sigma0_um" else 3
                cells.append(Number(of_print.get(column.name), decimals))
        rows.append(Row(scenario_key(row), tuple(cells)))
    return Table(name, caption, tuple(columns), tuple(rows))


def scenario_key(row: pd.Series | Mapping[str, object]) -> str:
    """The key of a scenario's row in the page."""
    return f"{row['block']}|{row['control']}|{row['variant']}"


def residual_table(results: SweepResults, block: str) -> Table:
    """What remains in the images of a sub-block, by variant, with the first choice of control points."""
    scenarios = results.of_block(block)
    first = scenarios[scenarios["control"] == scenarios["control"].iloc[0]]
    caption = f"{block}: what remains in the images (control: {first['control'].iloc[0]})"
    note = "Systematic part: RMS of the mean residuals, corrected for chance."
    name = f"residuals-{results.blocks.index(block)}"
    return table_of(name, caption, _RESIDUALS, first, scenario_key, note)


_RESIDUALS = (
    text_of("variant", "variant"),
    number_of("image_rms_x_um", "RMS of residuals x", "µm", 3),
    number_of("image_rms_y_um", "y", "µm", 3),
    number_of("cells", "sub-areas with a mean"),
    number_of("cells_significant", "of them significant"),
    number_of("cells_by_chance", "expected by chance"),
    number_of("systematic_x_um", "systematic part x", "µm", 3),
    number_of("systematic_y_um", "y", "µm", 3),
)


def block_table(results: SweepResults) -> Table:
    """What the sub-blocks consist of, by the first scenario of each."""
    shown = (
        text_of("block", "sub-block"),
        number_of("images", "images"),
        number_of("object_points", "object points"),
        number_of("image_points", "image points"),
        number_of("redundancy", "redundancy"),
        number_of("gsd_m", "GSD, median", "m", 3),
    )
    computed = (results.of_block(block) for block in results.blocks)
    first = [scenarios.iloc[0].to_dict() for scenarios in computed if len(scenarios)]
    note = "Numbers of the first scenario of each sub-block."
    return table_of("blocks", "Sub-blocks", shown, first, "{block}", note)


def variant_table(results: SweepResults) -> Table:
    """What every variant changes."""
    changes = results.table.drop_duplicates("variant")
    rows = tuple(
        Row(row["variant"], (row["variant"], _as_declared(row["changes"]))) for _, row in changes.iterrows()
    )
    columns = (text_column("variant", "variant"), text_column("changes", "settings it changes"))
    return Table("variants", "Variants of the settings", columns, rows)


def _as_declared(changes: str) -> str:
    """Settings of a JSON text as a project file has them."""
    settings = from_json(changes)
    assert isinstance(settings, dict)
    return (
        ", ".join(f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in settings.items())
        or "nothing"
    )


def failure_table(results: SweepResults) -> Table:
    """The scenarios without a result, and why; variants that share a reason in one row."""
    failed = results.table[results.table["status"] != "done"]
    rows = tuple(
        Row(scenario_key(own.iloc[0]), (str(block), str(control), ", ".join(own["variant"]), str(reason)))
        for (block, control, reason), own in failed.groupby(["block", "control", "reason"], sort=False)
    )
    columns = tuple(text_column(name, name) for name in ("block", "control", "variant", "reason"))
    return Table("failures", "Scenarios that could not be computed", columns, rows)


def in_gsd(row: pd.Series, value: float | None) -> float | None:
    """A length on the ground in ground sampling distances of the scenario's sub-block."""
    return None if value is None else float(value) / float(row["gsd_m"])


def gsd_table(results: SweepResults, block: str) -> Table:
    """The heights of the bars: RMS in GSD of every scenario, ours and published."""
    rows = []
    for _, row in results.of_block(block).iterrows():
        role = shown_role(row)
        printed = results.printed(row)
        names = [f"rmse_{role}_{axis}_m" for axis in _AXES]
        ours = [in_gsd(row, float(row[name])) for name in names]
        theirs = [in_gsd(row, printed.get(name)) for name in names]
        words = (str(row["control"]), str(row["variant"]), _WORDS[role])
        rows.append(Row(scenario_key(row), (*words, *numbers(ours, 2), *numbers(theirs, 2))))
    columns = (
        text_column("control", "control"),
        text_column("variant", "variant"),
        text_column("role", "RMS at the"),
        *(Column(f"gsd_{axis}", f"RMS {axis.upper()}", "GSD") for axis in _AXES),
        *(Column(f"{PUBLISHED}gsd_{axis}", f"print {axis.upper()}", "GSD") for axis in _AXES),
    )
    return Table(f"gsd-{results.blocks.index(block)}", f"{block}: RMS in GSD", columns, tuple(rows))


def shown_role(row: pd.Series) -> Role:
    """Points that show the accuracy of a scenario: its check points, or without any its control points."""
    return "check" if float(row["check_points"]) > 0 else "control"
