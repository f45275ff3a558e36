"""The software of a computation: the sources of this application, the libraries, the processor.

Two processes that agree on sources and libraries write the same bytes on machines of one kind, so they may
share a store and the work of one run.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.metadata import version

from llvmlite import binding

from tasks.store.source_digest import digest_of_application
from tasks.store.stage_key import library_versions

#: Carry work from one process to another.
_CARRIERS = ("dask", "distributed", "cloudpickle")


@dataclass(frozen=True)
class Software:
    """The software a process uses.

    Attributes
    ----------
    sources : digest of all source files of this application.
    versions : (library, version) of what a result may depend on, and of what carries work between processes.
    processor : kind of processor the kernels are compiled for.
    """

    sources: str
    versions: tuple[tuple[str, str], ...]
    processor: str

    def differences(self, other: Software) -> tuple[str, ...]:
        """In words, how `other` differs in what must be equal for equal bytes."""
        own, others = dict(self.versions), dict(other.versions)
        found = [
            f"{name} {others.get(name, 'missing')} in place of {own.get(name, 'none')}"
            for name in sorted({*own, *others})
            if own.get(name) != others.get(name)
        ]
        return (*found, *(("other source files of aerocal",) if self.sources != other.sources else ()))


@cache
def software_here() -> Software:
    """The software of this process when first requested, which is what it has loaded."""
    versions = {**library_versions(), **{name: version(name) for name in _CARRIERS}}
    return Software(digest_of_application(), tuple(sorted(versions.items())), binding.get_host_cpu_name())
