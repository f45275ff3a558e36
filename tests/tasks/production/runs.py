"""Runs for the tests of production."""

from __future__ import annotations

import uuid
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

from tasks.files.json_text import JSON
from tasks.production.records import Records
from tasks.production.run_record import RunRecord, StageTime, State

NOON = datetime(2026, 11, 20, 12, tzinfo=UTC)
ADJUSTED = (
    "import_exposures",
    "import_control",
    "import_image_points",
    "approximate_values",
    "bundle_adjustment",
    "remarks",
    "report",
)


def gate(name: str, value: float | None, limit: float, unit: str = "1") -> dict[str, JSON]:
    passed = value is not None and value <= limit
    return {"name": name, "value": value, "limit": limit, "unit": unit, "bound": "max", "passed": passed}


def summary(sigma0: float = 1.02, limit: float = 1.2, problems: tuple[str, ...] = ()) -> dict[str, JSON]:
    return {
        "status": "done" if sigma0 <= limit else "gate_failed",
        "sigma0": sigma0,
        "rmse_check_m": [0.011, 0.012, 0.031],
        "trust_map_height_m": 0.043,
        "gates": [gate("sigma0", sigma0, limit), gate("rmse_check_m_z", 0.031, 0.05, "m")],
        "problems": list(problems),
    }


def run(project: str = "block-7", hours: float = 0.0, **changed: Any) -> RunRecord:
    """A run that waits; `hours` after noon."""
    file = f"/data/{project}/project.toml"
    plain = RunRecord(
        str(uuid.uuid4()), project, file, f"/data/{project}/results", "aerial-triangulation", "Scheduled", "",
        NOON + timedelta(hours=hours),
    )  # fmt: skip
    return replace(plain, **changed)


def stages(*names: str, reused: bool = False) -> tuple[StageTime, ...]:
    return tuple(StageTime(name, 1.0, reused) for name in names)


def ended(
    records: Records,
    one: RunRecord,
    state: State = "Completed",
    message: str = "",
    *,
    done: tuple[StageTime, ...] | None = None,
    failed_stage: str | None = None,
    figures: dict[str, JSON] | None = None,
) -> RunRecord:
    """Let a run begin and end; what the records then know of it."""
    records.begin(one)
    if done is None:
        done = stages(*ADJUSTED)
    told = figures if figures is not None or state not in ("Completed", "GateFailed") else summary()
    records.end(one.id, state, message, stages=done, failed_stage=failed_stage, summary=told)
    found = records.run(one.id)
    assert found is not None
    return found
