"""Worker processes on this machine: where the runs of a stage are carried out beside each other.

An executor of the standard library is all a stage asks for, so anything that offers one can stand in for it.
Every worker computes on one thread; results do not depend on the number of workers. A worker ends with the
process it works for, however that ends, so that a killed sweep leaves nothing running.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import connection

from tasks.storage.installation import InstallationError

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
    workers : their number; None: one for each processor. With one worker there is nothing to hand over, and
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
            "A worker process was ended from outside, most likely because the memory was full.",
            "Run again with fewer workers; what is finished is kept.",
        ) from error
    except BaseException:
        # Interrupted, or a defect: what the workers are doing is of no use any more.
        for worker in set(multiprocessing.active_children()) - others:
            worker.terminate()
        raise
    finally:
        executor.shutdown(cancel_futures=True)


def _begin() -> None:
    """Prepare a worker: one thread, deaf to the interrupt key, bound to the process it works for."""
    os.environ[THREADS_VARIABLE] = "1"
    # The key reaches the whole group; the process that holds the workers decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)
