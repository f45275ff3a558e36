"""Processes of runs, forked from one that has loaded what they need.

Prefect starts a program for each run, which loads Prefect and the libraries for four seconds of processor
time: longer than a small block is adjusted. Here Python's own fork server (`multiprocessing.forkserver`)
loads them once, when the first run begins. It ends with the runner, and is started again if it was killed.
"""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import anyio
from anyio.to_thread import run_sync
from prefect.runner._process_manager import ProcessHandle

if TYPE_CHECKING:
    from anyio.abc import TaskStatus
    from prefect.client.schemas.objects import FlowRun
    from prefect.runner._control_channel import ControlChannel

# Option of prctl(2): PR_SET_PDEATHSIG, in linux/prctl.h.
_SIGNAL_AT_PARENTS_END = 1


class ForkingStarter:
    """Starts the process of a run for Prefect's runner (its ``ProcessStarter``).

    Parameters
    ----------
    folder : the working folder of all runs.
    control : tells the process of a run that it is to be cancelled.
    """

    def __init__(self, folder: Path, control: ControlChannel) -> None:
        self._folder, self._control = folder, control
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(["flows.serving.preload"])
        # A process that starts collects the exit codes of those that have ended, too.
        self._one_at_a_time = threading.Lock()

    async def start(
        self, flow_run: FlowRun, task_status: TaskStatus[ProcessHandle] = anyio.TASK_STATUS_IGNORED
    ) -> None:
        """Start the process of a run, report it, and wait until it has ended."""
        # What becomes of a run that is cancelled or has crashed is up to the runner.
        variables = {
            "PREFECT__FLOW_RUN_ID": str(flow_run.id),
            "PREFECT__ENABLE_CANCELLATION_AND_CRASHED_HOOKS": "false",
        }
        # Without such a channel the process is killed when its run is cancelled.
        with contextlib.suppress(RuntimeError):
            port, token = self._control.register(flow_run.id)
            variables |= {"PREFECT__CONTROL_PORT": str(port), "PREFECT__CONTROL_TOKEN": token}
        process = self._context.Process(target=_carry_out, args=(variables, self._folder))
        try:
            # The first one waits until everything is loaded.
            await run_sync(self._alone, process.start)
        except BaseException:
            self._control.unregister(flow_run.id)
            raise
        task_status.started(ProcessHandle(process))  # type: ignore[arg-type] # says that it is a spawned one
        try:
            await anyio.wait_readable(process.sentinel)
        except BaseException:
            process.kill()
            raise
        await run_sync(self._alone, process.join)

    def _alone(self, act: Callable[[], None]) -> None:
        with self._one_at_a_time:
            act()


def _carry_out(variables: Mapping[str, str], folder: Path) -> None:
    """The process of a run; what was changed since it was loaded is loaded again."""
    # Without the fork server the runner does not know of it any more and starts the run again.
    if (prctl := getattr(ctypes.CDLL(None), "prctl", None)) is not None:
        prctl(_SIGNAL_AT_PARENTS_END, signal.SIGKILL)
    os.environ.update(variables)
    os.chdir(folder)
    from flows.serving import engine, preload

    if preload.installed() != preload.LOADED:
        os.execv(sys.executable, [sys.executable, "-P", "-m", engine.__name__])
    engine.main()
