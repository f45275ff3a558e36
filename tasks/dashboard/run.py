"""A run that has ended, as the dashboard tells of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from urllib.parse import quote

from tasks.figures import AdjustmentFigures, figures_of
from tasks.georeferencing.report.material import CheckFigures
from tasks.storage.artifact import Artifact
from tasks.storage.manifest import read_manifest
from tasks.summary import Summary


@dataclass(frozen=True)
class EndedRun:
    """A run that has ended.

    Attributes
    ----------
    project : name for people.
    project_file : what tells it from others of the same name.
    story : what was done, as the dashboard writes it.
    state : how it ended.
    message : sentences on that.
    directory : output folder on this machine; None: there is none.
    place : where the results are for people: the folder, or an address on object storage.
    summary : its figures; None if it did not come to any.
    results : address that serves the published files of this run; None: none does.
    """

    project: str
    project_file: Path
    story: str
    state: str
    message: str
    directory: Path | None = None
    place: str = ""
    summary: Summary | None = None
    results: str | None = None

    @property
    def has_results(self) -> bool:
        """Whether it has published anything."""
        with_results = self.summary is not None and self.summary.status in ("done", "gate_failed")
        return with_results and self.directory is not None

    @cached_property
    def figures(self) -> AdjustmentFigures:
        """Figures of the adjustment beyond the contract of summary.json."""
        return figures_of(None if self.summary is None else self.summary.model_extra)

    @cached_property
    def check(self) -> CheckFigures | None:
        """Figures of the direct-georeferencing check; None if it made none."""
        direct = None if self.summary is None else self.summary.direct_georeferencing
        return None if direct is None else CheckFigures.model_validate(direct.model_dump())

    @cached_property
    def published(self) -> dict[str, Artifact]:
        """What this run has published, by the names of the manifest; not what others left beside it."""
        manifest = None if not self.has_results or self.directory is None else read_manifest(self.directory)
        if manifest is None or self.directory is None:
            return {}
        own = {(stage.stage, stage.key) for stage in manifest.stages}
        return {
            name: Artifact(name, self.directory / entry.file, entry.sha256, entry.rows)
            for name, entry in manifest.artifacts.items()
            if (entry.stage, entry.key) in own
        }

    def address(self, artifact: Artifact) -> str | None:
        """Where a published file is served; None: nowhere."""
        return None if self.results is None else f"{self.results}/{quote(artifact.path.name, safe='')}"
