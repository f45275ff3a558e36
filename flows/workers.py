"""Who carries out the runs of a stage: processes of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from pathlib import Path

from flows.processes import processes

#: Address of the scheduler of a Dask cluster; not set, or ``none``: there is no cluster.
DASK_VARIABLE = "AEROCAL_DASK"


def use_cluster(option: str | None) -> None:
    """Keep the value of an option ``--dask`` where every run of this process finds it; None: as it is."""
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
    count : number of processes of this machine, as of `flows.processes.processes`; a cluster has its own.
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
    from flows.cluster import cluster

    return cluster(address, folders, variables)
