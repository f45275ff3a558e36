"""Two-step calibration: boresight and lever arm or shift from adjusted minus observed orientations.

The adjusted orientations are those of an adjustment of ours (``exterior_orientations.parquet``) or of another
program, read by `tasks.stages.ingest.import_exposures` like any exposures.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from adjust.calibration.adjusted_strips import StripErrors
from adjust.calibration.mountings import MountingRule
from adjust.calibration.two_step import two_step_calibration
from tasks.calibration.orientation_pairs import CameraDifferences, PairedOrientations, paired_orientations
from tasks.calibration.two_step_tables import (
    camera_figures,
    columns_of,
    difference_columns,
    mean_columns,
)
from tasks.calibration.two_step_words import camera_remarks
from tasks.evaluation.strip_error_table import strip_errors_of
from tasks.settings.calibration import AcceptanceLimits, MountingSettings
from tasks.settings.project import ProjectSettings
from tasks.stages.ingest import project_frame
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, write_notes
from tasks.store.store import stored
from tasks.tables.parquet import read_table, write_stage_table
from tasks.tables.schemas.calibration import ORIENTATION_DIFFERENCE_MEANS, ORIENTATION_DIFFERENCES


@stored("two_step")
def calibrate_in_two_steps(
    folder: Path,
    *,
    exposures: Artifact,
    adjusted: Artifact,
    cameras: Artifact,
    project: ProjectSettings,
    mounting: MountingSettings,
    limits: AcceptanceLimits,
    strip_bias_m: tuple[float, float, float],
    strip_errors: Artifact | None = None,
) -> None:
    """Write ``orientation_differences.parquet``, ``orientation_difference_means.parquet`` and notes.

    Parameters
    ----------
    exposures : observed orientations (GNSS/INS).
    adjusted : ``exterior_orientations`` or an external result imported as ``exposures``.
    mounting, limits, strip_bias_m : when strips belong to another mounting.
    strip_errors : of the adjusted orientations; None: not known.

    Raises
    ------
    InputError
        See `tasks.calibration.orientation_pairs`.
    """
    paired = paired_orientations(
        read_table(exposures), read_table(adjusted), read_table(cameras), project_frame(project)
    )
    rules = [_rule(item, mounting, limits, strip_bias_m) for item in paired.cameras]
    table = None if strip_errors is None else read_table(strip_errors)
    results = [
        two_step_calibration(item.differences, rule, None if table is None else _errors(item, table))
        for item, rule in zip(paired.cameras, rules, strict=True)
    ]
    both = list(zip(paired.cameras, results, strict=True))
    differences = pd.concat([difference_columns(*pair) for pair in both])
    means = pd.concat([mean_columns(*pair) for pair in both])
    for schema, table in ((ORIENTATION_DIFFERENCES, differences), (ORIENTATION_DIFFERENCE_MEANS, means)):
        write_stage_table(folder, schema, columns_of(table))
    remarks = [remark for pair in both for remark in camera_remarks(*pair, mounting.error_probability)]
    figures = [camera_figures(*pair).to_json() for pair in both]
    write_notes(folder, Notes((*remarks, *_unpaired(paired)), {"two_step": figures}))


def _errors(item: CameraDifferences, table: pd.DataFrame) -> StripErrors | None:
    """Errors of the strips that show differences, ascending; None if some are unknown."""
    numbers = np.unique(item.differences.strip)
    return strip_errors_of(table, item.camera, tuple(item.strip_names[number] for number in numbers))


def _rule(
    item: CameraDifferences,
    mounting: MountingSettings,
    limits: AcceptanceLimits,
    strip_bias_m: tuple[float, float, float],
) -> MountingRule:
    """By how much flights and strips may differ."""
    roll_pitch, yaw = np.deg2rad(limits.roll_pitch_deg), np.deg2rad(limits.yaw_deg)
    exposures = np.bincount(item.differences.strip)
    # Errors of the exposures average out in a strip; its bias does not.
    of_exposures = item.position_sigma / np.sqrt(np.median(exposures[exposures > 0]))
    in_plan = np.hypot(max(strip_bias_m[:2]), of_exposures)
    return MountingRule(
        mounting.error_probability,
        np.array([roll_pitch, roll_pitch, yaw, limits.lever_arm_m]),
        np.append(item.attitude_sigma, in_plan),
    )


def _unpaired(paired: PairedOrientations) -> tuple[str, ...]:
    if paired.only_adjusted == 0:
        return ()
    return (
        f"{paired.only_adjusted:,} images have an adjusted orientation, but no complete observed one, "
        "and are not used in the two-step calibration.",
    )
