"""The trust map as a stage; the work is done in `tasks.stages.trust_map`."""

from __future__ import annotations

from pathlib import Path

from tasks.settings.project import ProjectSettings
from tasks.settings.trust_map import TrustMapSettings
from tasks.store.artifact import Artifact
from tasks.store.store import stored


@stored("trust_map")
def draw_trust_map(
    folder: Path, *, cells: Artifact, notes: Artifact, project: ProjectSettings, settings: TrustMapSettings
) -> None:
    """Write trust_map.tif: a band for every column of trust_map_cells.parquet.

    Parameters
    ----------
    cells, notes : of the adjustment.
    """
    # A run that finds the output stored never loads what computes it.
    from tasks.stages.trust_map import write_trust_map_raster

    write_trust_map_raster(folder, cells, notes, project, settings)
