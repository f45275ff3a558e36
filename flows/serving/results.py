"""Where deployed runs keep their results besides the folder at the project: a prefix on object storage.

Configured when the server starts (``aerocal serve --results``), never by who starts a run. Each project has a
place of its own below the prefix, with the name of its root and its path in there.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from flows.serving.roots import Roots
from tasks.errors import InputError
from tasks.object_storage.address import ObjectAddress, address_of

#: Set by ``aerocal serve`` for its runner and what the runner starts: the address; nothing: there is none.
RESULTS_VARIABLE = "AEROCAL_RESULTS"


def results_of_server(option: str | None, roots: Roots) -> ObjectAddress | None:
    """The address that a server is told.

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
            f"Two folders are called '{alike[0]}': their projects would share places on object storage.",
            "Rename one, or give another --root.",
        )
    # Loaded only for an address, as the client of the storage is.
    from tasks.object_storage.storage import ObjectStorage

    ObjectStorage(address).require_access()
    return address


def configured_results(
    project_file: Path, output: str, roots: Roots, environment: Mapping[str, str] = os.environ
) -> ObjectAddress | None:
    """Where the results of a run of this process go on object storage; None: nowhere.

    Parameters
    ----------
    project_file : under one of the roots, links resolved.
    output : name of the output folder.

    Raises
    ------
    InputError
        If a name in the path cannot stand in an address.
    """
    text = environment.get(RESULTS_VARIABLE)
    if not text:
        return None
    folder = project_file.parent
    # The nearest one, should a root lie in another.
    holding = (root for root in roots.folders if folder.is_relative_to(root))
    root = max(holding, key=lambda path: len(path.parts))
    return address_of(text).below(root.name, *folder.relative_to(root).parts, output)
