"""The page of an examination of images: ``image_quality.html``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tasks.documents.image_quality.material import read_quality
from tasks.documents.image_quality.page import render
from tasks.documents.report.provenance import SOFTWARE
from tasks.settings.image_quality import ImageQualitySettings
from tasks.store.artifact import Artifact
from tasks.store.store import stored

PAGE = "image_quality.html"


@stored("image_quality_page")
def write_image_quality_page(
    folder: Path,
    *,
    stages: tuple[Mapping[str, Artifact], ...],
    settings: ImageQualitySettings,
    name: str,
    software: Mapping[str, str] = SOFTWARE,
) -> None:
    """Write image_quality.html.

    Parameters
    ----------
    stages : outputs of the examinations of scenes and sensor, those there are.
    name : title of the page (it is not part of the settings' content).
    software : versions that decide how the page looks.
    """
    page = render(read_quality(stages, settings), name, software)
    (folder / PAGE).write_text(page, encoding="utf-8")
