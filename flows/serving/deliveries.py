"""From the complete deliveries of an inbox to runs, each delivery once however often it is looked at."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from flows.serving.api import Api
from flows.serving.inbox import Delivery, read_inbox
from flows.serving.roots import Roots
from tasks.storage.installation import InstallationError

#: What is done with deliveries.
StoryOfDeliveries: TypeAlias = Literal[
    "aerial-triangulation", "system-calibration", "direct-georeferencing-check"
]
#: Name of the deployments whose runs are started by hand.
MANUAL = "manual"
#: Name of the deployments that runs of deliveries belong to.
ON_DELIVERY = "on-delivery"
#: States that say nothing about the delivery: the machine ended the run.
_UNDECIDED = ("CRASHED",)


@dataclass(frozen=True)
class Scheduled:
    """What has been done with an inbox.

    Attributes
    ----------
    begun : folders whose run has been scheduled now.
    resumed : folders whose run was ended by the machine and has been scheduled again.
    known : folders whose run there was before.
    waiting : folders that are not complete yet.
    refused : sentences on marked folders that cannot be started.
    """

    begun: tuple[str, ...]
    resumed: tuple[str, ...]
    known: tuple[str, ...]
    waiting: tuple[str, ...]
    refused: tuple[str, ...]

    def sentences(self) -> tuple[str, ...]:
        """What people should read about it."""
        parts = (
            ("Begun", self.begun),
            ("Resumed", self.resumed),
            ("Not complete yet", self.waiting),
        )
        told = [f"{what}: {', '.join(names)}." for what, names in parts if names]
        told.append(f"Deliveries with a run already: {len(self.known)}.")
        return (*told, *self.refused)


def schedule_deliveries(
    api: Api, inbox: Path, roots: Roots, story: StoryOfDeliveries, verified: set[str] | None = None
) -> Scheduled:
    """Schedule a run for every complete delivery that has none.

    Parameters
    ----------
    verified : as of `read_inbox`.

    Raises
    ------
    InputError
        If the inbox cannot be read.
    InstallationError
        If the server cannot be asked.
    """
    found = read_inbox(inbox, roots, verified)
    outcomes = {delivery.folder.name: _schedule(api, delivery, story) for delivery in found.complete}

    def with_outcome(outcome: str) -> tuple[str, ...]:
        return tuple(name for name, how in outcomes.items() if how == outcome)

    return Scheduled(
        with_outcome("begun"),
        with_outcome("resumed"),
        with_outcome("known"),
        tuple(folder.name for folder in found.waiting),
        tuple(f"{folder.name} is not started. {why}" for folder, why in found.refused.items()),
    )


def _schedule(api: Api, delivery: Delivery, story: StoryOfDeliveries) -> Literal["begun", "resumed", "known"]:
    # The server hands back the run there is when it has seen the key before.
    body = {
        "parameters": {"project": str(delivery.folder / "project.toml")},
        "idempotency_key": f"delivery-{delivery.key}",
        "tags": ["delivery"],
    }
    known = _has_run(api, story, str(body["idempotency_key"]))
    run = api.post(f"/deployments/{_deployment(api, story)}/create_flow_run", body)
    if not known:
        return "begun"
    if run["state_type"] not in _UNDECIDED:
        return "known"
    state = {"type": "SCHEDULED", "name": "AwaitingRetry", "message": "Finished stages are kept."}
    api.post(f"/flow_runs/{run['id']}/set_state", {"state": state, "force": True})
    return "resumed"


def _has_run(api: Api, story: str, key: str) -> bool:
    asked = {"flows": {"name": {"any_": [story]}}, "flow_runs": {"idempotency_key": {"any_": [key]}}}
    return bool(api.post("/flow_runs/filter", {**asked, "limit": 1}))


def _deployment(api: Api, story: str) -> str:
    deployment = api.get(f"/deployments/name/{story}/{ON_DELIVERY}")
    if deployment is None:
        raise InstallationError(
            f"There is no deployment {story}/{ON_DELIVERY}.", "Start the server with --inbox."
        )
    return str(deployment["id"])
