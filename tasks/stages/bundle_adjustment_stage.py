"""The bundle adjustment as a stage; the work is done in `tasks.stages.bundle_adjustment`."""

from __future__ import annotations

from pathlib import Path

from tasks.settings.adjustment import AdjustmentSettings
from tasks.settings.project import ProjectSettings
from tasks.settings.trust_map import TrustMapSettings
from tasks.store.artifact import Artifact
from tasks.store.store import stored


@stored("bundle_adjustment")
def adjust_bundle(
    folder: Path,
    /,
    *,
    project: ProjectSettings,
    adjustment: AdjustmentSettings,
    calibrated: tuple[Artifact, Artifact] | None = None,
    trust_map: TrustMapSettings | None = None,
    **tables: Artifact,
) -> None:
    """Adjust the block and write orientations, points, residuals, parameters and their quality.

    Parameters
    ----------
    calibrated : parameters and correlations of the adjustment that has calibrated the cameras, where this is
        the first of two steps: then ``strip_errors.parquet`` is written, too.
    trust_map : how to evaluate the accuracy over the ground, as ``trust_map_cells.parquet``; None: none.
    tables : those of `tasks.block.assembled_block.DeliveredTables`.

    Raises
    ------
    NotComputableError
        If the datum is not determined or the iteration diverges.
    """
    # A run that finds the output stored never loads what computes it.
    from tasks.stages.bundle_adjustment import write_adjusted_bundle

    write_adjusted_bundle(folder, tables, project, adjustment, calibrated, trust_map)
