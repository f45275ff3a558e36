"""Read a project file, and the variants of it that its sweep computes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast

from tasks.errors import InputError, Location
from tasks.settings.base import PathContext
from tasks.settings.key_lines import line_of_key
from tasks.settings.project import Project, ProjectSource
from tasks.settings.settings_file import SettingsFile, SettingsKind, read_settings_file

PROJECT_FILE = SettingsKind(Project, "project file", "docs/project-file.md")


def is_project_file(source: str) -> bool:
    """Whether a text is the path of a project file, and not that of a specification or the name of a preset.

    A file that cannot be read is none; whoever reads it next says why.
    """
    try:
        content = read_settings_file(Path(source), PROJECT_FILE).content
    except InputError:
        return False
    return "inputs" in content or "cameras" in content


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
    source, context = _opened(path, overrides, data, environment, roots)
    origin = ProjectSource(source.sha256, tuple(map(_without_path, overrides)))
    return cast(Project, source.validated(context)).read_from(origin)


def load_variants(
    path: Path,
    overrides: Sequence[str] = (),
    data: Path | None = None,
    *,
    environment: Mapping[str, str] | None = None,
    roots: Sequence[Path] = (),
) -> dict[str, Project]:
    """The variants of a project's sweep by name, in their order: each a project with some settings changed.

    Parameters as of `load_project`.

    Raises
    ------
    InputError
        As `load_project`; if there is no sweep; with the variant, if what it changes is wrong.
    """
    source, context = _opened(path, overrides, data, environment, roots)
    sweep = cast(Project, source.validated(context)).sweep
    if sweep is None:
        raise Location(path).error("The project has no table [sweep].", "Add one: see docs/sweep.md.")
    variants = {}
    for name, changes in sweep.changes().items():
        place = ("sweep", "variants" if name in sweep.variants else "parameters", name)
        try:
            changed = source.changed(changes, f"Variant '{name}'", without="sweep")
            variants[name] = cast(Project, changed.validated(context))
        except InputError as error:
            what = error.what if error.entity is None else f"{error.entity}: {error.what}"
            line = line_of_key(source.text, place)
            raise Location(path, line, ".".join(place)).error(what, error.remedy) from error
    return variants


def _without_path(override: str) -> str:
    """An override as results state it: where a file lies is no part of them."""
    key, sign, value = override.partition("=")
    return f"{key}{sign}…" if "/" in value or "\\" in value else override


def _opened(
    path: Path,
    overrides: Sequence[str],
    data: Path | None,
    environment: Mapping[str, str] | None,
    roots: Sequence[Path],
) -> tuple[SettingsFile, PathContext]:
    """The file with its overrides, and how its paths are read."""
    source = read_settings_file(path, PROJECT_FILE, links=not roots)
    source.replace(overrides)
    context = PathContext(path.resolve().parent, data, roots=tuple(roots))
    if environment is not None:
        context = replace(context, environment=environment)
    return source, context
