"""Tables of ``aerocal image-quality``: edges, their means and responses, noise by grey level."""

from __future__ import annotations

from tasks.tables.schemas.columns import IMAGE, Column, TableSchema, count, flag, number, text

BAND = count("band", "number of the band in the file, from 1")
DIRECTIONS = ("columns", "rows")
ZONES = ("inner", "middle", "outer")
_FACTOR = (
    number("factor", "", "factor of effective resolution: effective size of a pixel in pixels"),
    number("sigma_factor", "", "standard deviation of factor", nullable=True),
)
_RESPONSE = (
    number("mtf50", "1/px", "frequency at which the response (ISO 12233) is a half", nullable=True),
    number("mtf_nyquist", "", "response (ISO 12233) at half a cycle per pixel"),
    number("overshoot", "", "how far the edge leaves its levels, in parts of the contrast"),
    number("sigma_overshoot", "", "standard deviation of overshoot"),
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
        number("column_px", "px", "column of its middle; the centre of the first pixel is 0"),
        number("row_px", "px", "row of its middle"),
        number(
            "normal_deg",
            "deg",
            "direction across the edge to its bright side, from increasing columns to increasing rows",
        ),
        _direction("direction", DIRECTIONS, "along which of columns and rows it shows the resolution"),
        number("radius", "", "distance from the middle of the image in parts of half its diagonal"),
        number("length_px", "px", "length used"),
        number("contrast", "", "grey values from the dark to the bright side"),
        number("noise", "", "standard deviation of the pixels beside the edge, grey values"),
        number("blur_px", "px", "σ of the Gaussian that blurs it, beside the pixel itself"),
        number("sigma_blur_px", "px", "standard deviation of blur_px"),
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
        number("scatter", "", "standard deviation of the factor of an edge", nullable=True),
        number("stated", "", "the same as the adjustments of the edges state it"),
        number("blur_px", "px", "mean σ of the blur"),
        number("effective_gsd_m", "m", "factor times ground sampling distance", nullable=True),
        number("sigma_effective_gsd_m", "m", "its standard deviation", nullable=True),
        *_RESPONSE,
    ),
    ("band", "direction", "zone"),
)
EDGE_RESPONSES = TableSchema(
    "edge_responses",
    "Response of all edges of a band in one direction at a frequency.",
    (
        BAND,
        _direction("direction", DIRECTIONS, "of the edges"),
        number("frequency", "1/px", "spatial frequency"),
        number("response", "", "spatial frequency response in the manner of ISO 12233"),
    ),
    ("band", "direction", "frequency"),
)
NOISE_LEVELS = TableSchema(
    "noise_levels",
    "Noise of a band of an image in homogeneous areas of a grey level.",
    (
        IMAGE,
        BAND,
        number("level", "", "mean grey value"),
        number("noise", "", "standard deviation of the noise, grey values"),
        number("sigma_noise", "", "standard deviation of noise"),
        number("signal_to_noise", "", "level / noise"),
        count("tiles", "number of homogeneous areas of 16 × 16 pixels"),
    ),
    ("image", "band", "level"),
)
