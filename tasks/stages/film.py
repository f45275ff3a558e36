"""Image points of film images, corrected for scan and film deformation by their fiducial marks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa

from tasks.errors import InputError
from tasks.settings.cameras import CameraInput
from tasks.settings.inputs import ImagePointsInput
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, write_notes
from tasks.store.store import stored
from tasks.tables.schemas.deliveries import FILM_ORIENTATIONS, IMAGE_POINTS


@stored("film_orientations")
def orient_film(
    folder: Path,
    *,
    sources: tuple[ImagePointsInput, ...],
    exposures: Artifact,
    cameras: Artifact,
    image_points: Artifact,
    given: dict[str, CameraInput],
) -> None:
    """Write ``film_orientations.parquet``, ``image_points.parquet`` and notes.

    Image points of cameras without fiducial marks are unchanged.

    Raises
    ------
    InputError
        If a film image has no measured marks; see `tasks.deliveries.fiducials`.
    """
    # A run that finds the output stored never loads what computes it.
    from tasks.deliveries.fiducials import measured_marks
    from tasks.tables.parquet import read_table, write_stage_table
    from tasks.tables.places import places_of

    delivered = read_table(exposures)
    marks = measured_marks(sources, delivered, read_table(cameras), given)
    found = marks.orientations()
    points = read_table(image_points)
    image = places_of(points["image"], marks.images)
    camera = points["image"].map(delivered.set_index("image")["camera"])
    without = (image < 0) & camera.isin([name for name, own in given.items() if own.is_film]).to_numpy()
    if without.any():
        raise InputError(
            "The image of a film camera has no measured fiducial marks.",
            "Measure them (inputs.fiducials), or remove its image points.",
            entity=f"image {points['image'].iloc[int(np.argmax(without))]}",
        )
    rows = np.flatnonzero(image >= 0)
    xy = points[["x_mm", "y_mm"]].to_numpy(np.float64, copy=True)
    xy[rows] = found.applied(image[rows], xy[rows])
    points["x_mm"], points["y_mm"] = xy.T
    columns = {column.name: points[column.name].tolist() for column in IMAGE_POINTS.columns}
    extra = {name: pa.array(points[name], pa.string()) for name in points.columns if name not in columns}
    write_stage_table(folder, IMAGE_POINTS, columns, extra=extra)
    write_stage_table(folder, FILM_ORIENTATIONS, marks.columns(found))
    write_notes(folder, Notes(marks.remarks(found)))
