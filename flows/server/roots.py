"""The limits of a deployed run, whatever its parameters say: folders, object storage, registry.

Prefect hands parameters to a run and confines it to nothing. Everything here is set when the server starts
(``aerocal serve``), travels in the environment, and never comes from who starts a run.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter

from tasks.errors import InputError
from tasks.files.delivered_file import lies_under
from tasks.object_storage.address import ObjectAddress, address_of
from tasks.plain_text import UNSEEN, quoted, trouble_in
from tasks.settings.registry import REGISTRY_VARIABLE, registry_address

#: Set by ``aerocal serve`` for its runner and what the runner starts: a JSON list of folders.
ROOTS_VARIABLE = "AEROCAL_ROOTS"
_FOLDERS = TypeAdapter(list[Path])

#: The same for a form: what `output_name` lets pass, but for its length.
OUTPUT_PATTERN = rf"^(?!\.|\s*$)[^/\\{UNSEEN}]+$(?!\n)"


def output_name(name: str) -> str:
    """A permitted name of a results folder: visible characters only, and no hidden folder.

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
        """Whether a path, all links resolved, lies below one of the folders; an invalid path does not."""
        return lies_under(path, self.folders)

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
        """The output folder of a run: a plain name next to the project file.

        Raises
        ------
        InputError
            If it is not a plain name, or a link that leads out of the folders.
        """
        try:
            output_name(name)
        except ValueError as error:
            raise InputError(
                str(error),
                "Give a single name without slashes or a leading dot; the folder is created next to the "
                "project file.",
            ) from error
        folder = project_file.parent / name
        if not all(self.hold(one) for one in (folder, folder / ".store", folder / ".store" / "lock")):
            raise InputError(
                f"The output folder '{name}' leads outside the folders of this server.", "Remove the link."
            )
        return folder

    def _remedy(self) -> str:
        return "Give a path under one of: " + ", ".join(map(str, self.folders)) + "."


def roots_of(folders: Sequence[Path]) -> Roots:
    """The roots for folders as given.

    Raises
    ------
    InputError
        If one of them is not a folder, or none is given.
    """
    for folder in folders:
        if not folder.is_dir():
            raise InputError(f"There is no folder {folder}.", "Correct --root, or create the folder.")
    if not folders:
        raise InputError("No folder that runs may read and write is given.", "Name one with --root.")
    return Roots(tuple(dict.fromkeys(folder.resolve() for folder in folders)))


def configured_roots(environment: Mapping[str, str] = os.environ) -> Roots:
    """The roots of this process, as the server that started it has set them.

    Raises
    ------
    InputError
        If it has not: a deployed run without roots may read nothing at all.
    """
    try:
        folders = _FOLDERS.validate_json(environment.get(ROOTS_VARIABLE, "[]"))
    except ValueError:
        folders = []
    return roots_of(folders)


def as_variable(roots: Roots) -> str:
    """The value of ROOTS_VARIABLE for these roots."""
    return _FOLDERS.dump_json(list(roots.folders)).decode()


#: Set by ``aerocal serve`` for its runner and what the runner starts: the address; nothing: there is none.
RESULTS_VARIABLE = "AEROCAL_RESULTS"


def results_of_server(option: str | None, roots: Roots) -> ObjectAddress | None:
    """The address of the results that a server uses.

    Raises
    ------
    InputError
        If it is none, or two roots have one name, so that their projects would share places.
    InstallationError
        If the storage does not answer or refuses.
    """
    if option is None:
        return None
    address = address_of(option)
    alike = [name for name, number in Counter(folder.name for folder in roots.folders).items() if number > 1]
    if alike:
        raise InputError(
            f"Two folders are named '{alike[0]}': their projects would share locations on object storage.",
            "Rename one, or give another --root.",
        )
    # Loaded only for an address, as the client of the storage is.
    from tasks.object_storage.storage import ObjectStorage

    ObjectStorage(address).require_access()
    return address


def configured_results(
    project_file: Path, output: str, roots: Roots, environment: Mapping[str, str] = os.environ
) -> ObjectAddress | None:
    """Where the results of a run of this process are stored on object storage; None: nowhere.

    Parameters
    ----------
    project_file : under one of the roots, links resolved.
    output : name of the output folder.

    Raises
    ------
    InputError
        If a name in the path cannot be in an address.
    """
    text = environment.get(RESULTS_VARIABLE)
    if not text:
        return None
    folder = project_file.parent
    # The nearest one, should a root lie in another.
    holding = (root for root in roots.folders if folder.is_relative_to(root))
    root = max(holding, key=lambda path: len(path.parts))
    return address_of(text).below(root.name, *folder.relative_to(root).parts, output)


def registry_of_server(
    option: str | None, roots: Roots, environment: Mapping[str, str] = os.environ
) -> str | None:
    """The registry that runs of a server use, as the value of REGISTRY_VARIABLE for its runner.

    Parameters
    ----------
    option : value of ``--registry``.

    Returns
    -------
    address : absolute if it is a file; None if neither the option nor the environment names one.

    Raises
    ------
    InputError
        If it is not an address, or a file outside the folders of the server.
    """
    text = option or environment.get(REGISTRY_VARIABLE)
    if not text:
        return None
    file = registry_address(text, environment).file
    if file is None:
        return text
    if not roots.hold(file):
        raise InputError(
            f"The registry {file} lies outside the folders of this server.",
            f"Move it under one of them, or add its folder with --root; or name none ({REGISTRY_VARIABLE}).",
        )
    return str(file)


def registry_of_runner(roots: Roots, environment: Mapping[str, str] = os.environ) -> str:
    """The registry this process was given by the server that started it.

    Raises
    ------
    InputError
        If it was given none, or one outside its folders.
    """
    address = registry_of_server(None, roots, environment)
    if address is None:
        raise InputError("This server has no registry of calibrations.", "Start it with --registry ADDRESS.")
    return address
