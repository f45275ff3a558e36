"""Table of the trust map."""

from __future__ import annotations

from tasks.tables.schemas.columns import XYZ, XYZ_M, Column, TableSchema, count, number, position


def _of(pattern: str, meaning: str) -> tuple[Column, ...]:
    """A number along grid east, grid north and up."""
    ways = zip(XYZ, ("east", "north", "height"), strict=True)
    return tuple(number(pattern.format(axis), meaning.format(way), "m", nullable=True) for axis, way in ways)


TRUST_MAP_CELLS = TableSchema(
    "trust_map_cells",
    "Accuracy of a new point in a ground cell that at least two images see, along the axes of the CRS.",
    (
        count("row", "number of the cell from the north, from 0"),
        count("column", "number of the cell from the west, from 0"),
        *position("middle of the cell"),
        count("rays", "number of images that see it"),
        *_of("sigma_{}_m", "standard deviation of {}, measured in all these images"),
        *_of("pair_sigma_{}_m", "the same for {}, measured in the two images that give the best height"),
        *_of(
            "relative_sigma_{}_m",
            "standard deviation of the difference in {} from the next cell in the east, both measured in all "
            "their common images",
        ),
        *_of(
            "external_{}_m",
            "largest error of {} that an undetected gross error in one of the new image coordinates causes, "
            "those without control left out",
        ),
        *_of(
            "block_error_{}_m",
            "largest error of {} that an undetected gross error in a position, attitude or control point of "
            "the block causes; interpolated between some hundred cells",
        ),
        *_of(
            "ray_error_{}_m",
            "largest error of {} that an undetected gross error in an image point around the cell causes; "
            "interpolated between some hundred cells",
        ),
        count(
            "uncontrolled",
            "number of new image coordinates with control below 0.1: no residual shows an error",
        ),
    ),
    ("row", "column"),
    XYZ_M,
)
