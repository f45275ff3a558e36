"""Tables of the calibration of a platform whose heads' pictures are composed to a virtual image."""

from __future__ import annotations

from tasks.tables.schemas.columns import Column, TableSchema, number, text


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
