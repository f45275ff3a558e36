"""Tables of the page about image quality."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import pandas as pd

from tasks.document_kit.row_table import flag_of, number_of, table_of, text_of
from tasks.document_kit.table import Table
from tasks.documents.image_quality.material import SceneMaterial

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
