"""Several processes at the same moment, without the start of a program."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from multiprocessing.connection import Connection as Pipe

from tasks.errors import AerocalError

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
