"""What the stages of the current run did: one small file of JSON each in ``DIR/.store/run/``.

The story passes artifacts on and need not carry book-keeping; publishing reads it here. The folder
belongs to the run that holds the lock, which empties it when it begins. A file for each stage, because
stages run side by side, on other machines too, where lines appended to one file could be lost.
"""

from __future__ import annotations

import shutil
import time
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import cast

from tasks.files.json_text import JSON, from_json, json_text
from tasks.store.artifact import Artifact
from tasks.store.stage_key import InputFile, StageKey

_FOLDER = "run"
_EPOCH_NS = 2**62


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


def keep_record(folder: Path, record: StageRecord) -> None:
    """Add a record to the store `folder`."""
    records = folder / _FOLDER
    records.mkdir(exist_ok=True)
    # The names sort by the time at which the stages ended, also by a clock that is before 1970.
    name = f"{time.time_ns() + _EPOCH_NS:020d}-{uuid.uuid4().hex}.json"
    unfinished = records / f".{name}"
    unfinished.write_text(json_text(cast(JSON, asdict(record))), encoding="utf-8")
    unfinished.rename(records / name)


def clear_records(folder: Path) -> None:
    """Forget the records of the last run."""
    shutil.rmtree(folder / _FOLDER, ignore_errors=True)


def read_records(folder: Path) -> tuple[StageRecord, ...]:
    """The records of the current run, in the order in which the stages ended."""
    files = sorted((folder / _FOLDER).glob("[0-9]*.json"), key=lambda file: file.name)
    return tuple(StageRecord(**from_json(file.read_text(encoding="utf-8"))) for file in files)


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
