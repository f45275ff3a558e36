"""Read what ``aerocal image-quality`` is to examine: of a project, of a file of its own, or one image."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

from tasks.errors import Location
from tasks.settings.base import PathContext
from tasks.settings.image_quality import ImageQualityFile, ImageQualitySettings
from tasks.settings.load import is_project_file, load_project
from tasks.settings.project import Project
from tasks.settings.settings_file import SettingsFile, SettingsKind, read_settings_file

IMAGE_QUALITY_FILE = SettingsKind(ImageQualityFile, "file of image quality", "docs/image-quality.md")


@dataclass(frozen=True)
class Examination:
    """Images to be examined.

    Attributes
    ----------
    settings : which, and what is known of them.
    project : the project they are of, for the movement of its exposures; None: they stand alone.
    """

    settings: ImageQualitySettings
    project: Project | None = None


def load_image_quality(
    source: Path,
    overrides: Sequence[str] = (),
    data: Path | None = None,
    roots: Sequence[Path] = (),
    environment: Mapping[str, str] | None = None,
) -> Examination:
    """The examination that a source describes.

    Parameters
    ----------
    source : a project file with a table [image_quality], a file with this table alone, or an image.
    overrides : texts ``a.b.c=VALUE``.
    data : a second folder for relative paths.
    roots : folders that every input file must lie under (deployments); empty: anywhere.
    environment : variables for ``${NAME}``; by default those of the process.

    Raises
    ------
    InputError
        As of `tasks.settings.load.load_project`; if the project has no such table; if the movement of images
        is to be compared that belong to no project.
    """
    roots = tuple(roots)
    if source.suffix.lower() != ".toml":
        content = {"version": 1, "image_quality": {"images": str(source.absolute()), "name": source.name}}
        file = SettingsFile(IMAGE_QUALITY_FILE, source, "", content)
        return _alone(file, overrides, PathContext(Path.cwd(), data, environment={}, roots=roots))
    if not is_project_file(str(source)):
        file = read_settings_file(source, IMAGE_QUALITY_FILE, links=not roots)
        context = PathContext(source.resolve().parent, data, roots=roots)
        known = context if environment is None else replace(context, environment=environment)
        return _alone(file, overrides, known)
    project = load_project(source, overrides, data, environment=environment, roots=roots)
    if project.image_quality is None:
        raise Location(source).error(
            "The project has no table [image_quality].", "Add it: docs/image-quality.md shows how."
        )
    settings = project.image_quality
    camera = project.cameras.get(settings.camera or "")
    if settings.identity is None and camera is not None:
        settings = settings.model_copy(update={"identity": camera.identity})
    return Examination(settings, project)


def _alone(file: SettingsFile, overrides: Sequence[str], context: PathContext) -> Examination:
    """The content of a file without a project."""
    file.replace(overrides)
    settings = cast(ImageQualityFile, file.validated(context)).image_quality
    if settings.motion is not None:
        raise Location(file.path, entity="image_quality.motion").error(
            "The movement of images that belong to no project is not known.",
            "Put the table [image_quality] into the project file of their exposures.",
        )
    return Examination(settings)
