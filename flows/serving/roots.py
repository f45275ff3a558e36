"""The folders that runs of a deployment may read and write, whatever their parameters say."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tasks.errors import InputError
from tasks.plain_text import UNSEEN, quoted, trouble_in

#: Set by ``aerocal serve`` for its runner and what the runner starts: a JSON list of folders.
ROOTS_VARIABLE = "AEROCAL_ROOTS"


#: The same for a form: what `output_name` lets pass, but for its length.
OUTPUT_PATTERN = rf"^(?!\.|\s*$)[^/\\{UNSEEN}]+$(?!\n)"


def output_name(name: str) -> str:
    """A name that a folder of results may have: one that everybody sees, and no hidden folder.

    Raises
    ------
    ValueError
        If it may not.
    """
    if trouble_in(name) is not None or re.search(OUTPUT_PATTERN, name) is None:
        raise ValueError(f"{quoted(name)} is not the name of an output folder.")
    return name


@dataclass(frozen=True)
class Roots:
    """Folders a deployed run is confined to.

    Attributes
    ----------
    folders : absolute, links resolved; at least one.
    """

    folders: tuple[Path, ...]

    def hold(self, path: Path) -> bool:
        """Whether a path, all links resolved, lies under one of the folders; one that is none does not."""
        try:
            resolved = path.resolve()
        except (OSError, RuntimeError, ValueError):
            # Links in a circle, too long a name, a null character.
            return False
        return any(resolved.is_relative_to(folder) for folder in self.folders)

    def project_file(self, text: str) -> Path:
        """The project file that a parameter names.

        Parameters
        ----------
        text : path of a TOML file or of the folder of a ``project.toml``; absolute, or relative to one of
            the folders.

        Raises
        ------
        InputError
            If there is none under the folders. A path that leads outside is refused alike whether something
            is there or not.
        """
        if not text.strip() or "\0" in text:
            raise InputError("No project file is named.", self._remedy())
        for candidate in [folder / text for folder in self.folders]:
            try:
                if not self.hold(candidate):
                    continue
                file = candidate / "project.toml" if candidate.is_dir() else candidate
                if self.hold(file) and file.is_file():
                    return file.resolve()
            except (OSError, RuntimeError):
                # Too long a name, links in a circle: no file either way.
                continue
        raise InputError(f"There is no project file '{text}' in the folders of this server.", self._remedy())

    def output_folder(self, project_file: Path, name: str) -> Path:
        """The output folder of a run: a plain name beside the project file.

        Raises
        ------
        InputError
            If it is no plain name, or a link that leads out of the folders.
        """
        try:
            output_name(name)
        except ValueError as error:
            raise InputError(
                str(error),
                "Give one name without slashes and without a dot in front; the folder is made beside the "
                "project file.",
            ) from error
        folder = project_file.parent / name
        if not all(self.hold(one) for one in (folder, folder / ".store", folder / ".store" / "lock")):
            raise InputError(
                f"The output folder '{name}' leads out of the folders of this server.", "Remove the link."
            )
        return folder

    def _remedy(self) -> str:
        return "Give a path under one of: " + ", ".join(map(str, self.folders)) + "."


def roots_of(folders: Sequence[Path]) -> Roots:
    """The roots that are meant by folders as given.

    Raises
    ------
    InputError
        If one of them is no folder, or none is given.
    """
    for folder in folders:
        if not folder.is_dir():
            raise InputError(f"There is no folder {folder}.", "Correct --root, or make the folder.")
    if not folders:
        raise InputError("No folder is given that runs may read and write.", "Name one with --root.")
    return Roots(tuple(dict.fromkeys(folder.resolve() for folder in folders)))


def configured_roots(environment: Mapping[str, str] = os.environ) -> Roots:
    """The roots of this process, as the server that started it has set them.

    Raises
    ------
    InputError
        If it has not: a deployed run without roots may read nothing at all.
    """
    try:
        folders = json.loads(environment.get(ROOTS_VARIABLE, "[]"))
    except ValueError:
        folders = []
    if not isinstance(folders, list):
        folders = []
    return roots_of([Path(str(folder)) for folder in folders])


def as_variable(roots: Roots) -> str:
    """The value of ROOTS_VARIABLE that stands for these roots."""
    return json.dumps([str(folder) for folder in roots.folders])
