"""Table of the interior orientation of film images."""

from __future__ import annotations

from tasks.tables.schemas.columns import CAMERA, IMAGE, TableSchema, count, number, text

_TERMS = (("0_mm", "mm", "shift"), ("1", "", "factor of the scanned x"), ("2", "", "factor of the scanned y"))

FILM_ORIENTATIONS = TableSchema(
    "film_orientations",
    "Affine transformation of a film image from its scan to the coordinates of the camera, from the fiducial "
    "marks: x = a0 + a1 x_scan + a2 y_scan, y = b0 + b1 x_scan + b2 y_scan.",
    (
        IMAGE,
        CAMERA,
        count("marks", "number of measured fiducial marks"),
        *(
            number(f"{row}{place}", f"{words}, of {axis}", unit)
            for row, axis in (("a", "x"), ("b", "y"))
            for place, unit, words in _TERMS
        ),
        *(
            number(
                f"sigma_{place}", f"standard deviation of the {words}, from the stated σ of the marks", unit
            )
            for place, unit, words in _TERMS
        ),
        number("sigma0_um", "standard deviation of a measured mark from the residuals", nullable=True),
        number("largest_um", "largest residual"),
        text("largest_mark", "mark with the largest residual"),
        number("largest_standardized", "largest residual over its standard deviation", nullable=True),
    ),
    ("image",),
)
