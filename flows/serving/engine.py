"""The program of a run: ``python -P -m flows.serving.engine``, started by the runner for each.

Prefect's own would load what the server says: an entry point, after pull steps that may be shell commands.
Here the server only says which of our flows is wanted and with which parameters; both are looked at before
anything begins.
"""

from __future__ import annotations

import gc
import inspect
import logging
import os
import re
from typing import TYPE_CHECKING, Any
from uuid import UUID

from flows.runs.freed_memory import keep_freed_memory
from flows.runs.project_run import STATE_NAMES
from tasks.plain_text import visible

if TYPE_CHECKING:
    from prefect import Flow
    from prefect.client.orchestration import SyncPrefectClient
    from prefect.client.schemas.objects import FlowRun

_log = logging.getLogger("aerocal")
_FORESEEN = re.compile(rf"Finished in state ({'|'.join(STATE_NAMES.values())})\(")


def main() -> None:
    """Carry out the run that the environment names; an expected outcome is not an error here."""
    run_id = UUID(os.environ["PREFECT__FLOW_RUN_ID"])
    # As the command: a run ends before there is garbage worth a search.
    gc.set_threshold(1_000_000)
    keep_freed_memory()
    from flows.serving.deployed import FLOWS  # isort: skip
    from prefect._internal.control_listener import configure_from_env
    from prefect.client.orchestration import get_client
    from prefect.engine import handle_engine_signals
    from prefect.flow_engine import run_flow

    from flows.runs.recorded_run import note_refusal, refused_run
    from flows.serving.registered import identity

    logging.getLogger("prefect.task_runs").addFilter(foreseen)
    configure_from_env()
    with handle_engine_signals(run_id):
        with get_client(sync_client=True) as client:
            run = client.read_flow_run(run_id)
            name = client.read_flow(run.flow_id).name
            flow = next((one for one in FLOWS if one.name == name), None)
            trouble = (
                f"There is no story '{visible(name)}'." if flow is None else trouble_in(flow, run.parameters)
            )
            if trouble is not None:
                project = visible(str(run.parameters.get("project", "")))
                note_refusal(refused_run(project, "InputError", trouble, identity()))
                _refuse(client, run, trouble)
        if flow is not None and trouble is None:
            # As a state, so that one that is foreseen (a gate that failed) is not raised.
            run_flow(flow, flow_run=run, return_type="state")


def foreseen(said: logging.LogRecord) -> bool:
    """Log the refusal of a delivery by a stage as a warning; Prefect would log it as our error."""
    if said.levelno == logging.ERROR and _FORESEEN.match(said.getMessage()):
        said.levelno, said.levelname = logging.WARNING, "WARNING"
    return True


def trouble_in(flow: Flow[..., Any], parameters: dict[str, Any]) -> str | None:
    """Why a flow does not accept parameters, as a sentence; None if it does."""
    known = list(inspect.signature(flow.fn).parameters)
    unknown = [name for name in parameters if name not in known]
    if unknown:
        named = ", ".join(visible(name) for name in unknown)
        return f"There is no parameter {named}. There are: {', '.join(known)}."
    # Prefect says an error of its own for it, with the values.
    said = logging.getLogger("prefect.flows")
    said.disabled = True
    try:
        flow.validate_parameters(parameters)
    except Exception as error:
        return f"The parameters are not valid. {visible(' '.join(str(error).split()))}"
    finally:
        said.disabled = False
    return None


def _refuse(client: SyncPrefectClient, run: FlowRun, trouble: str) -> None:
    from prefect.states import Failed, Running

    # The server lets only a run that has started fail.
    client.set_flow_run_state(run.id, Running())
    client.set_flow_run_state(run.id, Failed(name="InputError", message=trouble))
    client.update_flow_run(run.id, name=f"refused · {run.name} · InputError")
    _log.info("refused: %s", trouble)


if __name__ == "__main__":
    main()
