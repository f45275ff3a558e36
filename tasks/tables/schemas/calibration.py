"""Tables of calibrations: orientations of two steps compared, and the platform of a virtual image."""

from __future__ import annotations

from tasks.tables.schemas.columns import CAMERA, IMAGE, Column, TableSchema, count, number, text

_COMPONENTS = (
    ("roll", "deg", "misalignment about the forward axis of the body"),
    ("pitch", "deg", "misalignment about the right axis"),
    ("yaw", "deg", "misalignment about the down axis"),
    ("forward", "m", "observed − adjusted position along the body: lever arm"),
    ("right", "m", "the same, to the right"),
    ("down", "m", "the same, downwards"),
    ("east", "m", "observed − adjusted position minus the given lever arm, true east: shift"),
    ("north", "m", "the same, true north"),
    ("up", "m", "the same, up"),
)

_ADJUSTED = ("roll", "pitch", "yaw", "east", "north", "up")

ORIENTATION_DIFFERENCES = TableSchema(
    "orientation_differences",
    "Differences between adjusted and observed orientation of an image: boresight and offset.",
    (
        IMAGE,
        CAMERA,
        text("strip", "strip, with its flight if there are several"),
        number("place", "time in seconds, or number of the exposure if no times are known"),
        number("heading_deg", "heading of the body, clockwise from true north"),
        number("height_m", "observed height in the project's height system"),
        count("mounting", "0: the mounting of most strips; 1, 2, …: others"),
        *(number(f"{name}_{unit}", meaning, unit) for name, unit, meaning in _COMPONENTS),
        *(
            number(f"weight_{name}", f"weight factor 0 … 1 of {name} in the robust mean of the mounting")
            for name, _, _ in _COMPONENTS
        ),
    ),
    ("image",),
)

ORIENTATION_DIFFERENCE_MEANS = TableSchema(
    "orientation_difference_means",
    "One component of the two-step calibration of a camera for a group of its images. A flight is "
    "represented by its images with the mounting of most of its strips; headings and heights refer "
    "to the main mounting.",
    (
        CAMERA,
        text(
            "scope",
            "type of the group",
            values=("all", "mounting", "flight", "heading", "height", "strip"),
        ),
        text(
            "group",
            "name of the group: mounting (0 is the main one: the result), flight, heading, height, strip",
        ),
        text("component", "see orientation_differences", values=tuple(name for name, _, _ in _COMPONENTS)),
        text("unit", "unit of value and of all following figures", values=("deg", "m")),
        number("value", "robust mean, as boresight angle, lever arm or shift"),
        number(
            "sigma",
            "its standard deviation, from the scatter of the strips and the errors of the "
            "adjustment; for a mounting or flight with fewer than five strips, not less than "
            "expected from that of the main mounting",
            nullable=True,
        ),
        number(
            "freedom",
            "degrees of freedom of sigma: a confidence limit is Student's quantile times sigma",
            nullable=True,
        ),
        number(
            "sigma_adjusted",
            "part of sigma due to the errors of the adjusted orientations and of the camera; null: "
            "unknown and not included in sigma",
            nullable=True,
        ),
        number("value_plain", "arithmetic mean", nullable=True),
        number("sigma_plain", "its standard deviation", nullable=True),
        number("rms", "of one exposure about the mean; for a strip, its standard deviation", nullable=True),
        number("between_strips", "standard deviation of the means of the strips", nullable=True),
        number("drift", "for a strip: change from its first to its last exposure", nullable=True),
        number("sigma_drift", "its standard deviation", nullable=True),
        Column(
            "outlying", "bool", "", "for a strip: whether the component is an outlier; null: not tested", True
        ),
        count("mounting", "of the images: 0 is the main one; null for `all`", nullable=True),
        count("images", "number of images"),
        count("strips", "number of strips"),
        number("heading_deg", "mean heading; not meaningful for several directions"),
        number("height_m", "median height in the project's height system"),
    ),
    ("camera", "scope", "group", "component"),
    version=3,
)

STRIP_ERRORS = TableSchema(
    "strip_errors",
    "Covariances of the mean errors of two strips of a camera in an adjustment on control alone.",
    (
        CAMERA,
        text("strip_a", "one strip, with its flight if there are several"),
        text("strip_b", "the same or another one"),
        text("component_a", "of the first strip", values=_ADJUSTED),
        text("component_b", "of the second strip", values=_ADJUSTED),
        number(
            "covariance", "products of degrees (roll, pitch, yaw) and metres (east, north, up)", "see meaning"
        ),
    ),
    ("camera", "strip_a", "strip_b", "component_a", "component_b"),
)


def _angles(pattern: str, meaning: str) -> tuple[Column, ...]:
    names = ("omega", "phi", "kappa")
    return tuple(number(pattern.format(name), meaning.format(name), "deg") for name in names)


def _of_axes(pattern: str, meaning: str) -> tuple[Column, ...]:
    return tuple(number(pattern.format(axis), f"{meaning}, {axis}", "um", nullable=True) for axis in "xy")


PLATFORM = TableSchema(
    "platform",
    "A head of a platform that takes no pictures itself: its attitude in the axes of the virtual image, "
    "rotation order omega, phi, kappa; the mean rotation of all heads against the given ones is zero.",
    (
        text("platform", "reference head that stands for the platform"),
        text("head", "camera"),
        *(number(f"{axis}_m", f"projection centre in the axes of the image, {axis}") for axis in "xyz"),
        *_angles("{}_deg", "calibrated {}"),
        *_angles("sigma_{}_deg", "standard deviation of {} in this datum"),
        *_angles("given_{}_deg", "given {}"),
        number("probability", "probability of as large a change of the head by chance"),
        number("correlation", "strongest correlation of one of its angles with one of another head"),
        text("correlated_with", "head of that angle"),
    ),
    ("platform", "head"),
)

VIRTUAL_IMAGE = TableSchema(
    "virtual_image",
    "A point of the virtual image composed for the mean flying height above ground: what is wrong there if "
    "the given attitudes are used instead of the calibrated ones, and how well those determine it.",
    (
        text("platform", "reference head that stands for the platform"),
        number("x_mm", "place in the virtual image, along the columns"),
        number("y_mm", "place in the virtual image, against the rows"),
        text("head", "head that fills it; null: none", nullable=True),
        *(
            number(
                f"head_{axis}_mm",
                f"ideal image coordinate of the point in this head, {axis}, with the calibrated attitudes",
                nullable=True,
            )
            for axis in "xy"
        ),
        *_of_axes("d{}_um", "image error with the given attitudes"),
        *_of_axes("sigma_{}_um", "standard deviation from the calibrated attitudes"),
        *_of_axes("seam_{}_um", "displacement of ground that is a tenth nearer"),
        number(
            "correlation", "correlation of the errors along x and y (sigma_x_um, sigma_y_um)", nullable=True
        ),
        text("next_head", "second head that covers the point; null: none", nullable=True),
        *_of_axes(
            "sigma_step_{}_um",
            "standard deviation of the step between both heads, from the joint covariance of their attitudes",
        ),
        number("correlation_step", "correlation of the step along x and y", nullable=True),
    ),
    ("platform", "x_mm", "y_mm"),
)
