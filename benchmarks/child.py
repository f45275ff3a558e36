"""A process of its own for each contender, so that its memory is its own: ``python -m benchmarks.child``.

Arguments: name of the contender, file of the problem, number of threads. Every line of the standard
input is an order: ``run``, or ``solution FILE``. Every order is answered by one line of JSON.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from benchmarks.contender import PEERS, contender
from benchmarks.machine import REPOSITORY, peak_memory_mib
from benchmarks.problem import Problem, Solution
from flows.runs.freed_memory import keep_freed_memory


@dataclass(frozen=True)
class Run:
    """One timed run.

    Attributes
    ----------
    seconds : wall clock.
    report : what the contender says about its iteration.
    peak_memory_mib : largest resident memory of its process so far.
    """

    seconds: float
    report: str
    peak_memory_mib: float


class Child:
    """The process of a contender, as its parent sees it; a context manager."""

    def __init__(self, name: str, problem: Path, threads: int) -> None:
        command = [sys.executable, "-m", "benchmarks.child", name, str(problem), str(threads)]
        self.process = subprocess.Popen(
            command, cwd=REPOSITORY, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.preparation_s = float(self._answer()["preparation_s"])

    def run(self) -> Run:
        """Let it run once from the start values."""
        return Run(**self._ask("run"))

    def solution(self, file: Path) -> Solution:
        """The adjusted values of its last run, handed over in a file."""
        self._ask(f"solution {file}")
        return Solution.read(file)

    def _ask(self, order: str) -> dict[str, Any]:
        assert self.process.stdin is not None
        print(order, file=self.process.stdin, flush=True)
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError(f"a contender ended with code {self.process.wait()}; see its messages above")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.process.communicate()


def main(name: str, problem: str, threads: str) -> None:
    """Serve the orders on the standard input until it ends."""
    if name not in PEERS:
        keep_freed_memory()  # as every process of aerocal
    arrays = Problem.read(Path(problem))
    begin = time.perf_counter()
    mine = contender(name, arrays, int(threads))
    _say(preparation_s=time.perf_counter() - begin)
    for line in sys.stdin:
        order, _, argument = line.strip().partition(" ")
        if order == "run":
            mine.reset()
            begin = time.perf_counter()
            report = mine.run()
            seconds = time.perf_counter() - begin
            _say(seconds=seconds, report=report, peak_memory_mib=peak_memory_mib())
        elif order == "solution":
            mine.solution().write(Path(argument))
            _say()
        else:
            raise ValueError(f"unknown order {order!r}")


def _say(**answer: float | str) -> None:
    print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
