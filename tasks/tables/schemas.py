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


def _count(name: str, meaning: str, *, nullable: bool = False) -> Column:
    return Column(name, "int32", "", meaning, nullable)


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
        _count(
            "calibration_axes_deg",
            "turn from the image axes to those of additional parameters, counter-clockwise",
        ),
        _text(
            "tiles", "layout of the CCD images as JSON, mm; null: that of the parameter set", nullable=True
        ),
        _text(
            "additional_parameters", "known additional parameters as JSON, SET:NAME to value in its own unit"
        ),
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

SELF_CALIBRATION = TableSchema(
    "self_calibration",
    "An additional parameter that was offered to the adjustment, and what was decided about it.",
    (
        _text("parameter", "name SET:NAME"),
        _text("entity", "camera, or camera and flight, it belongs to"),
        _text("meaning", "what it models"),
        _text("formula", "where its formula comes from", values=("published", "reconstructed")),
        _text("unit", "unit of the values and their sigmas"),
        _number("value", "see unit", "adjusted value; null if eliminated", nullable=True),
        _number("sigma", "see unit", "standard deviation; null if eliminated", nullable=True),
        _number("t", "", "change over its standard deviation; null if eliminated", nullable=True),
        _number("value_of_all", "see unit", "change with all parameters together", nullable=True),
        _number("sigma_of_all", "see unit", "standard deviation with all parameters together", nullable=True),
        _number("t_of_all", "", "change over its standard deviation with all together", nullable=True),
        _number("strongest_correlation", "", "strongest correlation with all together", nullable=True),
        _text("correlated_with", "the parameter with which", nullable=True),
        _number("total_correlation", "", "correlation with all other free system parameters", nullable=True),
        _number("effect_max_um", "um", "largest correction in the image"),
        _number("effect_rms_um", "um", "root mean square of the correction over the image"),
        _text("decision", "the last word", values=("is significant", "is eliminated", "is kept")),
        _count("step", "number of the last decision about it, 0 without a selection"),
        _text("reason", "why"),
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


_WAYS = (("dx", "east"), ("dy", "north"), ("dz", "up"))


def _differences(name: str, meaning: str, further: tuple[Column, ...] = ()) -> TableSchema:
    return TableSchema(
        name,
        meaning,
        (
            _POINT,
            *(_number(f"{d}_m", "m", f"computed − given, {way}", nullable=True) for d, way in _WAYS),
            *(
                _number(f"sigma_{d}_m", "m", f"predicted standard deviation, {way}", nullable=True)
                for d, way in _WAYS
            ),
            _count("rays", "number of image points used"),
            *further,
        ),
        ("point",),
    )


CONTROL_RESIDUALS = _differences(
    "control_residuals",
    "Adjusted minus given coordinates of a control point, in the adjustment and in the one without it.",
    (
        *(
            _number(
                f"loo_{d}_m",
                "m",
                f"computed by the adjustment without the point − given, {way}; null if nothing else "
                "determines it",
                nullable=True,
            )
            for d, way in _WAYS
        ),
        *(
            _number(
                f"sigma_loo_{d}_m",
                "m",
                f"predicted standard deviation of loo_{d}_m, with that of the survey",
                nullable=True,
            )
            for d, way in _WAYS
        ),
    ),
)
CHECK_POINTS = _differences("check_points", "Adjusted minus given coordinates of a check point.")


def _each_axis(pattern: str, unit: str, meaning: str) -> tuple[Column, ...]:
    return tuple(_number(pattern.format(axis), unit, f"{meaning}, {axis}", nullable=True) for axis in _XYZ)


SWEEP = TableSchema(
    "sweep",
    "A scenario of a sweep: a sub-block, a choice of control points, a variant of the settings. Where it "
    "could not be computed there are no figures.",
    (
        _text("block", "sub-block"),
        _text("control", "choice of control points"),
        _text("variant", "variant of the settings"),
        _count("number", "place in the order of the project file, from 1"),
        _text("changes", "settings the variant changes, as JSON"),
        _text("status", "whether it was computed", values=("done", "not_computable", "input_error")),
        _text("reason", "why it was not", nullable=True),
        _number("sigma0", "", "σ0 a posteriori / a priori", nullable=True),
        _number("sigma0_um", "um", "σ0 of an image coordinate", nullable=True),
        _number(
            "sigma0_ratio",
            "",
            "σ0 over that of the first variant with the same sub-block and control points",
            nullable=True,
        ),
        _number("redundancy", "", "observations minus unknowns", nullable=True),
        _count("iterations", "iterations", nullable=True),
        _count("images", "images", nullable=True),
        _count("object_points", "object points", nullable=True),
        _count("image_points", "image points used", nullable=True),
        _count("rejected", "rejected observations", nullable=True),
        _count("control_points", "control points that took part", nullable=True),
        _count("check_points", "check points that took part", nullable=True),
        _count("parameters_offered", "additional parameters offered", nullable=True),
        _count("parameters_kept", "additional parameters estimated in the end", nullable=True),
        _count("parameters_significant", "additional parameters that are significant", nullable=True),
        _number("gsd_m", "m", "ground sampling distance, median of the images", nullable=True),
        *(
            _number(f"image_rms_{axis}_um", "um", f"RMS of the image residuals, {axis}", nullable=True)
            for axis in ("x", "y")
        ),
        _count("cells", "sub-areas of the images with a mean residual, all cameras", nullable=True),
        _count("cells_significant", "of them significant", nullable=True),
        _number("cells_by_chance", "", "significant ones that chance alone makes expect", nullable=True),
        *(
            _number(
                f"systematic_{axis}_um",
                "um",
                f"RMS of the mean residuals without what chance gives, {axis}",
                nullable=True,
            )
            for axis in ("x", "y")
        ),
        *_each_axis("rmse_control_{}_m", "m", "RMS of the differences at the control points"),
        *_each_axis("max_control_{}_m", "m", "largest difference at a control point"),
        *_each_axis("rmse_check_{}_m", "m", "RMS of the differences at the check points"),
        *_each_axis("max_check_{}_m", "m", "largest difference at a check point"),
        *_each_axis(
            "predicted_check_{}_m", "m", "RMS of the predicted σ of the differences at the check points"
        ),
    ),
    ("block", "control", "variant"),
)

_COMPONENTS = (
    ("roll", "deg", "misalignment about the forward axis of the body"),
    ("pitch", "deg", "misalignment about the right axis"),
    ("yaw", "deg", "misalignment about the down axis"),
    ("forward", "m", "observed − adjusted position along the body: lever arm"),
    ("right", "m", "the same, to the right"),
    ("down", "m", "the same, downwards"),
    ("east", "m", "observed − adjusted position, true east: shift"),
    ("north", "m", "the same, true north"),
    ("up", "m", "the same, up"),
)
ORIENTATION_DIFFERENCES = TableSchema(
    "orientation_differences",
    "What the adjusted and the observed orientation of an image say about boresight and offset.",
    (
        _IMAGE,
        _CAMERA,
        _text("strip", "strip, with its flight if there are several"),
        _number("place", "", "time in seconds, or number of the exposure if no times are known"),
        _number("heading_deg", "deg", "heading of the body, clockwise from true north"),
        _number("height_m", "m", "observed height in the project's height system"),
        _count("mounting", "0: the mounting of most strips; 1, 2, …: others"),
        *(_number(f"{name}_{unit}", unit, meaning) for name, unit, meaning in _COMPONENTS),
        *(
            _number(f"weight_{name}", "", f"factor 0 … 1 of {name} in the robust mean of the mounting")
            for name, _, _ in _COMPONENTS
        ),
    ),
    ("image",),
)
ORIENTATION_DIFFERENCE_MEANS = TableSchema(
    "orientation_difference_means",
    "One component of the two-step calibration of a camera for a group of its images. Flights, headings and "
    "heights are those of the main mounting.",
    (
        _CAMERA,
        _text(
            "scope",
            "what makes the group",
            values=("all", "mounting", "flight", "heading", "height", "strip"),
        ),
        _text("group", "which one: mounting (0 is the main one: the result), flight, heading, height, strip"),
        _text("component", "see orientation_differences", values=tuple(name for name, _, _ in _COMPONENTS)),
        _text("unit", "unit of value and of all that follow it", values=("deg", "m")),
        _number("value", "", "robust mean, as boresight angle, lever arm or shift"),
        _number("sigma", "", "its standard deviation, from the scatter of the strips", nullable=True),
        _number("value_plain", "", "arithmetic mean", nullable=True),
        _number("sigma_plain", "", "its standard deviation", nullable=True),
        _number(
            "rms", "", "of one exposure about the mean; of a strip its standard deviation", nullable=True
        ),
        _number("between_strips", "", "standard deviation of the means of the strips", nullable=True),
        _number("drift", "", "of a strip: change from its first to its last exposure", nullable=True),
        _number("sigma_drift", "", "its standard deviation", nullable=True),
        Column(
            "outlying", "bool", "", "of a strip: whether the component stands out; null: not tested", True
        ),
        _count("mounting", "of a strip: its mounting", nullable=True),
        _count("images", "number of images"),
        _count("strips", "number of strips"),
        _number("heading_deg", "deg", "mean heading; has little meaning over several directions"),
        _number("height_m", "m", "median height in the project's height system"),
    ),
    ("camera", "scope", "group", "component"),
)

RESIDUAL_GRID = TableSchema(
    "residual_grid",
    "Mean residual of all images of a camera in a sub-area of the image, after the adjustment.",
    (
        _CAMERA,
        _count("column", "number of the sub-area along x, from 0"),
        _count("row", "number of the sub-area along y, from 0"),
        _number("x_mm", "mm", "middle of the sub-area in the image system"),
        _number("y_mm", "mm", "middle of the sub-area in the image system"),
        _number("width_mm", "mm", "extent along x"),
        _number("height_mm", "mm", "extent along y"),
        _count("tile_x", "number along x of the CCD image it lies in, 0 where there is only one"),
        _count("tile_y", "number along y of the CCD image it lies in, 0 where there is only one"),
        _count("count", "number of image points, the larger of count_vx and count_vy"),
        _count("count_vx", "number of residuals in x with redundancy numbers above 0.2"),
        _count("count_vy", "number of residuals in y with redundancy numbers above 0.2"),
        *(
            _number(
                f"mean_v{axis}_um",
                "um",
                f"mean residual in {axis} (adjusted − observed, what would have to be added to "
                "measurements); null for fewer than 5 residuals",
                nullable=True,
            )
            for axis in "xy"
        ),
        _number(
            "sigma",
            "um",
            "standard deviation of the mean residual, root mean square of x and y",
            nullable=True,
        ),
        *(
            _number(
                f"sigma_v{axis}_um",
                "um",
                f"standard deviation of mean_v{axis}_um from the scatter of the residuals in the sub-area",
                nullable=True,
            )
            for axis in "xy"
        ),
        _number(
            "p_value", "", "probability of a mean vector as long as this by chance (Hotelling)", nullable=True
        ),
        Column(
            "significant",
            "bool",
            "",
            "whether the mean vector differs from zero at the project's confidence, each sub-area tested by "
            "itself",
        ),
        *(
            _number(
                f"correction_{axis}_um",
                "um",
                f"what was added to measured {axis} before this adjustment; null where nothing was corrected",
                nullable=True,
            )
            for axis in "xy"
        ),
    ),
    ("camera", "column", "row"),
)

RESIDUAL_AUTOCORRELATION = TableSchema(
    "residual_autocorrelation",
    "Correlation of the residuals of image points of the same image, by their distance.",
    (
        _CAMERA,
        _text("component", "component of the residuals", values=("x", "y")),
        _number("distance_to_mm", "mm", "upper limit of the distance"),
        _number("distance_from_mm", "mm", "lower limit of the distance"),
        Column("pairs", "int64", "", "number of pairs; large blocks are sampled"),
        _number("correlation", "", "coefficient; null without pairs", nullable=True),
        _number(
            "limit",
            "",
            "what white noise hardly exceeds: 3/√pairs, and 6 over the number of image points in an image "
            "for what its orientation takes",
            nullable=True,
        ),
        Column("correlated", "bool", "", "whether the coefficient is beyond the limit"),
        _number(
            "sigma_relative_um",
            "um",
            "standard deviation of coordinate differences at this distance",
            nullable=True,
        ),
    ),
    ("camera", "component", "distance_to_mm"),
)

_INTERSECTED = (("dx", "east"), ("dy", "north"), ("dz", "up"))
_CONTROL_OF_CALIBRATION = ("independent", "control_of_calibration")


def _direct_differences(point: tuple[Column, ...]) -> tuple[Column, ...]:
    """Differences at a surveyed point, after its key."""
    return (
        *point,
        *(_number(f"{d}_m", "m", f"intersected − given, {way}", nullable=True) for d, way in _INTERSECTED),
        *(
            _number(
                f"sigma_{d}_m",
                "m",
                f"predicted standard deviation, {way}: image points, GNSS/INS, strips, calibration, survey",
                nullable=True,
            )
            for d, way in _INTERSECTED
        ),
        _number("gsd_m", "m", "ground sampling distance, median of its images"),
        _count("rays", "number of image points"),
        _text(
            "status",
            "whether the point was control when the calibration was made",
            values=_CONTROL_OF_CALIBRATION,
        ),
    )


_LEFT = _text("left", "first image of the model in the order of flight")
_RIGHT = _text("right", "second image of the model")

DIRECT_GEOREFERENCING = TableSchema(
    "direct_georeferencing",
    "A surveyed point intersected from all its directly georeferenced images.",
    _direct_differences((_POINT, *_position("intersection"))),
    ("point",),
    _XYZ_M,
)

DIRECT_GEOREFERENCING_MODELS = TableSchema(
    "direct_georeferencing_models",
    "A surveyed point intersected from the two images of a stereo model.",
    _direct_differences((_LEFT, _RIGHT, _POINT)),
    ("left", "right", "point"),
)

Y_PARALLAXES = TableSchema(
    "y_parallaxes",
    "y-parallax of a point in a stereo model of directly georeferenced images.",
    (
        _LEFT,
        _RIGHT,
        _POINT,
        _number("parallax_um", "um", "y of the left ray minus y of the right ray in the base frame"),
        _number("sigma_um", "um", "predicted standard deviation from all sources"),
        _number("sigma_image_um", "um", "the part of it that comes from the image coordinates"),
        _number(
            "remaining_um",
            "um",
            "what is left after a relative orientation of the model; null with too few points",
            nullable=True,
        ),
        _text(
            "status",
            "whether the point follows the relative orientation of its model",
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
        _STRIP,
        _FLIGHT,
        *_position("middle of the two projection centres"),
        _number("base_m", "m", "distance of the projection centres"),
        _count("points", "common points that follow the relative orientation"),
        _count("mismatches", "common points that do not"),
        _number("rms_um", "um", "root mean square of the y-parallaxes", nullable=True),
        _number("max_um", "um", "largest size of a y-parallax", nullable=True),
        _number("predicted_rms_um", "um", "root mean square predicted from all sources", nullable=True),
        _number("remaining_rms_um", "um", "root mean square after the relative orientation", nullable=True),
    ),
    ("left", "right"),
    _XYZ_M,
)

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
        SELF_CALIBRATION,
        CORRELATIONS,
        CONTROL_RESIDUALS,
        CHECK_POINTS,
        ORIENTATION_DIFFERENCES,
        ORIENTATION_DIFFERENCE_MEANS,
        SWEEP,
        RESIDUAL_GRID,
        RESIDUAL_AUTOCORRELATION,
        DIRECT_GEOREFERENCING,
        DIRECT_GEOREFERENCING_MODELS,
        Y_PARALLAXES,
        STEREO_MODELS,
    )
}
