"""The registry of calibrations of a server: named when it starts, looked at by schedule."""

from __future__ import annotations

import os
from collections.abc import Mapping

from flows.serving.roots import Roots
from tasks.errors import InputError
from tasks.settings.registry import REGISTRY_VARIABLE, registry_address


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
        If it is no address, or a file outside the folders of the server.
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
