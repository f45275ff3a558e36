"""Tables of mean image residuals and of the correlation of neighbouring ones."""

from __future__ import annotations

from tasks.tables.schemas.columns import CAMERA, Column, TableSchema, count, number, text

RESIDUAL_GRID = TableSchema(
    "residual_grid",
    "Mean residual of all images of a camera in a sub-area of the image, after the adjustment.",
    (
        CAMERA,
        count("column", "number of the sub-area along x, from 0"),
        count("row", "number of the sub-area along y, from 0"),
        number("x_mm", "middle of the sub-area in the image system"),
        number("y_mm", "middle of the sub-area in the image system"),
        number("width_mm", "extent along x"),
        number("height_mm", "extent along y"),
        count("tile_x", "number along x of the CCD image it lies in, 0 where there is only one"),
        count("tile_y", "number along y of the CCD image it lies in, 0 where there is only one"),
        count("count", "number of image points, the larger of count_vx and count_vy"),
        count("count_vx", "number of residuals in x with redundancy numbers above 0.2"),
        count("count_vy", "number of residuals in y with redundancy numbers above 0.2"),
        *(
            number(
                f"mean_v{axis}_um",
                f"mean residual in {axis} (adjusted − observed, what would have to be added to "
                "measurements); null for fewer than 5 residuals",
                nullable=True,
            )
            for axis in "xy"
        ),
        number(
            "sigma",
            "standard deviation of the mean residual, root mean square of x and y",
            "um",
            nullable=True,
        ),
        *(
            number(
                f"sigma_v{axis}_um",
                f"standard deviation of mean_v{axis}_um from the scatter of the residuals in the sub-area",
                nullable=True,
            )
            for axis in "xy"
        ),
        number(
            "p_value",
            "probability of a mean vector of at least this length by chance (Hotelling)",
            nullable=True,
        ),
        Column(
            "significant",
            "bool",
            "",
            "whether the mean vector differs from zero at the project's confidence, each sub-area "
            "tested separately",
        ),
        *(
            number(
                f"correction_{axis}_um",
                f"correction added to measured {axis} before this adjustment; null where there was none",
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
        CAMERA,
        text("component", "component of the residuals", values=("x", "y")),
        number("distance_to_mm", "upper limit of the distance"),
        number("distance_from_mm", "lower limit of the distance"),
        Column("pairs", "int64", "", "number of pairs; large blocks are sampled"),
        number("correlation", "coefficient; null without pairs", nullable=True),
        number(
            "limit",
            "limit for white noise: 3/√pairs, plus 6 divided by the number of image points in an "
            "image for the effect of its orientation",
            nullable=True,
        ),
        Column("correlated", "bool", "", "whether the coefficient exceeds the limit"),
        number(
            "sigma_relative_um",
            "standard deviation of coordinate differences at this distance",
            nullable=True,
        ),
    ),
    ("camera", "component", "distance_to_mm"),
)
