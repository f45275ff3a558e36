"""Tables of a direct-georeferencing check: differences at surveyed points, y-parallaxes, stereo models."""

from __future__ import annotations

from tasks.tables.schemas.columns import (
    FLIGHT,
    POINT,
    STRIP,
    XYZ_M,
    Column,
    TableSchema,
    count,
    number,
    position,
    text,
)

_INTERSECTED = (("dx", "east"), ("dy", "north"), ("dz", "up"))

_CONTROL_OF_CALIBRATION = ("independent", "control_of_calibration")


def _direct_differences(point: tuple[Column, ...]) -> tuple[Column, ...]:
    """Differences at a surveyed point, after its key."""
    return (
        *point,
        *(number(f"{d}_m", f"intersected − given, {way}", nullable=True) for d, way in _INTERSECTED),
        *(
            number(
                f"sigma_{d}_m",
                f"predicted standard deviation, {way}: image points, GNSS/INS, strips, calibration, survey",
                nullable=True,
            )
            for d, way in _INTERSECTED
        ),
        number("gsd_m", "ground sampling distance, median of its images"),
        count("rays", "number of image points"),
        text(
            "status",
            "whether the point was control when the calibration was made",
            values=_CONTROL_OF_CALIBRATION,
        ),
    )


_LEFT = text("left", "first image of the model in the order of flight")

_RIGHT = text("right", "second image of the model")

DIRECT_GEOREFERENCING = TableSchema(
    "direct_georeferencing",
    "A surveyed point intersected from all its directly georeferenced images.",
    _direct_differences((POINT, *position("intersection"))),
    ("point",),
    XYZ_M,
)

DIRECT_GEOREFERENCING_MODELS = TableSchema(
    "direct_georeferencing_models",
    "A surveyed point intersected from the two images of a stereo model.",
    _direct_differences((_LEFT, _RIGHT, POINT)),
    ("left", "right", "point"),
)

Y_PARALLAXES = TableSchema(
    "y_parallaxes",
    "y-parallax of a point in a stereo model of directly georeferenced images.",
    (
        _LEFT,
        _RIGHT,
        POINT,
        number("parallax_um", "y of the left ray minus y of the right ray in the base frame"),
        number("sigma_um", "predicted standard deviation from all sources"),
        number("sigma_image_um", "the part due to the image coordinates"),
        number(
            "remaining_um",
            "parallax remaining after a relative orientation of the model; null if there are too few points",
            nullable=True,
        ),
        text(
            "status",
            "whether the point fits the relative orientation of its model",
            values=("used", "mismatch"),
        ),
    ),
    ("left", "right", "point"),
)

STEREO_MODELS = TableSchema(
    "stereo_models",
    "Two consecutive images of a strip.",
    (
        _LEFT,
        _RIGHT,
        STRIP,
        FLIGHT,
        *position("middle of the two projection centres"),
        number("base_m", "distance of the projection centres"),
        count("points", "common points that fit the relative orientation"),
        count("mismatches", "common points that do not fit"),
        number("rms_um", "root mean square of the y-parallaxes", nullable=True),
        number("max_um", "largest size of a y-parallax", nullable=True),
        number("predicted_rms_um", "root mean square predicted from all sources", nullable=True),
        number("remaining_rms_um", "root mean square after the relative orientation", nullable=True),
    ),
    ("left", "right"),
    XYZ_M,
)
