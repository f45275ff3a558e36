"""Location of the registry of calibrations: an option, the environment, or the user's data folder."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import platformdirs

from tasks.database.address import DatabaseAddress, Holding, database_address

#: The variable that names the registry; ``--registry`` goes before it.
REGISTRY_VARIABLE = "AEROCAL_REGISTRY"
#: What messages call it.
REGISTRY = Holding("registry", f"--registry or {REGISTRY_VARIABLE}")


def registry_address(
    option: str | None = None, environment: Mapping[str, str] = os.environ
) -> DatabaseAddress:
    """Address of the registry: the option, otherwise the environment, otherwise a file of this user.

    Parameters
    ----------
    option : value of ``--registry``; a path or a URL.

    Raises
    ------
    InputError
        If it is neither; the text is not repeated, for it may hold a password.
    """
    of_this_user = Path(platformdirs.user_data_dir("aerocal")) / "registry.sqlite"
    text = option or environment.get(REGISTRY_VARIABLE) or str(of_this_user)
    return database_address(text, REGISTRY, environment)
