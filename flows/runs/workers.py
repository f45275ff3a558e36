"""Who carries out the runs of a stage: processes of this machine, or the workers of a Dask cluster.

A stage needs only an executor of the standard library, so anything that offers one can be used. Every
worker computes on one thread; results do not depend on the number of workers. A worker ends with the
process it works for, in whatever way that ends, so that a killed sweep leaves nothing running.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from multiprocessing import connection
from pathlib import Path

from flows.runs.freed_memory import keep_freed_memory
from tasks.files.installation import InstallationError

#: How many threads an adjustment may use; read by `adjust.options`.
THREADS_VARIABLE = "AEROCAL_THREADS"


def processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def processes(workers: int | None) -> Iterator[Executor | None]:
    """An executor of so many worker processes while the context lasts.

    Parameters
    ----------
    workers : their number; None: one per processor. With one worker there is nothing to hand over, and
        the executor is None.

    Raises
    ------
    InstallationError
        If a worker is ended from outside.
    """
    count = processors() if workers is None else workers
    if count == 1:
        yield None
        return
    others = set(multiprocessing.active_children())
    # Fresh processes: a fork would inherit threads in the middle of their work.
    executor = ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), _begin)
    try:
        yield executor
    except BrokenProcessPool as error:
        raise InstallationError(
            "A worker process was terminated from outside, most likely because the memory was full.",
            "Run again with fewer workers; completed stages are kept.",
        ) from error
    except BaseException:
        # Interrupted, or a defect: what the workers are doing is of no use any more.
        for worker in set(multiprocessing.active_children()) - others:
            worker.terminate()
        raise
    finally:
        executor.shutdown(cancel_futures=True)


def _begin() -> None:
    """Prepare a worker: one thread, ignores the interrupt key, ends with the process it works for."""
    os.environ[THREADS_VARIABLE] = "1"
    keep_freed_memory()
    # The key reaches the whole group; the process that holds the workers decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


#: Address of the scheduler of a Dask cluster; not set, or ``none``: there is no cluster.
DASK_VARIABLE = "AEROCAL_DASK"


def use_cluster(option: str | None) -> None:
    """Store the value of ``--dask`` for every run of this process; None changes nothing."""
    if option is not None:
        os.environ[DASK_VARIABLE] = option


def cluster_address() -> str | None:
    """Address of the scheduler that runs are to use; None: there is none."""
    address = os.environ.get(DASK_VARIABLE, "").strip()
    return None if address in ("", "none") else address


def workers(
    count: int | None, folders: Sequence[Path], variables: Sequence[str] = ()
) -> AbstractContextManager[Executor | None]:
    """An executor while the context lasts: of the cluster if there is one, else of processes.

    Parameters
    ----------
    count : number of processes of this machine, as of `flows.runs.workers.processes`; a cluster has its own.
    folders : existing folders that the workers of a cluster read from and write to.
    variables : names of variables of the environment that decide what a worker reads.

    Raises
    ------
    InstallationError
        If a worker is ended from outside, or the cluster cannot be used.
    """
    address = cluster_address()
    if address is None:
        return processes(count)
    # Dask takes a second to load.
    from flows.runs.cluster import cluster

    return cluster(address, folders, variables)
