"""Tables of the page about image quality: of scenes, and of a sensor with the sheets of the protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

import pandas as pd

from tasks.document_kit.row_table import flag_of, number_of, table_of, text_of
from tasks.document_kit.table import Table, decimals_for
from tasks.documents.image_quality.material import SceneMaterial, SensorMaterial

_BAND = number_of("band", "band")
_IMAGE_BAND = (text_of("image", "image"), _BAND)
_BAND_ZONE = (_BAND, text_of("direction", "along"), text_of("zone", "zone"))
#: Columns of a change against an earlier date.
_CHANGE = (
    number_of("change", "change", decimals=3, plus=True),
    number_of("sigma_change", "σ", decimals=3),
    number_of("t", "in σ", decimals=1, plus=True),
    flag_of("drifted", "drifted"),
)
_FACTOR = (number_of("factor", "factor", decimals=3), number_of("sigma_factor", "σ", decimals=3))
_RESPONSE = (
    number_of("effective_gsd_m", "effective GSD", "m", 4),
    number_of("mtf50", "MTF50", "1/px", 3),
    number_of("mtf_nyquist", "MTF at Nyquist", decimals=3),
)
_SHARPENED = flag_of("sharpened", "sharpened")
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


def mean_table(material: SceneMaterial) -> Table:
    """Factors by band, direction and zone."""
    shown = (
        *_BAND_ZONE,
        number_of("edges", "edges"),
        number_of("left_out", "left out"),
        *_FACTOR,
        number_of("scatter", "scatter of an edge", decimals=3),
        number_of("stated", "stated σ of an edge", decimals=3),
        *_RESPONSE,
        number_of("overshoot", "overshoot", "%", 1, factor=100.0),
        _SHARPENED,
    )
    note = (
        "Factor: full width at half maximum of the line spread function in pixels, 1 for a sharp image. MTF "
        "is the response across the edges following ISO 12233, including the pixel."
    )
    return table_of("means", "Effective resolution", shown, material.means, "{band}:{direction}:{zone}", note)


def resolution_table(material: SceneMaterial) -> Table:
    """Factors by band and direction, over the whole format."""
    shown = (
        _BAND,
        text_of("direction", "along"),
        number_of("edges", "edges"),
        *_FACTOR,
        *_RESPONSE,
        _SHARPENED,
    )
    whole = material.means[material.means["zone"] == "all"]
    caption = "Factor of effective resolution, at slanted edges"
    return table_of("resolution", caption, shown, whole, "{band}:{direction}")


def drift_table(drift: pd.DataFrame) -> Table:
    """Change of the factors since an earlier date."""
    shown = (
        *_BAND_ZONE,
        number_of("earlier", "earlier factor", decimals=3),
        number_of("factor", "now", decimals=3),
        *_CHANGE,
    )
    caption = "Change of the factors since the earlier date"
    return table_of("drift", caption, shown, drift, "{band}:{direction}:{zone}")


def change_table(changes: pd.DataFrame) -> Table:
    """Change of other quantities since an earlier date."""
    shown = (
        text_of("quantity", "quantity", lambda row: row["quantity"].replace("_", " ")),
        _BAND,
        number_of("earlier", "then", decimals=3),
        number_of("value", "now", decimals=3),
        *_CHANGE,
    )
    note = "Defects: σ is √(new + gone), since a pixel near its limit appears and disappears equally often."
    caption = "Change of noise, sensitivity and defects since the earlier date"
    return table_of("changes", caption, shown, changes, "{band}:{quantity}", note)


def smear_table(material: SceneMaterial) -> Table:
    """Blur of different directions as a smear."""
    shown = (
        *_IMAGE_BAND,
        number_of("edges", "edges"),
        number_of("length_px", "length", "px", 2),
        number_of("sigma_length_px", "σ", decimals=2),
        number_of("direction_deg", "direction", "°"),
        number_of("sigma_direction_deg", "σ"),
        flag_of("significant", "significant"),
    )
    caption = "Blur by direction, interpreted as a smear"
    return table_of("smears", caption, shown, material.smears, "{image}:{band}")


def motion_table(compared: pd.DataFrame) -> Table:
    """Smear from the movement of the camera and from the edges."""
    shown = (
        *_IMAGE_BAND,
        number_of("expected_px", "from the trajectory", "px", 2),
        number_of("sigma_expected_px", "σ", decimals=2),
        number_of("expected_deg", "direction", "°"),
        number_of("found_px", "from the edges", "px", 2),
        number_of("sigma_found_px", "σ", decimals=2),
        number_of("found_deg", "direction", "°"),
        number_of("sigma_found_deg", "σ"),
        number_of("probability", "probability", decimals=3),
        flag_of("contradicts", "agree", yes="no", no="yes"),
    )
    note = "Probability of such a difference by chance; below 0.001 the two contradict each other."
    caption = "Smear from the movement of the camera and from the edges"
    return table_of("motion", caption, shown, compared, "{image}:{band}", note)


def refused_table(material: SceneMaterial) -> Table:
    """Why candidates were not taken."""
    refused = cast(Mapping[str, int], material.figures["refused"])
    rows = [{"reason": reason, "count": count} for reason, count in refused.items()]
    shown = (text_of("reason", "reason"), number_of("count", "candidates"))
    return table_of("refused", "Rejected candidates", shown, rows, "{reason}")


def noise_table(material: SceneMaterial) -> Table:
    """Noise by grey level."""
    shown = (
        *_IMAGE_BAND,
        number_of("level", "grey value", decimals=1),
        number_of("noise", "noise", decimals=2),
        number_of("sigma_noise", "σ", decimals=2),
        number_of("signal_to_noise", "signal / noise", decimals=1),
        number_of("tiles", "areas"),
    )
    caption = "Noise in homogeneous areas, grey values"
    return table_of("noise", caption, shown, material.noise, "{image}:{band}:{level}")


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
