"""Several processes at the same moment, or one whose files cannot grow, without the start of a program."""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
from collections.abc import Callable
from multiprocessing.connection import Connection as Pipe

from tasks.errors import AerocalError
from tasks.files.installation import InstallationError

# Forked children need no second to import everything; each opens a connection of its own.
FORK = multiprocessing.get_context("fork")


def in_processes(count: int, work: Callable[[int], object]) -> list[str]:
    """Let processes do something at the same moment; what each returned, or the error it got."""
    together = FORK.Barrier(count)
    pipes = [FORK.Pipe(duplex=False) for _ in range(count)]

    def run(index: int, answer: Pipe) -> None:
        together.wait(30)
        try:
            answer.send(str(work(index)))
        except AerocalError as error:
            answer.send(f"{type(error).__name__}: {error}")

    processes = [FORK.Process(target=run, args=(i, pipes[i][1])) for i in range(count)]
    for process in processes:
        process.start()
    answers = [pipe.recv() if pipe.poll(60) else "no answer" for pipe, _ in pipes]
    for process in processes:
        process.join(30)
    return answers


def fails_with_files_of_at_most(size: int, work: Callable[[], object]) -> bool:
    """Whether work fails in a process whose files cannot be larger, as on a full disk."""

    def run() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
        try:
            work()
        except (OSError, InstallationError):
            os._exit(3)
        # Without what the process that was copied would do at its end.
        os._exit(0)

    process = FORK.Process(target=run)
    process.start()
    process.join()
    return process.exitcode == 3
