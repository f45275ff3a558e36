"""The remarks on an adjustment as a stage; the work is done in `tasks.stages.remarks`."""

from __future__ import annotations

from pathlib import Path

from tasks.store.artifact import Artifact
from tasks.store.store import stored


@stored("remarks")
def describe_adjustment(
    folder: Path,
    *,
    notes: Artifact,
    model_alternatives: Artifact,
    distance_residuals: Artifact,
    residual_autocorrelation: Artifact,
    calibrating: bool = False,
) -> None:
    """Write notes: the findings of the model tests, and what the user should know, most serious first.

    Parameters
    ----------
    notes, model_alternatives, distance_residuals, residual_autocorrelation : outputs of the adjustment.
    calibrating : whether a calibration follows, which says itself which parameters cannot be separated.
    """
    # A run that finds the output stored never loads what reads its tables.
    from tasks.stages.remarks import write_remarks

    tables = (model_alternatives, distance_residuals, residual_autocorrelation)
    write_remarks(folder, notes, *tables, calibrating=calibrating)
