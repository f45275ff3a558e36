"""Runs that have ended in records of production, for the tests of notices."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from tasks.production.records import Records
from tasks.production.run_record import RunRecord

GATE = {"name": "sigma0", "value": 1.5, "limit": 1.2, "unit": "1", "bound": "max", "passed": False}
SUMMARY: dict[str, Any] = {
    "status": "gate_failed",
    "sigma0": 1.5,
    "gates": [GATE],
    "problems": ["Too large."],
}


def ended_run(
    records: Records,
    state: Any = "GateFailed",
    number: int = 0,
    project: str = "block-7",
    message: str = "Gates not passed: sigma0.",
) -> str:
    """A run that has ended; its number."""
    run_id = f"00000000-0000-0000-0000-{number:012d}"
    now = datetime.now(UTC)
    records.begin(
        RunRecord(
            run_id,
            project,
            f"/data/{project}/project.toml",
            "/data/out",
            "aerial-triangulation",
            "Running",
            "",
            now,
        )
    )
    records.end(run_id, state, message, summary=SUMMARY if state in ("GateFailed", "Completed") else None)
    return run_id
