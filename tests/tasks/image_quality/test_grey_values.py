"""Which grey value is the largest of a sensor, wherever the rows with it lie."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tasks.image_files.image_reader import ImageDescription
from tasks.image_quality.grey_values import GreyValues

ABOUT = ImageDescription(Path("a.tif"), 100, 80, 1, "uint16", 16, "all", None, (), 16, 100)
DARK, BRIGHT = np.full((40, 100), 1023, np.uint16), np.full((40, 100), 40_000, np.uint16)
CLIPPED, GREY = np.full((40, 100), 4095, np.uint16), np.full((40, 100), 2000, np.uint16)


@pytest.mark.parametrize(
    ("parts", "largest", "overexposed"),
    [
        ((DARK, BRIGHT), 65_535.0, None),
        ((BRIGHT, DARK), 65_535.0, None),
        ((GREY, CLIPPED), 4095.0, 0.5),
        ((CLIPPED, GREY), 4095.0, 0.5),
    ],
)
def test_a_value_that_other_rows_exceed_is_not_the_largest_of_the_sensor(
    parts: tuple[np.ndarray, ...], largest: float, overexposed: float | None
) -> None:
    values = GreyValues(ABOUT)
    for part in parts:
        values.take(part, np.ones(part.shape, dtype=bool))
    assert (values.largest, values.overexposed) == (largest, overexposed)
