"""After every release of parameters: which of them the flight has determined."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from adjust.calibration.flight_pattern import FlightPattern, flight_pattern
from tasks.calibration.release import HELD, UNDETERMINED, Release, Undetermined
from tasks.calibration.verdicts import parameter_verdicts
from tasks.errors import InputError
from tasks.files.json_text import JSON
from tasks.quantities import kind_of
from tasks.settings.adjustment import FreeParameter
from tasks.settings.calibration import CalibrationSettings
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, write_notes
from tasks.store.store import stored
from tasks.tables.parquet import read_table


@stored("judgement")
def judge_release(
    folder: Path,
    *,
    images: Artifact,
    parameters: Artifact,
    correlations: Artifact,
    before: tuple[FreeParameter, ...],
    new: tuple[FreeParameter, ...],
    additional: str,
    undetermined_before: tuple[str, ...],
    calibration: CalibrationSettings,
) -> None:
    """Write notes that say what is held from now on, and why.

    A family is held as a whole: half a principal point is of no use.

    Parameters
    ----------
    before, new, additional : those of the `Release`.
    undetermined_before : families that were not determined before this release either.
    """
    table, release = read_table(parameters), Release(before, new, additional)
    verdicts = parameter_verdicts(
        table, read_table(correlations), recognised_pattern(read_table(images)), calibration.limits
    )
    of_prior = table["status"].isin(("not_determinable", "prior_only"))
    silent = set(zip(table.loc[of_prior, "parameter"], table.loc[of_prior, "entity"], strict=True))
    reasons: dict[str, str] = {}
    inseparable = set()
    for family in release.free:
        own = [item for item in verdicts.values() if kind_of(item.parameter) == family]
        own = [item for item in own if item.verdict == "not_determinable"]
        if own:
            reasons[family] = " ".join(f"{item}: {item.because}" for item in own)
        if any((item.parameter, item.entity) in silent for item in own):
            inseparable.add(family)
    found = Undetermined(reasons, frozenset(inseparable), frozenset(undetermined_before))
    held: dict[str, JSON] = {**found.to_be_held(release)}
    write_notes(folder, Notes((), {HELD: held, UNDETERMINED: sorted(reasons)}))


def recognised_pattern(images: pd.DataFrame) -> FlightPattern:
    """Flight directions and heights of images.parquet.

    Raises
    ------
    InputError
        If no image has a heading and a height above ground.
    """
    # A camera beside or below its object has no height above ground.
    known = images[images["heading_deg"].notna() & (images["height_above_ground_m"] > 0.0)]
    if known.empty:
        raise InputError(
            "No image has a heading and a height above ground; a flight pattern cannot be recognised.",
            "Give the exposures angles, and object points that several images see.",
        )
    labels = known["flight"].fillna("").astype(str) + "/" + known["strip"].fillna("").astype(str)
    return flight_pattern(
        np.deg2rad(known["heading_deg"].to_numpy(np.float64)),
        known["height_above_ground_m"].to_numpy(np.float64),
        np.unique(labels, return_inverse=True)[1].astype(np.int64),
    )
