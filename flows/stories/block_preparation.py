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
class ImportedBlock:
    """Outputs of the imports.

    Of film images, ``image_points`` has the corrected points, and ``imported`` the notes of the import.
    """

    exposures: Outputs
    control: Outputs
    image_points: Outputs
    imported: tuple[Outputs, ...] = ()

    @property
    def tables(self) -> dict[str, Artifact]:
        """The tables of the deliveries by their names, as the stages take them."""
        return {
            "exposures": self.exposures["exposures"],
            "cameras": self.exposures["cameras"],
            "image_points": self.image_points["image_points"],
            "control_points": self.control["control_points"],
            "distances": self.control["distances"],
        }

    def approximated(self, project: Project, store: Store, free: Collection[FreeParameter]) -> PreparedBlock:
        """The block with approximate values; `free` are the parameters that will be estimated."""
        found = approximate_block(
            store,
            **self.tables,
            project=project.project,
            checks=project.checks,
            misaligned=not approximate.MOUNTINGS.isdisjoint(free),
        )
        return PreparedBlock(
            self.exposures, self.control, self.image_points, self.imported, approximate=found
        )


@dataclass(frozen=True, kw_only=True)
class PreparedBlock(ImportedBlock):
    """A block that can be adjusted: the imports, and its approximate values."""

    approximate: Outputs

    @property
    def stages(self) -> tuple[Outputs, ...]:
        """All outputs in the order in which they were written, for publishing and for their notes."""
        return (self.exposures, self.control, *self.imported, self.image_points, self.approximate)

    @property
    def start(self) -> dict[str, Artifact]:
        """The tables of the deliveries and of the approximate values, as the adjustment takes them."""
        names = ("approximate_points", "approximate_boresight", "approximate_orientations")
        return {**self.tables, **{name: self.approximate[name] for name in names}}

    def with_cameras(self, cameras: Artifact) -> PreparedBlock:
        """The same block with another table of cameras."""
        return replace(self, exposures={**self.exposures, "cameras": cameras})


def import_block(project: Project, store: Store) -> ImportedBlock:
    """Read exposures, control and image points; those of film are corrected by their fiducial marks."""
    inputs = project.inputs
    read = import_exposures(store, sources=inputs.exposures, cameras=project.cameras, project=project.project)
    control = import_control(
        store, sources=inputs.control, project=project.project, distances=inputs.distances
    )
    points = import_image_points(
        store,
        sources=inputs.image_points,
        exposures=read["exposures"],
        cameras=read["cameras"],
        control_points=control["control_points"],
        outside_format_share=project.checks.outside_format_share,
        orient_without_exposure=inputs.orient_without_exposure,
    )
    if not inputs.fiducials:
        return ImportedBlock(read, control, points)
    film = orient_film(
        store,
        sources=inputs.fiducials,
        exposures=read["exposures"],
        cameras=read["cameras"],
        image_points=points["image_points"],
        given=project.cameras,
    )
    return ImportedBlock(read, control, film, ({"notes": points["notes"]},))


def prepare_block(
    project: Project, store: Store, free: Collection[FreeParameter] | None = None
) -> PreparedBlock:
    """Read exposures, image points and control, and compute approximate values.

    Parameters
    ----------
    free : the parameters that will be estimated; None: those of the project's adjustment.
    """
    estimated = project.adjustment.free if free is None else free
    return import_block(project, store).approximated(project, store, estimated)
