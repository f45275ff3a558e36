"""The Parquet contracts: every table's columns with type, unit and meaning, and its key.

The key is also the sort order. Names and meanings of published tables are a contract: they are extended,
never renamed. A number that does not exist is null, never zero or NaN.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

ColumnType = Literal["string", "float64", "int32", "int64", "bool"]


@dataclass(frozen=True)
class Column:
    """One column of a table.

    Attributes
    ----------
    name : its name; a unit that is not fixed by the table stands at its end.
    type : the Arrow type.
    unit : unit as text, empty for names and counts.
    meaning : one sentence.
    nullable : whether it may be null.
    values : the texts it may hold; empty: any.
    """

    name: str
    type: ColumnType
    unit: str
    meaning: str
    nullable: bool = False
    values: tuple[str, ...] = ()


@dataclass(frozen=True)
class TableSchema:
    """One table of the contract.

    Attributes
    ----------
    name : the artifact's name.
    meaning : what a row is.
    columns : in their order.
    key : columns that identify a row, and the sort order.
    coordinates : columns that are x, y, z in the table's CRS and become its geometry; empty: none.
    version : raised when a column changes its meaning.
    """

    name: str
    meaning: str
    columns: tuple[Column, ...]
    key: tuple[str, ...]
    coordinates: tuple[str, ...] = ()
    version: int = 1

    def column(self, name: str) -> Column:
        """The column of this name.

        Raises
        ------
        KeyError
            If there is none.
        """
        for column in self.columns:
            if column.name == name:
                return column
        raise KeyError(name)


def _text(name: str, meaning: str, *, nullable: bool = False, values: tuple[str, ...] = ()) -> Column:
    return Column(name, "string", "", meaning, nullable, values)


def _number(name: str, unit: str, meaning: str, *, nullable: bool = False) -> Column:
    return Column(name, "float64", unit, meaning, nullable)


def _count(name: str, meaning: str) -> Column:
    return Column(name, "int32", "", meaning)


def _position(of: str, *, nullable: bool = False) -> tuple[Column, ...]:
    directions = (("x", "east"), ("y", "north"), ("z", "height"))
    return tuple(
        _number(f"{axis}_m", "m", f"{of}: {way} in the table's CRS", nullable=nullable)
        for axis, way in directions
    )


def _sigmas(names: tuple[str, ...], unit: str, *, nullable: bool = False) -> tuple[Column, ...]:
    return tuple(
        _number(f"sigma_{name}_{unit}", unit, f"standard deviation of {name}_{unit}", nullable=nullable)
        for name in names
    )


_XYZ = ("x", "y", "z")
_XYZ_M = ("x_m", "y_m", "z_m")
_IMAGE = _text("image", "image name, verbatim")
_POINT = _text("point", "point name, verbatim")
_CAMERA = _text("camera", "camera name of the project file")
_STRIP = _text("strip", "strip, null if not known", nullable=True)
_FLIGHT = _text("flight", "flight, null if not known", nullable=True)

_OPK = tuple(
    _number(f"{name}_deg", "deg", f"{name} of R = R_x(ω) R_y(φ) R_z(κ), grid axes of the CRS from camera")
    for name in ("omega", "phi", "kappa")
)
_OPTIONAL_ANGLES = tuple(
    _number(f"{name}_deg", "deg", meaning, nullable=True)
    for name, meaning in (
        (
            "omega",
            "ω of R = R_x(ω) R_y(φ) R_z(κ), grid axes of the CRS from camera; null if the input is heading",
        ),
        ("phi", "φ of the same"),
        ("kappa", "κ of the same"),
        ("heading", "heading of the body, clockwise from true north; null if the input is ω, φ, κ"),
        ("pitch", "pitch of the body, nose up positive"),
        ("roll", "roll of the body, right wing down positive"),
    )
)

CAMERAS = TableSchema(
    "cameras",
    "A camera as certified and mounted.",
    (
        _CAMERA,
        _count("columns", "width of the image in pixels"),
        _count("rows", "height of the image in pixels"),
        _number("pixel_um", "um", "side of a pixel"),
        _number("focal_length_mm", "mm", "principal distance"),
        _number("principal_point_x_mm", "mm", "principal point from the format centre, along columns"),
        _number("principal_point_y_mm", "mm", "principal point from the format centre, against rows"),
        _text(
            "pixel_origin",
            "point of the top-left pixel with pixel coordinates (0, 0)",
            values=("corner", "centre"),
        ),
        _count("mount_deg", "κ_mount of the nominal mounting diag(1, −1, −1) R_z(κ_mount), body from camera"),
        *(
            _number(f"lever_arm_{axis}_m", "m", f"given lever arm in body axes, {way}")
            for axis, way in (("x", "forward"), ("y", "right"), ("z", "down"))
        ),
        *(
            _number(f"boresight_{name}_deg", "deg", f"given boresight misalignment, {name}")
            for name in ("roll", "pitch", "yaw")
        ),
    ),
    ("camera",),
)

IMAGES = TableSchema(
    "images",
    "An image of the block.",
    (
        _IMAGE,
        _CAMERA,
        _STRIP,
        _FLIGHT,
        _number("heading_deg", "deg", "direction of flight clockwise from true north", nullable=True),
        _number(
            "height_above_ground_m", "m", "flying height above the object points in the image", nullable=True
        ),
        _text("status", "whether the image takes part in the adjustment, or why not"),
    ),
    ("image",),
)

IMAGE_POINTS = TableSchema(
    "image_points",
    "A measured image point.",
    (
        _IMAGE,
        _POINT,
        _number("x_mm", "mm", "x in the image system: from the format centre along columns"),
        _number("y_mm", "mm", "y in the image system: from the format centre against rows"),
        _number("sigma_x_mm", "mm", "standard deviation of x_mm"),
        _number("sigma_y_mm", "mm", "standard deviation of y_mm"),
    ),
    ("image", "point"),
)

EXPOSURES = TableSchema(
    "exposures",
    "GNSS/INS or given orientation of an image, in the CRS of the project.",
    (
        _IMAGE,
        _CAMERA,
        _STRIP,
        _FLIGHT,
        _number("time_s", "s", "time on the scale of the delivery", nullable=True),
        *_position("position"),
        *_sigmas(_XYZ, "m"),
        *_OPTIONAL_ANGLES,
        *_sigmas(("omega", "phi", "kappa", "heading", "pitch", "roll"), "deg", nullable=True),
        _text("position", "what the position is of", values=("projection_centre", "antenna", "imu")),
    ),
    ("image",),
    _XYZ_M,
)

CONTROL_POINTS = TableSchema(
    "control_points",
    "A surveyed point in the CRS of the project; a null coordinate is not known.",
    (
        _POINT,
        *_position("point", nullable=True),
        *_sigmas(_XYZ, "m", nullable=True),
        _text("role", "a check point's coordinates never enter an adjustment", values=("control", "check")),
    ),
    ("point",),
    _XYZ_M,
)

APPROXIMATE_POINTS = TableSchema(
    "approximate_points",
    "An object point intersected from the given orientations.",
    (
        _POINT,
        *_position("point", nullable=True),
        _count("rays", "number of image points"),
        _number("angle_deg", "deg", "largest angle between two rays", nullable=True),
        _text("status", "whether the point takes part in the adjustment, or why not"),
    ),
    ("point",),
    _XYZ_M,
)

EXTERIOR_ORIENTATIONS = TableSchema(
    "exterior_orientations",
    "Adjusted orientation of an image.",
    (
        _IMAGE,
        *_position("projection centre"),
        *_OPK,
        *_sigmas(_XYZ, "m"),
        *_sigmas(("omega", "phi", "kappa"), "deg"),
    ),
    ("image",),
    _XYZ_M,
)

OBJECT_POINTS = TableSchema(
    "object_points",
    "Adjusted object point.",
    (_POINT, *_position("point"), *_sigmas(_XYZ, "m"), _count("rays", "number of image points used")),
    ("point",),
    _XYZ_M,
)

RESIDUALS = TableSchema(
    "residuals",
    "One component of an observation after the adjustment.",
    (
        _text("group", "observation group"),
        _text("image", "image, null where it does not apply", nullable=True),
        _text("point", "point, null where it does not apply", nullable=True),
        _text("component", "component of the observation: x, y, z or roll, pitch, yaw, or a parameter"),
        _number("residual", "see unit", "adjusted minus observed; null if it never entered", nullable=True),
        _number("sigma", "see unit", "a-priori standard deviation of the observation"),
        _text("unit", "unit of residual, sigma and mdb: um, m or deg"),
        _number("redundancy", "", "redundancy number, 0 to 1", nullable=True),
        _number("standardized", "", "residual over its own standard deviation", nullable=True),
        _number("mdb", "see unit", "minimal detectable bias", nullable=True),
        _number(
            "external",
            "",
            "external reliability: by how many of its standard deviations an undetected error of that size "
            "moves any result at most",
            nullable=True,
        ),
        _text("status", "what became of it", values=("used", "rejected", "uncontrolled", "not_used")),
    ),
    ("group", "image", "point", "component"),
)

PARAMETERS = TableSchema(
    "parameters",
    "A system parameter.",
    (
        _text("parameter", "name, e.g. boresight_roll"),
        _text("entity", "camera, flight or strip it belongs to"),
        _number("value", "see unit", "adjusted value"),
        _number("change", "see unit", "adjusted minus initial value"),
        _number("sigma", "see unit", "standard deviation", nullable=True),
        _number("sigma_prior", "see unit", "standard deviation of the given initial value", nullable=True),
        _text("unit", "unit of value, change and the sigmas"),
        _number("t", "", "change over its standard deviation", nullable=True),
        _text(
            "status",
            "what can be said about it",
            values=(
                "significant",
                "not_significant",
                "eliminated",
                "fixed",
                "prior_only",
                "not_determinable",
            ),
        ),
    ),
    ("parameter", "entity"),
)

CORRELATIONS = TableSchema(
    "correlations",
    "Correlation of two system parameters.",
    (
        _text("parameter_a", "name of the first"),
        _text("entity_a", "entity of the first"),
        _text("parameter_b", "name of the second"),
        _text("entity_b", "entity of the second"),
        _number("correlation", "", "coefficient, −1 to 1"),
    ),
    ("parameter_a", "entity_a", "parameter_b", "entity_b"),
)


def _differences(name: str, meaning: str) -> TableSchema:
    ways = (("dx", "east"), ("dy", "north"), ("dz", "up"))
    return TableSchema(
        name,
        meaning,
        (
            _POINT,
            *(_number(f"{d}_m", "m", f"computed − given, {way}", nullable=True) for d, way in ways),
            *(
                _number(f"sigma_{d}_m", "m", f"predicted standard deviation, {way}", nullable=True)
                for d, way in ways
            ),
            _count("rays", "number of image points used"),
        ),
        ("point",),
    )


CONTROL_RESIDUALS = _differences("control_residuals", "Adjusted minus given coordinates of a control point.")
CHECK_POINTS = _differences("check_points", "Adjusted minus given coordinates of a check point.")

SCHEMAS: dict[str, TableSchema] = {
    schema.name: schema
    for schema in (
        CAMERAS,
        IMAGES,
        IMAGE_POINTS,
        EXPOSURES,
        CONTROL_POINTS,
        APPROXIMATE_POINTS,
        EXTERIOR_ORIENTATIONS,
        OBJECT_POINTS,
        RESIDUALS,
        PARAMETERS,
        CORRELATIONS,
        CONTROL_RESIDUALS,
        CHECK_POINTS,
    )
}
