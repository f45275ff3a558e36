"""Which surveyed points are control points in a scenario."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adjust.arrays import Bools, Floats, Ints
from adjust.simulate.survey import along_border, spread_order
from tasks.errors import InputError
from tasks.nearest_name import did_you_mean
from tasks.settings.sweep import ControlScenario

_LEAST_IMAGES = 2


def control_chosen(
    scenario: ControlScenario, name: str, surveyed: pd.DataFrame, measured: pd.DataFrame
) -> Bools:
    """Whether each surveyed point (n,) is a control point; the others are check points.

    Parameters
    ----------
    name : of the scenario, for messages.
    surveyed : control_points.parquet.
    measured : image_points.parquet of the whole block, so that a choice does not depend on the sub-block.

    Raises
    ------
    InputError
        If the scenario names a point that is not surveyed, or asks for more points than there are.
    """
    if scenario.roles is not None:
        everything = np.ones(len(surveyed), dtype=bool)
        return everything if scenario.roles == "all" else (surveyed["role"] == "control").to_numpy()
    if scenario.points is not None:
        return _named(scenario.points, name, surveyed)
    candidates = np.flatnonzero(_usable(surveyed, measured))
    count = scenario.count or 0
    if count > len(candidates):
        raise InputError(
            f"The scenario asks for {count} control points, and only {len(candidates)} points are fully "
            f"surveyed and measured in {_LEAST_IMAGES} images or more.",
            "Ask for fewer.",
            entity=f"sweep.control.{name}",
        )
    place = surveyed[["x_m", "y_m"]].to_numpy(np.float64)[candidates]
    chosen = np.zeros(len(surveyed), dtype=bool)
    chosen[candidates[_even(place, count) if scenario.layout == "even" else _border(place, count)]] = True
    return chosen


def _named(points: tuple[str, ...], name: str, surveyed: pd.DataFrame) -> Bools:
    known = list(surveyed["point"])
    unknown = next((point for point in points if point not in set(known)), None)
    if unknown is not None:
        raise InputError(
            f"There is no surveyed point '{unknown}'.",
            did_you_mean(unknown, known),
            entity=f"sweep.control.{name}",
        )
    return surveyed["point"].isin(points).to_numpy()


def _usable(surveyed: pd.DataFrame, measured: pd.DataFrame) -> Bools:
    """Points (n,) with all three coordinates that several images show."""
    images = measured.groupby("point")["image"].nunique()
    seen = surveyed["point"].map(images).fillna(0).to_numpy(np.int64) >= _LEAST_IMAGES
    known = np.isfinite(surveyed[["x_m", "y_m", "z_m"]].to_numpy(np.float64)).all(axis=1)
    return np.asarray(seen & known)


def _even(place: Floats, count: int) -> Ints:
    """Indices of points, each as far as possible from the preceding ones."""
    return spread_order(place, count)


def _border(place: Floats, count: int) -> Ints:
    """Indices of the points nearest to places evenly along the border of the area, each taken once."""
    low, high = place.min(axis=0, initial=np.inf), place.max(axis=0, initial=-np.inf)
    part = (place - low) / np.maximum(high - low, 1e-9)
    chosen: list[int] = []
    for target in along_border(count):
        distance = np.hypot(*(part - target).T)
        distance[chosen] = np.inf
        chosen.append(int(np.argmin(distance)))
    return np.array(chosen, dtype=np.int64)
