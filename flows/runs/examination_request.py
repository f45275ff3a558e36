"""A request to examine images: a project with [image_quality], a file of its own, or one image."""

from __future__ import annotations

from pathlib import Path

from flows.runs.project_run import RunRequest
from tasks.settings.load_image_quality import Examination, load_image_quality

FOLDER = "image-quality"


class ExaminationRequest(RunRequest):
    """What to examine; results are in ``image-quality`` next to the source unless stated otherwise."""

    @property
    def directory(self) -> Path:
        """The output folder."""
        return self.project_file.parent / FOLDER if self.place is None else super().directory

    def read(self) -> Examination:
        """The examination.

        Raises
        ------
        InputError
            As of `load_image_quality`.
        """
        return load_image_quality(
            self.project_file, self.overrides, self.data, self.roots, environment=self._environment()
        )
