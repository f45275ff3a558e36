"""The program ``aerocal`` with a clock at its stages: ``python -m benchmarks.command_child FILE ARGUMENTS``.

The readings go into FILE: one line of JSON for each stage, as :class:`Reading` has them.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchmarks.machine import REPOSITORY


@dataclass(frozen=True)
class Reading:
    """When a stage began and ended.

    Attributes
    ----------
    stage : name of the task function.
    begin_s, end_s : seconds of the clock that all processes of a machine share.
    begin_processor_s, end_processor_s : processor seconds of the process since it was started.
    """

    stage: str
    begin_s: float
    end_s: float
    begin_processor_s: float
    end_processor_s: float


def readings(file: Path) -> list[Reading]:
    """What a child has written."""
    return [Reading(**json.loads(line)) for line in file.read_text(encoding="utf-8").splitlines()]


def main(file: Path) -> None:
    """Carry out the command line; every stage adds its reading to the file."""
    from flows.command.__main__ import main as command_line
    from flows.runs.stage import Stage
    from tasks import errors

    # The program takes the folder it was started in out of the path: a copy would run the installed code.
    if not Path(errors.__file__).is_relative_to(REPOSITORY):
        raise RuntimeError(f"the code that runs is not that of {REPOSITORY}: set PYTHONPATH to it")
    plain: Any = Stage.__call__

    def timed(self: Any, *args: Any, **kwargs: Any) -> Any:
        begin, begin_processor = time.perf_counter(), time.process_time()
        result = plain(self, *args, **kwargs)
        reading = Reading(self.name, begin, time.perf_counter(), begin_processor, time.process_time())
        with file.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(asdict(reading)) + "\n")
        return result

    Stage.__call__ = timed  # type: ignore[method-assign]
    command_line()


if __name__ == "__main__":
    path = Path(sys.argv.pop(1))
    main(path)
