"""Import: the files of a delivery become tables in the project's coordinate system and in millimetres.

Three stages, one for each kind of input. Wrong input ends the run here with file, line and remedy;
suspicious input becomes a sentence in the notes. Readers are loaded only by the stage that reads files: a run
that finds the tables in the store does not need them.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tasks.coordinates.conformality import refuse_distorted_angles
from tasks.coordinates.crs import MapFrame
from tasks.errors import InputError
from tasks.settings.cameras import CameraInput
from tasks.settings.inputs import ControlInput, DistancesInput, ExposuresInput, ImagePointsInput
from tasks.settings.project import ProjectSettings
from tasks.settings.quality import OUTSIDE_FORMAT_SHARE
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, write_notes
from tasks.store.store import stored
from tasks.tables.schemas.deliveries import CONTROL_POINTS, DISTANCES, EXPOSURES, IMAGE_POINTS, TRAJECTORIES

if TYPE_CHECKING:
    from tasks.deliveries.exposures import ExposureColumns


def project_frame(project: ProjectSettings) -> MapFrame:
    """The coordinate system of the results.

    Raises
    ------
    InputError
        If it is neither a conformal map projection in metres nor local.
    """
    frame = MapFrame.of(project.crs, project.heights)
    if not (frame.is_local or frame.is_projected):
        raise InputError(
            f"The CRS of the results, {project.crs}, is geographic, and results are in metres.",
            'Give a map projection, e.g. crs = "EPSG:2154", or "local".',
            entity="project.crs",
        )
    refuse_distorted_angles(frame)
    return frame


@stored("import_exposures")
def import_exposures(
    folder: Path,
    *,
    sources: tuple[ExposuresInput, ...],
    cameras: dict[str, CameraInput],
    project: ProjectSettings,
) -> None:
    """Write ``exposures.parquet``, ``cameras.parquet`` and notes; ``trajectories.parquet`` if there are any.

    Raises
    ------
    InputError
        See `tasks.deliveries.exposures` and `tasks.deliveries.cameras`.
    """
    from tasks.deliveries.cameras import taken_from_registry, write_cameras
    from tasks.deliveries.film_reports import about_film_reports
    from tasks.deliveries.head_certificates import about_head_certificates
    from tasks.tables.parquet import write_stage_table

    frame = project_frame(project)
    write_cameras(folder / "cameras.parquet", cameras)
    columns, extra, notes, paths = _exposures(sources, cameras, frame)
    write_stage_table(folder, EXPOSURES, columns, frame, extra)
    if paths:
        from tasks.deliveries.trajectory_path import path_columns

        write_stage_table(folder, TRAJECTORIES, path_columns(paths), frame)
    of_cameras = (
        *taken_from_registry(cameras),
        *about_head_certificates(cameras),
        *about_film_reports(cameras),
    )
    write_notes(folder, replace(notes, problems=(*of_cameras, *notes.problems)))


def _exposures(
    sources: tuple[ExposuresInput, ...], cameras: dict[str, CameraInput], frame: MapFrame
) -> ExposureColumns:
    """Columns of the exposures; empty ones without sources."""
    from tasks.deliveries.angles_of_heads import body_from_heads
    from tasks.deliveries.cameras import camera_table, frame_cameras
    from tasks.deliveries.exposures import exposure_columns

    if sources:
        in_a_map = any(source.adjusted_in is not None for source in sources)
        has_heads = any(camera.head is not None for camera in cameras.values())
        table = camera_table(cameras) if in_a_map or has_heads else None
        frames = frame_cameras(table) if in_a_map and table is not None else {}
        heads = {} if table is None else body_from_heads(table)
        return exposure_columns(sources, tuple(cameras), frame, frames, heads)
    notes = Notes((), {"counts": {"exposures": 0}})
    return {column.name: [] for column in EXPOSURES.columns}, {}, notes, ()


@stored("import_image_points")
def import_image_points(
    folder: Path,
    *,
    sources: tuple[ImagePointsInput, ...],
    exposures: Artifact,
    cameras: Artifact,
    control_points: Artifact | None = None,
    outside_format_share: float = OUTSIDE_FORMAT_SHARE,
    orient_without_exposure: bool = False,
) -> None:
    """Write ``image_points.parquet`` and notes.

    With `control_points`, a control point seen in one image only is kept: with its coordinates it is an
    observation of the orientation, which a tie point with a single ray is not.

    Raises
    ------
    InputError
        If there is no file; see `tasks.deliveries.image_points`.
    """
    from tasks.deliveries.image_points import usable_image_points
    from tasks.tables.parquet import read_table, write_row_groups

    if not sources:
        raise InputError(
            "There are no image points (inputs.image_points), and nothing can be adjusted without.",
            "Name their files, or calibrate from orientations of another adjustment alone with `aerocal "
            "calibrate`.",
        )
    surveyed = None if control_points is None else tuple(read_table(control_points)["point"])
    usable = usable_image_points(
        sources,
        read_table(exposures),
        read_table(cameras),
        surveyed,
        outside_format_share,
        orient_without_exposure,
    )
    write_row_groups(folder / "image_points.parquet", IMAGE_POINTS, usable.groups, extra=usable.extra)
    write_notes(folder, usable.notes)


@stored("import_control")
def import_control(
    folder: Path,
    *,
    sources: tuple[ControlInput, ...],
    project: ProjectSettings,
    distances: tuple[DistancesInput, ...] = (),
) -> None:
    """Write ``control_points.parquet``, ``distances.parquet`` (empty if nothing is given) and notes.

    Raises
    ------
    InputError
        See `tasks.deliveries.control` and `tasks.deliveries.distances`.
    """
    from tasks.deliveries.control import control_columns
    from tasks.deliveries.distances import distance_columns
    from tasks.tables.parquet import write_stage_table

    frame = project_frame(project)
    if sources:
        columns, extra, notes = control_columns(sources, frame)
    else:
        notes = Notes((), {"counts": {"control": 0, "check": 0}})
        columns, extra = {"point": [], "role": []}, {}
    write_stage_table(folder, CONTROL_POINTS, columns, frame, extra)
    columns, extra = {column.name: [] for column in DISTANCES.columns}, {}
    if distances:
        columns, extra, remarks = distance_columns(distances)
        notes = replace(notes, problems=(*notes.problems, *remarks))
    write_stage_table(folder, DISTANCES, columns, extra=extra)
    write_notes(folder, notes)
