"""Tables of the page about a sensor: the sheets of the protocol and its lists."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

from tasks.document_kit.row_table import flag_of, number_of, table_of, text_of
from tasks.document_kit.table import Table, decimals_for
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


def _is_counted(row: Mapping[str, Any]) -> bool:
    return str(row["sheet"]).startswith("defect")


def _value_decimals(row: Mapping[str, Any]) -> int:
    return 0 if _is_counted(row) else max(2, decimals_for(row["sigma"]))


def _limit_decimals(row: Mapping[str, Any]) -> int:
    return 0 if _is_counted(row) else 4


def sheet_table(sensor: SensorMaterial) -> Table:
    """What was found against its threshold."""
    shown = (
        text_of("sheet", "sheet", lambda row: _WORDS[row["sheet"]]),
        number_of("band", "band"),
        number_of("value", "found", decimals=_value_decimals),
        number_of("sigma", "σ", decimals=_value_decimals),
        text_of("unit", "of"),
        number_of("largest_residual", "largest residual", decimals=_limit_decimals),
        number_of("threshold", "threshold", decimals=_limit_decimals),
        flag_of("passed", "verdict", "kept", "missed"),
    )
    return table_of("sheets", "Sheets of the protocol", shown, sensor.sheets, "{band}:{sheet}")


def pixel_table(sensor: SensorMaterial, most: int = _LISTED) -> Table:
    """The list of defect pixels; the rows after the first `most` are only counted."""
    shown = (
        number_of("band", "Band"),
        number_of("number", "Nr"),
        number_of("row", "Row"),
        number_of("column", "Column"),
        number_of("cluster", "Cluster"),
        text_of("test", "Image"),
    )
    left = len(sensor.pixels) - most
    note = f"{left:,} more are listed in defect_pixels.parquet." if left > 0 else ""
    caption = "Defect pixels (rows and columns from 0)"
    return table_of("pixels", caption, shown, sensor.pixels.head(most), "{band}:{number}", note)


def column_table(sensor: SensorMaterial) -> Table:
    """The list of defect columns."""
    shown = (
        number_of("band", "Band"),
        number_of("number", "Nr"),
        number_of("row_start", "RowStart"),
        number_of("column_start", "ColumnStart"),
        number_of("row_end", "RowEnd"),
        number_of("column_end", "ColumnEnd"),
    )
    return table_of("columns", "Defect columns", shown, sensor.columns, "{band}:{number}")


def transfer_table(sensor: SensorMaterial) -> Table:
    """Gain, read noise and full well of the bands."""
    shown = (
        number_of("band", "band"),
        number_of("gain", "gain", "e⁻ per grey value", 3),
        number_of("sigma_gain", "σ", decimals=3),
        number_of("read_noise", "read noise", "e⁻", 2),
        number_of("sigma_read_noise", "σ", decimals=2),
        number_of("full_well", "full well", "e⁻"),
        number_of("statistic", "misfit of the line", decimals=2),
    )
    found = cast(Sequence[Mapping[str, float]], sensor.figures["photon_transfer"])
    note = "Misfit: weighted mean square, 1 if the line fits."
    return table_of("transfer", "Photon transfer", shown, found, "{band}", note)
