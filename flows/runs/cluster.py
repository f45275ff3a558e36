"""A Dask cluster, which carries out the runs of a stage in parallel, also on other machines.

The client of a cluster offers an executor of the standard library, which is all a stage needs. Thus the same
cluster serves runs in process and inside a Prefect flow run, whereas Prefect's own task runner for Dask works
only inside flow runs and sends complete task runs. Here only references are transferred; the tables stay in a
folder shared by all machines.

If a worker dies, Dask repeats its work elsewhere. A stage may therefore be carried out twice, for which the
store is prepared.
"""

from __future__ import annotations

import logging
import os
import threading
import uuid
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Executor, Future
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from distributed import Client, KilledWorker

from flows.runs.cluster_worker import Call, Expected, Trouble, examine
from tasks.files.installation import InstallationError, writing_into
from tasks.store.software import software_here

P = ParamSpec("P")
R = TypeVar("R")

_CONNECT_S = 10.0
_FIRST_WORKER_S = 10.0
#: How often it is looked whether there are workers, and how long a run waits for one to come back.
_LOOK_S = 5.0
_WAIT_S = 300.0
_START = "`dask worker ADDRESS --nthreads 1 --nworkers N`"
_KEPT = "completed work is kept."

_log = logging.getLogger("aerocal")


class ClusterExecutor(Executor):
    """An executor whose calls are carried out by the workers of a cluster.

    Attributes
    ----------
    given_up : why the calls that had not ended were given up; None if they were not.
    """

    def __init__(self, client: Client, expected: Expected) -> None:
        # Not pure: a call is carried out when it is requested, whatever the cluster did before.
        self._executor = client.get_executor(pure=False)
        self._expected = expected
        self.given_up: InstallationError | None = None

    def submit(self, fn: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> Future[R]:
        """Hand a call to the cluster."""
        future: Future[R] = self._executor.submit(Call.of(fn, args, kwargs, self._expected))
        return future

    def give_up(self, reason: InstallationError) -> None:
        """Cancel everything that has not ended."""
        self.given_up = reason
        self._executor.shutdown(wait=False)


@contextmanager
def cluster(
    address: str, folders: Sequence[Path], variables: Sequence[str] = ()
) -> Iterator[ClusterExecutor]:
    """An executor of a cluster while the context lasts.

    Parameters
    ----------
    address : of the scheduler, as Dask writes it: ``tcp://HOST:8786``, ``tls://HOST:8786``.
    folders : existing folders that the workers read from and write to.
    variables : names of variables of the environment that must have the same values there.

    Raises
    ------
    InstallationError
        If the scheduler is not reached or is lost; if a worker does not see the folders, or computes with
        other software, on several threads or in another environment; if workers die again and again over a
        call, or none is left.
    """
    for name in ("distributed.batched", "distributed.client"):
        # What is wrong with the connection is said below, in one sentence.
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with ExitStack() as ends:
        client = _connected(address)
        # With the client goes what it has requested and is not computed yet.
        ends.callback(_disconnect, client)
        words = tuple(ends.enter_context(_words_in(folder)) for folder in folders)
        environment = tuple((name, os.environ.get(name)) for name in variables)
        expected = Expected(software_here(), words, environment)
        _examine_workers(client, address, expected)
        executor = ClusterExecutor(client, expected)
        ends.enter_context(_watched(client, address, executor))
        try:
            yield executor
        except KilledWorker as error:
            raise InstallationError(
                f"Workers of {address} died repeatedly on the same task, most likely because the "
                "memory was full.",
                f"Start fewer workers, or give them more memory (--memory-limit); {_KEPT}",
            ) from error
        except CancelledError as error:
            raise executor.given_up or InstallationError(
                f"The Dask scheduler {address} stopped or was restarted during the computation.",
                f"Start it and its workers again, then run again; {_KEPT}",
            ) from error


def _connected(address: str) -> Client:
    try:
        return Client(address, timeout=_CONNECT_S, set_as_default=False, name="aerocal")
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        raise InstallationError(
            f"The Dask scheduler {address} cannot be reached ({error}).",
            "Start it with `dask scheduler`, correct --dask or AEROCAL_DASK, or compute on this machine with "
            "--dask none.",
        ) from error


def _disconnect(client: Client) -> None:
    # A scheduler that is gone makes no difference any more.
    with suppress(OSError, TimeoutError, RuntimeError):
        client.close(timeout=_CONNECT_S)


@contextmanager
def _words_in(folder: Path) -> Iterator[tuple[Path, str]]:
    """A file in a folder, by which a worker proves that it sees the same files."""
    text = uuid.uuid4().hex
    # Named like a published file that is being written: what a killed run leaves is removed by the next.
    file = folder / f".{text}.{os.getpid()}.tmp"
    with writing_into(folder):
        file.write_text(text, encoding="utf-8")
    try:
        yield file, text
    finally:
        file.unlink(missing_ok=True)


def _examine_workers(client: Client, address: str, expected: Expected) -> None:
    """Ask every worker whether it can be used, before anything is computed."""
    try:
        client.wait_for_workers(1, timeout=_FIRST_WORKER_S)
    except TimeoutError as error:
        raise InstallationError(
            f"The Dask scheduler {address} has no workers.", f"Start some with {_START}."
        ) from error
    found: Mapping[str, Any] = client.run(examine, expected, on_error="return")
    for worker, answer in found.items():
        if isinstance(answer, Exception):
            trouble: Trouble | None = Trouble(
                f"cannot load the version of aerocal used here ({answer})",
                f"Start it in the same environment: {_START}.",
            )
        else:
            trouble, _processor = answer
        if trouble is not None:
            raise trouble.of(worker)
    processors = Counter(processor for _trouble, processor in found.values())
    _log.info("cluster %s: %d workers", address, len(found))
    if set(processors) != {expected.software.processor}:
        _log.warning(
            "cluster %s: processors differ (%s; here %s), so that results may differ in their last digits",
            address,
            ", ".join(f"{count} × {name}" for name, count in sorted(processors.items())),
            expected.software.processor,
        )


@contextmanager
def _watched(client: Client, address: str, executor: ClusterExecutor) -> Iterator[None]:
    """While the context lasts, prevent endless waiting for workers that do not come back."""
    over = threading.Event()
    watch = threading.Thread(target=_watch, args=(client, address, executor, over), daemon=True)
    watch.start()
    try:
        yield
    finally:
        over.set()
        watch.join(_LOOK_S)


def _watch(client: Client, address: str, executor: ClusterExecutor, over: threading.Event) -> None:
    missing_s = 0.0
    while not over.wait(_LOOK_S):
        # A scheduler that is gone ends the calls by itself.
        with suppress(Exception):
            if client.nthreads():
                missing_s = 0.0
                continue
            if missing_s == 0.0:
                _log.warning("cluster %s: no workers left; waiting for one to return", address)
            missing_s += _LOOK_S
        if missing_s >= _WAIT_S:
            executor.give_up(
                InstallationError(
                    f"The Dask scheduler {address} has no workers left, and none has returned within "
                    f"{_WAIT_S:.0f} s.",
                    f"Start some with {_START}, then run again; {_KEPT}",
                )
            )
            return
