"""Read a project file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast

from tasks.settings.base import PathContext
from tasks.settings.project import Project
from tasks.settings.settings_file import SettingsKind, read_settings_file

PROJECT_FILE = SettingsKind(Project, "project file", "docs/project-file.md")


def load_project(
    path: Path,
    overrides: Sequence[str] = (),
    data: Path | None = None,
    *,
    environment: Mapping[str, str] | None = None,
    roots: Sequence[Path] = (),
) -> Project:
    """Read and validate a project file.

    Parameters
    ----------
    path : the TOML file; relative paths in it start at its folder.
    overrides : texts ``a.b.c=VALUE``; VALUE is parsed as TOML, else taken as text.
    data : a second folder for relative paths, and the value of ``${AEROCAL_TEST_DATA}`` when that is not set.
    environment : variables for ``${NAME}``; by default those of the process.
    roots : folders that every input file must lie under (deployments); empty: anywhere.

    Raises
    ------
    InputError
        With the file, the line and the key: not TOML, an unknown or missing key, a value that cannot be, a
        file that does not exist, a variable that is not set.
    """
    source = read_settings_file(path, PROJECT_FILE)
    source.replace(overrides)
    context = PathContext(path.resolve().parent, data, roots=tuple(roots))
    if environment is not None:
        context = replace(context, environment=environment)
    return cast(Project, source.validated(context))
