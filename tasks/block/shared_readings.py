"""Heads that exposed at one moment share one reading of GNSS and INS; it must not count several times."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adjust.arrays import Ints
from tasks.block.given_orientations import GivenOrientations
from tasks.deliveries.declared_exposures import ONE_MOMENT_S
from tasks.results.figures import SharedMoments

# Heads of one body lie within it, metres.
_ONE_BODY_M = 10.0


def reading_of_image(given: GivenOrientations) -> Ints:
    """(n,) the first image of the same flight, place and time (within a millisecond); itself without time."""
    reading = np.arange(len(given.image), dtype=np.int64)
    timed = np.flatnonzero(np.isfinite(given.time_s))
    if len(timed) == 0:
        return reading
    table = pd.DataFrame(given.observed[timed], columns=["x", "y", "z"])
    flight, time = given.flight_of_image[timed], given.time_s[timed]
    order = np.lexsort((time, flight))
    follows = (np.diff(flight[order]) == 0) & (np.diff(time[order]) < ONE_MOMENT_S)
    moment = np.empty(len(order), dtype=np.int64)
    moment[order] = np.concatenate([[0], np.cumsum(~follows)])
    together = table.groupby(moment)
    spread = (together.transform("max") - together.transform("min")).max(axis=1).to_numpy(np.float64)
    first = pd.Series(timed).groupby(moment).transform("min").to_numpy(np.int64)
    reading[timed] = np.where(spread < _ONE_BODY_M, first, timed)
    return reading


def heads_of_reading(given: GivenOrientations) -> Ints:
    """(n,) number of images that have the reading of each, 1 for one alone."""
    reading = reading_of_image(given)
    return np.bincount(reading)[reading]


def shared_readings(given: GivenOrientations) -> SharedMoments | None:
    """Images of heads that share readings; None where every image has its own."""
    heads = heads_of_reading(given)
    if (heads == 1).all():
        return None
    moments = round(float((1.0 / heads[heads > 1]).sum()))
    return SharedMoments(images=int((heads > 1).sum()), moments=moments)
