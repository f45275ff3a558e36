"""From deliveries to a block that can be adjusted: read everything, find approximate values."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

from flows.runs.stage import stage
from tasks.settings.adjustment import FreeParameter
from tasks.settings.project import Project
from tasks.stages import approximate_values_stage as approximate
from tasks.stages import film, ingest
from tasks.store.artifact import Artifact
from tasks.store.store import Outputs, Store

import_exposures = stage(ingest.import_exposures)
import_image_points = stage(ingest.import_image_points)
import_control = stage(ingest.import_control)
orient_film = stage(film.orient_film)
approximate_block = stage(approximate.approximate_block)


@dataclass(frozen=True)
class PreparedBlock:
    """Outputs of the stages up to the approximate values, in the order in which they ran.

    Of film images, ``image_points`` has the corrected points, and ``imported`` the notes of the import.
    """

    exposures: Outputs
    control: Outputs
    image_points: Outputs
    approximate: Outputs
    imported: tuple[Outputs, ...] = ()

    @property
    def stages(self) -> tuple[Outputs, ...]:
        """All outputs, for publishing and for their notes."""
        return (self.exposures, self.control, *self.imported, self.image_points, self.approximate)

    def with_cameras(self, cameras: Artifact) -> PreparedBlock:
        """The same block with another table of cameras."""
        return replace(self, exposures={**self.exposures, "cameras": cameras})


def film_orientations_of(
    project: Project, store: Store, exposures: Outputs, points: Outputs
) -> Outputs | None:
    """Image points corrected by the fiducial marks of film images; None for digital images."""
    if not project.inputs.fiducials:
        return None
    return orient_film(
        store,
        sources=project.inputs.fiducials,
        exposures=exposures["exposures"],
        cameras=exposures["cameras"],
        image_points=points["image_points"],
        given=project.cameras,
    )


def prepare_block(
    project: Project, store: Store, free: Collection[FreeParameter] | None = None
) -> PreparedBlock:
    """Read exposures, image points and control, and compute approximate values.

    Parameters
    ----------
    free : the parameters that will be estimated; None: those of the project's adjustment.
    """
    read = import_exposures(
        store, sources=project.inputs.exposures, cameras=project.cameras, project=project.project
    )
    control = import_control(
        store,
        sources=project.inputs.control,
        project=project.project,
        distances=project.inputs.distances,
    )
    points = import_image_points(
        store,
        sources=project.inputs.image_points,
        exposures=read["exposures"],
        cameras=read["cameras"],
        control_points=control["control_points"],
        outside_format_share=project.checks.outside_format_share,
        orient_without_exposure=project.inputs.orient_without_exposure,
    )
    film = film_orientations_of(project, store, read, points)
    imported = () if film is None else ({"notes": points["notes"]},)
    points = points if film is None else film
    approximate = approximate_block(
        store,
        exposures=read["exposures"],
        cameras=read["cameras"],
        image_points=points["image_points"],
        control_points=control["control_points"],
        distances=control["distances"],
        project=project.project,
        checks=project.checks,
        misaligned="boresight" in (project.adjustment.free if free is None else free),
    )
    return PreparedBlock(read, control, points, approximate, imported)
