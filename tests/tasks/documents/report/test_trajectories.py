"""The map of the trajectories."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd

from tasks.documents.report.trajectories import trajectory_map


def table(solution: list[str | None], after_gap: list[int], outliers: list[int]) -> pd.DataFrame:
    count = len(solution)
    return pd.DataFrame(
        {
            "trajectory": "a.sbet",
            "time_s": np.arange(float(count)),
            "x_m": 100.0 * np.arange(count),
            "y_m": 50.0 * np.arange(count),
            "solution": solution,
            "after_gap": [row in after_gap for row in range(count)],
            "is_outlier": [row in outliers for row in range(count)],
        }
    )


EXPOSURES = pd.DataFrame({"image": ["a<b", "c"], "x_m": [150.0, np.nan], "y_m": [75.0, np.nan]})


def test_without_a_trajectory_there_is_no_map() -> None:
    assert trajectory_map(pd.DataFrame(), pd.DataFrame()) is None


def test_solutions_gaps_and_outliers_are_told_apart() -> None:
    drawn = str(trajectory_map(table(["fixed"] * 3 + ["float"] * 3, [5], [2]), EXPOSURES))
    curves = re.findall(r'<path class="curve" [^>]*stroke="(#\w+)"([^>]*)>', drawn)
    # Fixed, the step to float, float, and the dashed gap to the last sample.
    assert [colour for colour, _ in curves] == ["#009E73", "#E69F00", "#E69F00", "#C1351B"]
    assert ["dasharray" in rest for _, rest in curves] == [False, False, False, True]
    assert "sample at 2.000 s inconsistent with its neighbours" in drawn
    assert "other solution" in drawn
    assert "without quality" not in drawn


def test_exposures_with_a_position_are_dots_with_their_names() -> None:
    drawn = str(trajectory_map(table([None] * 4, [], []), EXPOSURES))
    assert drawn.count('r="2.2"') == 1
    assert "<title>a&lt;b</title>" in drawn
    assert "without quality" in drawn
