"""Tables of an adjusted block: orientations, object points, residuals, differences at surveyed points."""

from __future__ import annotations

from itertools import combinations

from tasks.tables.schemas.columns import (
    IMAGE,
    OPK,
    OTHER_POINT,
    POINT,
    XYZ,
    XYZ_M,
    Column,
    TableSchema,
    count,
    number,
    position,
    sigmas,
    text,
)

EXTERIOR_ORIENTATIONS = TableSchema(
    "exterior_orientations",
    "Adjusted orientation of an image.",
    (
        IMAGE,
        *position("projection centre"),
        *OPK,
        *sigmas(XYZ, "m"),
        *sigmas(("omega", "phi", "kappa"), "deg"),
        # With them the covariance of the six elements is complete.
        *(
            number(f"correlation_{one}_{other}", f"correlation of {one} and {other}", nullable=True)
            for one, other in combinations(("x", "y", "z", "omega", "phi", "kappa"), 2)
        ),
    ),
    ("image",),
    XYZ_M,
)

_OPK_NAMES = ("omega", "phi", "kappa")

NEIGHBOURING_IMAGES = TableSchema(
    "neighbouring_images",
    "Two images that follow each other in a strip and share an object point: how their errors hang together.",
    (
        IMAGE,
        text("next_image", "the next image of the strip"),
        *(number(f"rho_{name}", f"correlation of {name} of both") for name in (*XYZ, *_OPK_NAMES)),
        *(number(f"sigma_d{name}_m", f"standard deviation of the difference in {name}") for name in XYZ),
        *(
            number(f"sigma_d{name}_deg", f"standard deviation of the difference in {name}")
            for name in _OPK_NAMES
        ),
    ),
    ("image", "next_image"),
)

OBJECT_POINTS = TableSchema(
    "object_points",
    "Adjusted object point.",
    (POINT, *position("point"), *sigmas(XYZ, "m"), count("rays", "number of image points used")),
    ("point",),
    XYZ_M,
)

RESIDUALS = TableSchema(
    "residuals",
    "One component of an observation after the adjustment.",
    (
        text("group", "observation group"),
        text("image", "image, null where it does not apply", nullable=True),
        text("point", "point, null where it does not apply", nullable=True),
        text("component", "component of the observation: x, y, z or roll, pitch, yaw, or a parameter"),
        number("residual", "adjusted minus observed; null if not used", "see unit", nullable=True),
        number("sigma", "a-priori standard deviation of the observation", "see unit"),
        text("unit", "unit of residual, sigma and mdb: um, m or deg"),
        number("redundancy", "redundancy number, 0 to 1", nullable=True),
        number("standardized", "residual divided by its standard deviation", nullable=True),
        number("mdb", "minimal detectable bias", "see unit", nullable=True),
        number(
            "external",
            "external reliability: largest effect on any result of an undetected error of that size, "
            "in standard deviations of that result",
            nullable=True,
        ),
        text("status", "use of the observation", values=("used", "rejected", "uncontrolled", "not_used")),
    ),
    ("group", "image", "point", "component"),
)

_WAYS = (("dx", "east"), ("dy", "north"), ("dz", "up"))


def _differences(name: str, meaning: str, further: tuple[Column, ...] = ()) -> TableSchema:
    return TableSchema(
        name,
        meaning,
        (
            POINT,
            *(number(f"{d}_m", f"computed − given, {way}", nullable=True) for d, way in _WAYS),
            *(
                number(f"sigma_{d}_m", f"predicted standard deviation, {way}", nullable=True)
                for d, way in _WAYS
            ),
            count("rays", "number of image points used"),
            *further,
        ),
        ("point",),
    )


CONTROL_RESIDUALS = _differences(
    "control_residuals",
    "Adjusted minus given coordinates of a control point, in the adjustment and in the one without it.",
    (
        text("status", "whether it was rejected as a gross error", values=("used", "rejected")),
        *(
            number(
                f"loo_{d}_m",
                f"computed by the adjustment without the point − given, {way}; null if no other "
                "observation determines it",
                nullable=True,
            )
            for d, way in _WAYS
        ),
        *(
            number(
                f"sigma_loo_{d}_m",
                f"predicted standard deviation of loo_{d}_m, with that of the survey",
                nullable=True,
            )
            for d, way in _WAYS
        ),
    ),
)

CHECK_POINTS = _differences("check_points", "Adjusted minus given coordinates of a check point.")

DISTANCE_RESIDUALS = TableSchema(
    "distance_residuals",
    "Adjusted minus given distance between two object points.",
    (
        POINT,
        OTHER_POINT,
        number("distance_m", "the given distance"),
        number("difference_m", "computed − given"),
        number("sigma_difference_m", "its predicted standard deviation; of a check distance with its own"),
        text("status", "use of the observation", values=("used", "rejected", "check")),
    ),
    ("point", "other_point"),
)
