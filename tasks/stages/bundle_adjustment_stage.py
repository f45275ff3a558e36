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
    *,
    exposures: Artifact,
    cameras: Artifact,
    image_points: Artifact,
    control_points: Artifact,
    distances: Artifact,
    approximate_points: Artifact,
    approximate_boresight: Artifact,
    approximate_orientations: Artifact,
    project: ProjectSettings,
    adjustment: AdjustmentSettings,
    calibrated: tuple[Artifact, Artifact] | None = None,
    trust_map: TrustMapSettings | None = None,
) -> None:
    """Adjust the block and write orientations, points, residuals, parameters and their quality.

    Parameters
    ----------
    calibrated : parameters and correlations of the adjustment that has calibrated the cameras, where this is
        the first of two steps: then ``strip_errors.parquet`` is written, too.
    trust_map : how to evaluate the accuracy over the ground, as ``trust_map_cells.parquet``; None: none.

    Raises
    ------
    NotComputableError
        If the datum is not determined or the iteration diverges.
    """
    # A run that finds the output stored never loads what computes it.
    from tasks.stages.bundle_adjustment import write_adjusted_bundle

    write_adjusted_bundle(
        folder,
        exposures=exposures,
        cameras=cameras,
        image_points=image_points,
        control_points=control_points,
        distances=distances,
        approximate_points=approximate_points,
        approximate_boresight=approximate_boresight,
        approximate_orientations=approximate_orientations,
        project=project,
        adjustment=adjustment,
        calibrated=calibrated,
        trust_map=trust_map,
    )
