"""Tables of ``aerocal image-quality``: edges, means and responses, noise, and the sheets of a sensor."""

from __future__ import annotations

from tasks.tables.schemas.columns import IMAGE, Column, TableSchema, count, flag, number, text

BAND = count("band", "number of the band in the file, from 1")
DIRECTIONS = ("columns", "rows")
ZONES = ("inner", "middle", "outer")
_FACTOR = (
    number("factor", "factor of effective resolution: effective size of a pixel in pixels"),
    number("sigma_factor", "standard deviation of factor", nullable=True),
)
_RESPONSE = (
    number("mtf50", "frequency at which the response (ISO 12233) is a half", "1/px", nullable=True),
    number("mtf_nyquist", "response (ISO 12233) at half a cycle per pixel"),
    number("overshoot", "how far the edge leaves its levels, in parts of the contrast"),
    number("sigma_overshoot", "standard deviation of overshoot"),
    flag("sharpened", "whether the overshoot is more than noise"),
)


def _direction(name: str, values: tuple[str, ...], meaning: str) -> Column:
    return text(name, meaning, values=values)


EDGES = TableSchema(
    "edges",
    "A slanted edge in an image that was measured.",
    (
        IMAGE,
        BAND,
        count("edge", "number of the edge in the band"),
        number("column_px", "column of its middle; the centre of the first pixel is 0"),
        number("row_px", "row of its middle"),
        number(
            "normal_deg",
            "direction across the edge to its bright side, from increasing columns to increasing rows",
        ),
        _direction("direction", DIRECTIONS, "along which of columns and rows it shows the resolution"),
        number("radius", "distance from the middle of the image in parts of half its diagonal"),
        number("length_px", "length used"),
        number("contrast", "grey values from the dark to the bright side"),
        number("noise", "standard deviation of the pixels on both sides of the edge, grey values"),
        number("blur_px", "σ of the Gaussian that blurs it, in addition to the pixel itself"),
        number("sigma_blur_px", "standard deviation of blur_px"),
        *_FACTOR,
        *_RESPONSE,
    ),
    ("image", "band", "edge"),
)
EDGE_MEANS = TableSchema(
    "edge_means",
    "The edges of a band of all images together, by direction and by zone of the format.",
    (
        BAND,
        _direction("direction", ("all", *DIRECTIONS), "of the edges"),
        _direction(
            "zone",
            ("all", *ZONES),
            "of the format: inner, middle and outer third of the distance from its middle to its corners",
        ),
        count("edges", "number of edges used"),
        count("left_out", "number of edges that lie outside the others"),
        *_FACTOR,
        text(
            "method",
            "by the model of the blur, or by the profile of sharpened edges",
            values=("model", "profile"),
        ),
        number("scatter", "standard deviation of the factor of an edge", nullable=True),
        number("stated", "the same as the adjustments of the edges state it"),
        number("blur_px", "mean σ of the blur"),
        number("effective_gsd_m", "factor times ground sampling distance", nullable=True),
        number("sigma_effective_gsd_m", "its standard deviation", nullable=True),
        *_RESPONSE,
    ),
    ("band", "direction", "zone"),
)
SMEARS = TableSchema(
    "smears",
    "Difference of the blur between directions in a band of an image, as a smear.",
    (
        IMAGE,
        BAND,
        count("edges", "number of edges used"),
        number("length_px", "length of the smear"),
        number("sigma_length_px", "its standard deviation"),
        number("direction_deg", "its direction, from increasing columns to increasing rows"),
        number("sigma_direction_deg", "its standard deviation"),
        number("probability", "of such a difference by chance"),
        flag("significant", "whether chance does not explain it"),
    ),
    ("image", "band"),
)
SMEAR_MOTION = TableSchema(
    "smear_motion",
    "Smear of a band of an image: as the movement of the camera makes it, and as its edges show it.",
    (
        IMAGE,
        BAND,
        count("edges", "number of edges used"),
        number("expected_px", "length by the movement of the camera"),
        number("sigma_expected_px", "its standard deviation"),
        number("expected_deg", "direction by the movement, from increasing columns to increasing rows"),
        number("sigma_expected_deg", "its standard deviation, 90 at most"),
        number("found_px", "length by the edges"),
        number("sigma_found_px", "its standard deviation"),
        number("found_deg", "direction by the edges"),
        number("sigma_found_deg", "its standard deviation, 90 at most"),
        number("probability", "of such a difference by chance"),
        flag("contradicts", "whether chance does not explain it"),
    ),
    ("image", "band"),
)
EDGE_DRIFT = TableSchema(
    "edge_drift",
    "Change of a mean of edge_means since an earlier date.",
    (
        BAND,
        _direction("direction", ("all", *DIRECTIONS), "of the edges"),
        _direction("zone", ("all", *ZONES), "of the format"),
        number("earlier", "earlier factor"),
        number("factor", "factor now"),
        number("change", "factor now − then"),
        number("sigma_change", "its standard deviation", nullable=True),
        number("t", "change / sigma_change", nullable=True),
        flag("drifted", "whether the change is more than its standard deviation explains"),
    ),
    ("band", "direction", "zone"),
)
QUALITY_DRIFT = TableSchema(
    "quality_drift",
    "Change of a quantity of a band since an earlier date.",
    (
        BAND,
        text(
            "quantity",
            "noise of scenes at the same grey values, sensitivity (grey values/ms), read noise (electrons), "
            "or number of defects",
            values=("noise", "sensitivity", "read_noise", "defect_pixels", "defect_columns"),
        ),
        number("earlier", "value then"),
        number("value", "value now"),
        number("change", "value now − then"),
        number("sigma_change", "its standard deviation; of defects √(new + gone)", nullable=True),
        number("t", "change / sigma_change", nullable=True),
        flag("drifted", "whether the change is more than its standard deviation explains"),
    ),
    ("band", "quantity"),
)
EDGE_RESPONSES = TableSchema(
    "edge_responses",
    "Response of all edges of a band in one direction at a frequency.",
    (
        BAND,
        _direction("direction", DIRECTIONS, "of the edges"),
        number("frequency", "spatial frequency", "1/px"),
        number("response", "spatial frequency response following ISO 12233"),
    ),
    ("band", "direction", "frequency"),
)
NOISE_LEVELS = TableSchema(
    "noise_levels",
    "Noise of a band of an image in homogeneous areas of a grey level.",
    (
        IMAGE,
        BAND,
        number("level", "mean grey value"),
        number("noise", "standard deviation of the noise, grey values"),
        number("sigma_noise", "standard deviation of noise"),
        number("signal_to_noise", "level / noise; null without noise", nullable=True),
        count("tiles", "number of homogeneous areas of 16 × 16 pixels"),
    ),
    ("image", "band", "level"),
)
SHEETS = (
    "defect_pixels", "defect_columns_single", "defect_columns_double", "defect_column_distance", "linearity",
    "sensitivity", "noise", "aperture",
)  # fmt: skip
DEFECT_PIXELS = TableSchema(
    "defect_pixels",
    "A defect pixel outside of defect columns.",
    (
        BAND,
        count("number", "number in the list of the band"),
        count("row", "row of the pixel, from 0"),
        count("column", "column of the pixel, from 0"),
        count("cluster", "number of the cluster of touching pixels it belongs to; 0: it is alone"),
        text("test", "image in which it deviates", values=("bright", "dark", "both")),
    ),
    ("band", "number"),
)
DEFECT_COLUMNS = TableSchema(
    "defect_columns",
    "A defect column, or several adjacent ones.",
    (
        BAND,
        count("number", "number in the list of the band"),
        count("row_start", "first row with a defect"),
        count("column_start", "first column"),
        count("row_end", "last row with a defect"),
        count("column_end", "last column"),
    ),
    ("band", "number"),
)
PHOTON_TRANSFER = TableSchema(
    "photon_transfer",
    "A level of an exposure series, in the middle of the format.",
    (
        BAND,
        number("exposure_ms", "exposure time"),
        number("signal", "mean grey value above that of the dark images"),
        number("variance", "variance of a pixel, squared grey values, without that of quantisation"),
        flag("used", "whether it is used in the line of photon transfer"),
        number("residual", "mean grey value minus the line of linearity, in parts of the largest signal"),
    ),
    ("band", "exposure_ms"),
)
APERTURE = TableSchema(
    "aperture",
    "Light in a cell of the format, the table of the aperture correction.",
    (
        BAND,
        count("row", "number of the cell from the top, from 0"),
        count("column", "number of the cell from the left, from 0"),
        number("light", "signal relative to that in the middle; the correction divides by it"),
    ),
    ("band", "row", "column"),
)
SENSOR_SHEETS = TableSchema(
    "sensor_sheets",
    "A sheet of the protocol: what was found against its threshold.",
    (
        BAND,
        text("sheet", "what is tested", values=SHEETS),
        number(
            "value", "value of the sheet: a number of defects, or a quantity with its unit", nullable=True
        ),
        number("sigma", "its standard deviation", nullable=True),
        text("unit", "unit of value; empty for numbers", nullable=True),
        number(
            "largest_residual",
            "largest residual, or the number itself where defects are counted",
            nullable=True,
        ),
        number("threshold", "that it must keep"),
        flag("passed", "whether it does"),
        number(
            "degrees_of_freedom",
            "of sigma, where it comes from the residuals of a line; empty where it is known",
            nullable=True,
        ),
    ),
    ("band", "sheet"),
)
