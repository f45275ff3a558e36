"""After every release of parameters: which of them the flight has determined."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from adjust.calibration.flight_pattern import FlightPattern, flight_pattern
from tasks.calibration.release import HELD, to_be_held
from tasks.calibration.verdicts import ParameterVerdict, parameter_verdicts
from tasks.errors import InputError
from tasks.settings.adjustment import FreeParameter
from tasks.settings.calibration import CalibrationSettings
from tasks.storage.artifact import Artifact
from tasks.storage.json_text import JSON
from tasks.storage.notes import Notes, write_notes
from tasks.storage.store import stored
from tasks.tables.parquet import read_table


@stored("judgement")
def judge_release(
    folder: Path,
    *,
    images: Artifact,
    parameters: Artifact,
    correlations: Artifact,
    free: tuple[FreeParameter, ...],
    newly_released: tuple[str, ...],
    calibration: CalibrationSettings,
) -> None:
    """Write notes that say what is held from now on, and why.

    A family is held as a whole: half a principal point is of no use to anybody.

    Parameters
    ----------
    free, newly_released : see `tasks.calibration.release`.
    """
    verdicts = parameter_verdicts(
        read_table(parameters),
        read_table(correlations),
        recognised_pattern(read_table(images)),
        calibration.limits,
    )
    undetermined: dict[str, str] = {}
    for family in free:
        own = [item for item in verdicts.values() if _is_of(item, family)]
        own = [item for item in own if item.verdict == "not_determinable"]
        if own:
            undetermined[family] = " ".join(f"{item}: {item.because}" for item in own)
    held: dict[str, JSON] = {**to_be_held(undetermined, newly_released)}
    write_notes(folder, Notes((), {HELD: held}))


def recognised_pattern(images: pd.DataFrame) -> FlightPattern:
    """Flight directions and heights of images.parquet.

    Raises
    ------
    InputError
        If no image has a heading and a height above ground.
    """
    known = images[images["heading_deg"].notna() & images["height_above_ground_m"].notna()]
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


def _is_of(item: ParameterVerdict, family: FreeParameter) -> bool:
    """Whether a parameter belongs to a family: its own name, or with an axis or angle behind it."""
    return item.parameter == family or item.parameter.startswith(f"{family}_")
