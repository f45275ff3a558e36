"""Tables of the page about a sensor: the sheets of the protocol and its lists."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

from tasks.document_kit.table import Column, Number, Row, Table, decimals_for, text_column
from tasks.documents.image_quality.material import SensorMaterial

#: Lists longer than this are in their table alone.
_LISTED = 1000
_WORDS = {
    "defect_pixels": "defect pixels",
    "defect_columns_single": "single defect columns",
    "defect_columns_double": "double defect columns",
    "defect_column_distance": "distance of defect columns",
    "linearity": "linearity",
    "sensitivity": "sensitivity",
    "noise": "noise (photon transfer)",
    "aperture": "aperture correction",
}


def sheet_table(sensor: SensorMaterial) -> Table:
    """What was found against its threshold."""
    columns = (
        text_column("sheet", "sheet"),
        Column("band", "band"),
        Column("value", "found"),
        Column("sigma", "σ"),
        text_column("unit", "of"),
        Column("largest_residual", "largest residual"),
        Column("threshold", "threshold"),
        text_column("passed", "verdict"),
    )
    rows = []
    for _, row in sensor.sheets.iterrows():
        counted = str(row["sheet"]).startswith("defect")
        decimals = 0 if counted else max(2, decimals_for(row["sigma"]))
        rows.append(
            Row(
                f"{row['band']}:{row['sheet']}",
                (
                    _WORDS[str(row["sheet"])],
                    Number(row["band"]),
                    Number(row["value"], decimals),
                    Number(row["sigma"], decimals),
                    str(row["unit"] or ""),
                    Number(row["largest_residual"], 0 if counted else 4),
                    Number(row["threshold"], 0 if counted else 4),
                    "kept" if row["passed"] else "missed",
                ),
            )
        )
    return Table("sheets", "Sheets of the protocol", columns, tuple(rows))


def pixel_table(sensor: SensorMaterial) -> Table:
    """The list of defect pixels."""
    columns = (
        Column("band", "Band"),
        Column("number", "Nr"),
        Column("row", "Row"),
        Column("column", "Column"),
        Column("cluster", "Cluster"),
        text_column("test", "Image"),
    )
    rows = tuple(
        Row(
            f"{row['band']}:{row['number']}",
            (*(Number(row[column.name]) for column in columns[:-1]), str(row["test"])),
        )
        for _, row in sensor.pixels.head(_LISTED).iterrows()
    )
    left = len(sensor.pixels) - len(rows)
    note = f"{left:,} more are listed in defect_pixels.parquet." if left else ""
    return Table("pixels", "Defect pixels (rows and columns from 0)", columns, rows, note)


def column_table(sensor: SensorMaterial) -> Table:
    """The list of defect columns."""
    columns = (
        Column("band", "Band"),
        Column("number", "Nr"),
        Column("row_start", "RowStart"),
        Column("column_start", "ColumnStart"),
        Column("row_end", "RowEnd"),
        Column("column_end", "ColumnEnd"),
    )
    rows = tuple(
        Row(f"{row['band']}:{row['number']}", tuple(Number(row[column.name]) for column in columns))
        for _, row in sensor.columns.iterrows()
    )
    return Table("columns", "Defect columns", columns, rows)


def transfer_table(sensor: SensorMaterial) -> Table:
    """Gain, read noise and full well of the bands."""
    columns = (
        Column("band", "band"),
        Column("gain", "gain", "e⁻ per grey value"),
        Column("sigma_gain", "σ"),
        Column("read_noise", "read noise", "e⁻"),
        Column("sigma_read_noise", "σ"),
        Column("full_well", "full well", "e⁻"),
        Column("statistic", "misfit of the line"),
    )
    found = cast(Sequence[Mapping[str, float]], sensor.figures["photon_transfer"])
    decimals = (0, 3, 3, 2, 2, 0, 2)
    rows = tuple(
        Row(
            str(one["band"]),
            tuple(Number(one[column.name], digits) for column, digits in zip(columns, decimals, strict=True)),
        )
        for one in found
    )
    return Table(
        "transfer", "Photon transfer", columns, rows, "Misfit: weighted mean square, 1 if the line fits."
    )
