"""The table of a sweep: one row for each scenario."""

from __future__ import annotations

from tasks.tables.schemas.columns import XYZ, Column, TableSchema, count, number, text


def _each_axis(pattern: str, unit: str, meaning: str) -> tuple[Column, ...]:
    return tuple(number(pattern.format(axis), f"{meaning}, {axis}", unit, nullable=True) for axis in XYZ)


SWEEP = TableSchema(
    "sweep",
    "A scenario of a sweep: a sub-block, a choice of control points, a variant of the settings. If "
    "it could not be computed, there are no figures.",
    (
        text("block", "sub-block"),
        text("control", "choice of control points"),
        text("variant", "variant of the settings"),
        count("number", "position in the project file, from 1"),
        text("changes", "settings the variant changes, as JSON"),
        text("status", "whether it was computed", values=("done", "not_computable", "input_error")),
        text("reason", "reason if not computed", nullable=True),
        number("sigma0", "σ0 a posteriori / a priori", nullable=True),
        number("sigma0_um", "σ0 of an image coordinate", nullable=True),
        number(
            "sigma0_ratio",
            "σ0 divided by that of the first variant with the same sub-block and control points",
            nullable=True,
        ),
        number("redundancy", "observations minus unknowns", nullable=True),
        count("iterations", "iterations", nullable=True),
        count("images", "images", nullable=True),
        count("object_points", "object points", nullable=True),
        count("image_points", "image points used", nullable=True),
        count("rejected", "rejected observations", nullable=True),
        count("control_points", "control points used", nullable=True),
        count("check_points", "check points used", nullable=True),
        count("parameters_offered", "additional parameters offered", nullable=True),
        count("parameters_kept", "additional parameters finally estimated", nullable=True),
        count("parameters_significant", "additional parameters that are significant", nullable=True),
        number("gsd_m", "ground sampling distance, median of the images", nullable=True),
        *(
            number(f"image_rms_{axis}_um", f"RMS of the image residuals, {axis}", nullable=True)
            for axis in ("x", "y")
        ),
        count("cells", "sub-areas of the images with a mean residual, all cameras", nullable=True),
        count("cells_significant", "significant ones among them", nullable=True),
        number("cells_by_chance", "number of significant sub-areas expected by chance", nullable=True),
        *(
            number(
                f"systematic_{axis}_um",
                f"RMS of the mean residuals without the part due to chance, {axis}",
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
