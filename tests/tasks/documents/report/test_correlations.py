"""The drawing of a matrix of correlations."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest

from tasks.documents.report.correlations import matrix_plot


@pytest.mark.parametrize("count", [3, 30, 54, 90])
def test_names_beside_the_diagonal_end_within_the_drawing(count: int) -> None:
    names = [("principal_point_x", "UCE-80"), *(("gnss_strip_bias_x", f"N{i:02d}") for i in range(count - 1))]
    index = pd.MultiIndex.from_tuples(names)
    values = np.full((count, count), 0.4) + 0.6 * np.eye(count)
    drawing = str(matrix_plot(pd.DataFrame(values, index=index, columns=index), "correlations"))
    places = re.findall(r'<text x="([\d.]+)"[^>]*text-anchor="start"[^>]*>([^<]*)<', drawing)
    # Tiny text of 9 px: a letter takes 5 px in the mean.
    assert all(float(x) + 5.0 * len(name) <= 960.0 for x, name in places), places[-1]
    assert bool(places) == (count > 30)
