"""Read what ``aerocal image-quality`` is to examine: of a project, of a file of its own, or one image."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import cast

from tasks.errors import InputError
from tasks.settings.base import PathContext
from tasks.settings.image_quality import ImageQualityFile, ImageQualitySettings
from tasks.settings.load import is_project_file, load_project
from tasks.settings.settings_file import SettingsFile, SettingsKind, read_settings_file

IMAGE_QUALITY_FILE = SettingsKind(ImageQualityFile, "file of image quality", "docs/image-quality.md")


def load_image_quality(
    source: Path, overrides: Sequence[str] = (), data: Path | None = None
) -> ImageQualitySettings:
    """The settings that a source means.

    Parameters
    ----------
    source : a project file with a table [image_quality], a file with this table alone, or an image.
    overrides : texts ``a.b.c=VALUE``.
    data : a second folder for relative paths.

    Raises
    ------
    InputError
        As of `tasks.settings.load.load_project`; if the project has no such table.
    """
    if source.suffix.lower() != ".toml":
        content = {"version": 1, "image_quality": {"images": str(source.absolute()), "name": source.name}}
        file = SettingsFile(IMAGE_QUALITY_FILE, source, "", content)
        return _validated(file, overrides, PathContext(Path.cwd(), data, environment={}))
    if not is_project_file(str(source)):
        file = read_settings_file(source, IMAGE_QUALITY_FILE)
        return _validated(file, overrides, PathContext(source.resolve().parent, data))
    settings = load_project(source, overrides, data).image_quality
    if settings is None:
        raise InputError(
            "The project has no table [image_quality].",
            "Add it: docs/image-quality.md shows how.",
            file=source,
        )
    return settings


def _validated(file: SettingsFile, overrides: Sequence[str], context: PathContext) -> ImageQualitySettings:
    file.replace(overrides)
    return cast(ImageQualityFile, file.validated(context)).image_quality
