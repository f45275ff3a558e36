"""Approximate values as a stage; the work is done in `tasks.stages.approximate_values`."""

from __future__ import annotations

from pathlib import Path

from tasks.settings.project import ProjectSettings
from tasks.settings.quality import ChecksSettings
from tasks.store.artifact import Artifact
from tasks.store.store import stored

#: Parameters that make any usual boresight of a camera possible where they are estimated.
MOUNTINGS = frozenset({"boresight", "relative_rotation"})


@stored("approximate_values")
def approximate_block(
    folder: Path,
    /,
    *,
    project: ProjectSettings,
    checks: ChecksSettings,
    misaligned: bool = False,
    **tables: Artifact,
) -> None:
    """Orient images without given orientation, intersect all object points, refuse contradictory input.

    Writes images, approximate_orientations, approximate_points and approximate_boresight.parquet, notes.json.

    Parameters
    ----------
    misaligned : whether mountings are to be estimated, so that any usual boresight is possible.
    tables : exposures, cameras, image_points, control_points and distances.

    Raises
    ------
    InputError
        If orientations, image points and control contradict each other.
    """
    # A run that finds the output stored never loads what computes it.
    from tasks.stages.approximate_values import write_approximate_block

    write_approximate_block(folder, tables, project, checks, misaligned=misaligned)
