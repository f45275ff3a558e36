"""Which extensions are installed, with digests of their sources: results depend on them as on libraries."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from adjust.errors import ExtensionError
from adjust.extensions import Extension, installed_extensions
from tasks.errors import InputError


def extension_versions() -> Mapping[str, str]:
    """Version and digest of the sources of every package that adds something, by its name.

    Raises
    ------
    InputError
        If two packages add the same.
    """
    try:
        found = installed_extensions()
    except ExtensionError as error:
        raise InputError(str(error), "Run again after that.") from error
    packages: dict[str, dict[str, str]] = {}
    for extension in found:
        packages.setdefault(f"{extension.distribution} {extension.version}", {}).update(_sources(extension))
    return {
        f"extension {name}": hashlib.sha256(repr(sorted(sources.items())).encode()).hexdigest()[:16]
        for name, sources in packages.items()
    }


def _sources(extension: Extension) -> dict[str, str]:
    """Digests of the Python files of the top-level package, or the module, that an extension is in."""
    top = extension.module.partition(".")[0]
    spec = find_spec(top)
    if spec is None or spec.origin is None:
        return {top: "missing"}
    origin = Path(spec.origin)
    files = sorted(origin.parent.rglob("*.py")) if spec.submodule_search_locations else [origin]
    return {
        f"{top}/{file.relative_to(origin.parent).as_posix()}": hashlib.sha256(file.read_bytes()).hexdigest()
        for file in files
    }
