"""Work of a worker of a Dask cluster: check that it may be used, then carry out a call.

A worker outlives the runs it works for, so it keeps no knowledge of them: every call states what it expects
of its worker. This also covers a worker that joins during a run.
"""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from flows.runs.workers import THREADS_VARIABLE
from tasks.files.installation import InstallationError
from tasks.store.software import Software, software_here


@dataclass(frozen=True)
class Trouble:
    """Why a worker cannot be used: what is wrong with it, and the remedy."""

    what: str
    remedy: str

    def of(self, worker: str) -> InstallationError:
        """The error that names the worker."""
        return InstallationError(f"The Dask worker {worker} {self.what}.", self.remedy)


@dataclass(frozen=True)
class Expected:
    """What every worker of a run must have in common with it.

    Attributes
    ----------
    software : the software of the run.
    words : a file and its text, in every folder the workers read from and write to.
    environment : (name, value) of variables that decide what is read; None: not set.
    """

    software: Software
    words: tuple[tuple[Path, str], ...]
    environment: tuple[tuple[str, str | None], ...] = ()

    def trouble(self, threads: int) -> Trouble | None:
        """Why this process cannot be used; None if it can.

        Parameters
        ----------
        threads : how many calls the worker carries out at once.
        """
        return next(self._troubles(threads), None)

    def _troubles(self, threads: int) -> Iterator[Trouble]:
        differences = self.software.differences(software_here())
        if differences:
            yield Trouble(
                f"uses different software from this run ({'; '.join(differences)}), so its results could "
                "differ",
                "Install the same on all machines, and start the scheduler and its workers again.",
            )
        if threads != 1:
            yield Trouble(
                f"has {threads} threads, but a worker uses only one",
                f"Start `dask worker ADDRESS --nthreads 1 --nworkers {threads}` instead.",
            )
        for file, text in self.words:
            if _text_in(file) != text:
                yield Trouble(
                    f"does not see what this run writes to {file.parent}",
                    "Put the project and its results into a folder that all machines share under one path.",
                )
        others = [name for name, value in self.environment if os.environ.get(name) != value]
        if others:
            # The values are nobody's business.
            yield Trouble(
                f"has {' and '.join(others)} set differently from this run",
                "Start it with the same environment.",
            )


def _text_in(file: Path) -> str | None:
    try:
        return file.read_text(encoding="utf-8")
    except OSError:
        return None


def examine(expected: Expected, dask_worker: Any) -> tuple[Trouble | None, str]:
    """Examine a worker before a run: why it cannot be used, and its kind of processor.

    Parameters
    ----------
    dask_worker : the worker itself; Dask fills it in.
    """
    return expected.trouble(dask_worker.state.nthreads), software_here().processor


@dataclass(frozen=True)
class Call:
    """A call of a function, to be carried out by a worker.

    The function and its arguments travel packed, as they do to a worker process, so that Dask neither
    searches them nor loads them in the scheduler.

    Attributes
    ----------
    packed : function, arguments, keyword arguments.
    name : of the function, for the page of the cluster.
    expected : what the worker must have in common with the run.
    """

    packed: bytes = field(repr=False)
    name: str
    expected: Expected = field(repr=False)

    @classmethod
    def of(
        cls,
        function: Callable[..., Any],
        arguments: tuple[Any, ...],
        keywords: Mapping[str, Any],
        expected: Expected,
    ) -> Call:
        """Pack a call."""
        name = getattr(function, "__name__", "call")
        return cls(pickle.dumps((function, arguments, dict(keywords))), name, expected)

    @property
    def __name__(self) -> str:
        """The name under which Dask learns the usual duration of the work."""
        return self.name

    def __call__(self) -> Any:
        """Carry out the call, on one thread.

        Raises
        ------
        InstallationError
            If the worker cannot be used.
        """
        _require_fit(self.expected)
        os.environ[THREADS_VARIABLE] = "1"
        function, arguments, keywords = pickle.loads(self.packed)
        return function(*arguments, **keywords)


@cache
def _require_fit(expected: Expected) -> None:
    """Check this worker, once for each run."""
    from distributed import get_worker

    worker = get_worker()
    trouble = expected.trouble(worker.state.nthreads)
    if trouble is not None:
        raise trouble.of(worker.address)
