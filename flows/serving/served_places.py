"""The places of a server, which its deployments state to further runners: folders, registry, results.

A relative path is that of the first of the folders that has it. A run that needs a calibration from the
registry is wrong input without one, and results that nobody stores on object storage are missed there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from flows.server.settings import Settings
from tasks.errors import InputError

#: Key in the schema of a deployment's parameters, in which Prefect keeps what it does not know.
_KEY = "of_server"


@dataclass(frozen=True)
class ServedPlaces:
    """The places of a server.

    Attributes
    ----------
    folders : that its runs may read and write, in its order.
    registry : whether it has a registry of calibrations; its address may hold a password.
    results : address of the results on object storage; None: they are next to the projects only.
    """

    folders: tuple[Path, ...] = ()
    registry: bool = False
    results: str | None = None


_PLACES = TypeAdapter(ServedPlaces)


def places_of(settings: Settings) -> ServedPlaces:
    """The places of a server, or of a further runner, with these settings."""
    results = None if settings.results is None else str(settings.results)
    return ServedPlaces(settings.roots.folders, settings.registry is not None, results)


def schema_of(places: ServedPlaces) -> dict[str, Any]:
    """What a deployment states of them in the schema of its parameters."""
    return {_KEY: _PLACES.dump_python(places, mode="json")}


def places_in(schema: Mapping[str, Any] | None) -> ServedPlaces | None:
    """The places that the schema of a deployment states; None: that of an older server."""
    try:
        return _PLACES.validate_python((schema or {}).get(_KEY))
    except ValidationError:
        return None


def require_same(own: ServedPlaces, of_server: ServedPlaces) -> None:
    """Make sure that a run ends alike on a further runner and on the server.

    Raises
    ------
    InputError
        If only one of them has a registry, or they keep results at different addresses.
    """
    if own.registry != of_server.registry:
        has, lacks = ("server", "runner") if of_server.registry else ("runner", "server")
        raise InputError(
            f"The {has} has a registry of calibrations, and the {lacks} has none.",
            "Start both with the same --registry (or AEROCAL_REGISTRY).",
        )
    if own.results != of_server.results:
        raise InputError(
            f"The server stores results at {of_server.results or 'no address'}, and this runner at "
            f"{own.results or 'no address'}.",
            "Start both with the same --results.",
        )
