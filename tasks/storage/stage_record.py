"""What the stages of the current run did: one line of JSON each in ``DIR/.store/run.jsonl``.

The story passes artifacts on and need not carry book-keeping; publishing reads it here. The file
belongs to the run that holds the lock, which empties it when it begins; lines are appended whole,
so stages that run beside each other, in other threads or processes, do not disturb one another.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import cast

from tasks.storage.artifact import Artifact
from tasks.storage.json_text import JSON, json_text
from tasks.storage.stage_key import InputFile, StageKey

_FILE = "run.jsonl"


@dataclass(frozen=True)
class StageRecord:
    """One stage of the current run.

    Attributes
    ----------
    stage, key : which stage, and the key of its output.
    reused : whether the output was found in the store.
    started : when it began, ISO 8601, UTC.
    seconds : time the stage took in this run.
    outputs : file name → digest of its bytes.
    inputs : path of a delivered file the stage read → digest of its bytes.
    """

    stage: str
    key: str
    reused: bool
    started: str
    seconds: float
    outputs: Mapping[str, str]
    inputs: Mapping[str, str]

    @classmethod
    def of(
        cls,
        key: StageKey,
        outputs: Mapping[str, Artifact],
        reused: bool,
        started: str,
        seconds: float,
        inputs: tuple[InputFile, ...],
    ) -> StageRecord:
        """Describe a stage that has just ended."""
        return cls(
            key.stage,
            key.digest,
            reused,
            started,
            round(seconds, 3),
            {artifact.path.name: artifact.sha256 for artifact in outputs.values()},
            {str(file.path): file.sha256 for file in inputs},
        )


def append_record(folder: Path, record: StageRecord) -> None:
    """Add a record to the store `folder`."""
    line = (json_text(cast(JSON, asdict(record))) + "\n").encode()
    handle = os.open(folder / _FILE, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    try:
        os.write(handle, line)
    finally:
        os.close(handle)


def clear_records(folder: Path) -> None:
    """Forget the records of the last run."""
    (folder / _FILE).unlink(missing_ok=True)


def read_records(folder: Path) -> tuple[StageRecord, ...]:
    """The records of the current run, in the order in which the stages ended."""
    path = folder / _FILE
    if not path.is_file():
        return ()
    return tuple(StageRecord(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines())


def timings_s(records: Sequence[StageRecord]) -> dict[str, float]:
    """Seconds by stage, and their sum as ``total``."""
    seconds: dict[str, float] = {}
    for record in records:
        seconds[record.stage] = seconds.get(record.stage, 0.0) + record.seconds
    seconds["total"] = sum(seconds.values())
    return {stage: round(value, 3) for stage, value in seconds.items()}


def utc_now() -> str:
    """The time now, ISO 8601 with milliseconds, UTC."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")
