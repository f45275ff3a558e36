"""Check points and check distances beyond their limits, in words."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from adjust.arrays import Bools
from tasks.evaluation.distance_residuals import over_limit
from tasks.remarks.adjustment import beside_limits
from tasks.results.summary import CheckPointTest

_WAYS = ("east", "north", "up")
_MOST_DISTANCES = 5


def check_point_sentences(test: CheckPointTest | None, ground: str) -> Iterator[str]:
    """Root mean squares and means not expected from the standard deviations, too small ones as well.

    Parameters
    ----------
    ground : what states where the block lies, see `given_ground`.
    """
    if test is None:
        return
    found = (test.rmse_m, test.predicted_low_m, test.predicted_high_m, test.mean_m, test.mean_limit_m)
    rms, low, high, mean, limit = (np.array(values, dtype=np.float64) for values in found)
    with_probability = f"{100 * test.confidence:g} % for all directions together"
    beyond = [
        *(
            "RMS {} {} m, expected {} to {} m".format(_WAYS[k], *beside_limits(rms[k], low[k], high[k]))
            for k in _where(rms > high)
        ),
        *(
            "mean {} {}{} m, expected within ±{} m".format(
                _WAYS[k], "+" if mean[k] > 0.0 else "", *beside_limits(mean[k], limit[k])
            )
            for k in _where(np.abs(mean) > limit)
        ),
    ]
    small = [
        "{} {} m, expected {} to {} m".format(_WAYS[k], *beside_limits(rms[k], low[k], high[k]))
        for k in _where(rms < low)
    ]
    if beyond:
        yield (
            f"The check points are beyond their limits: {'; '.join(beyond)} ({with_probability}, from the σ "
            "of the adjusted points and of the survey). The cause is an error that the stated σ do not "
            f"include: {check_survey_words(ground)}, and the interior orientation."
        )
    if small:
        yield (
            "The differences at the check points are smaller than expected from their σ: RMS "
            f"{'; '.join(small)} ({with_probability}). The σ of the survey or of the observations are stated "
            "too large, or the check points are not independent of the control."
        )


def check_survey_words(ground: str) -> str:
    """What to check where check points differ alike."""
    against = f" against those of {ground}" if ground else ""
    return f"check datum, height system and survey of the check points{against}"


def distance_sentences(table: pd.DataFrame, confidence: float) -> Iterator[str]:
    """Check distances that are beyond their limits, and distances that were rejected.

    Parameters
    ----------
    table : distance_residuals.parquet.
    confidence : of all limits together.
    """
    check = table[table["status"] == "check"]
    beyond = check[over_limit(check, confidence) > 1.0]
    if len(beyond):
        yield (
            f"Check distances are beyond their limits ({100 * confidence:g} % for all {len(check)}): "
            f"{_listed(beyond)}. Check scale, names of the targets and interior orientation."
        )
    rejected = table[table["status"] == "rejected"]
    if len(rejected):
        yield f"Distances were rejected as gross errors: {_listed(rejected)}."


def _listed(table: pd.DataFrame) -> str:
    rows = table.head(_MOST_DISTANCES).to_dict("records")
    words = [
        f"{row['point']} to {row['other_point']} {1e3 * row['difference_m']:+.3g} mm "
        f"(σ {1e3 * row['sigma_difference_m']:.3g} mm)"
        for row in rows
    ]
    return "; ".join(words) + ("; …" if len(table) > len(rows) else "")


def _where(chosen: Bools) -> list[int]:
    return [int(k) for k in np.flatnonzero(chosen)]
