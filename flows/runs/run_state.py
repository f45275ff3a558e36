"""The state a run ends in, as the dashboard and the records of production call it."""

from __future__ import annotations

from collections.abc import Mapping

from flows.runs.project_run import RunOutcome
from tasks.production.run_record import State
from tasks.results.summary import Status

#: Names of the states, by the status in summary.json.
STATE_NAMES: Mapping[Status, State] = {
    "done": "Completed",
    "gate_failed": "GateFailed",
    "input_error": "InputError",
    "not_computable": "NotComputable",
}


def state_name(outcome: RunOutcome) -> State:
    """Name of the state."""
    return STATE_NAMES[outcome.summary.status]


def state_message(outcome: RunOutcome) -> str:
    """A sentence about the state."""
    status = outcome.summary.status
    if status == "done":
        return f"Results are in {outcome.place}."
    if status == "gate_failed":
        failed = ", ".join(gate.name for gate in outcome.summary.gates if not gate.passed)
        return f"Gates not passed: {failed}."
    return str(outcome.error)
