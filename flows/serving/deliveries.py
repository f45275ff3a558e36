"""From the complete deliveries of an inbox to runs, each delivery once however often it is looked at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal, TypeAlias

from flows.serving.api import Api
from flows.serving.inbox import STILL_S, Delivery, read_inbox
from flows.serving.roots import Roots
from tasks.plain_text import visible
from tasks.production.records import Records, project_name
from tasks.production.run_record import DECIDED, RunRecord
from tasks.storage.installation import InstallationError

#: What is done with deliveries.
StoryOfDeliveries: TypeAlias = Literal[
    "aerial-triangulation", "system-calibration", "direct-georeferencing-check"
]
#: Name of the deployments whose runs are started by hand.
MANUAL = "manual"
#: Name of the deployments that runs of deliveries belong to.
ON_DELIVERY = "on-delivery"


@dataclass(frozen=True)
class Scheduled:
    """What has been done with an inbox.

    Attributes
    ----------
    begun : folders whose run has been scheduled now.
    known : folders whose run there was before.
    waiting : folders that are not complete yet.
    refused : sentences on marked folders that cannot be started.
    """

    begun: tuple[str, ...]
    known: tuple[str, ...]
    waiting: tuple[str, ...]
    refused: tuple[str, ...]

    def sentences(self) -> tuple[str, ...]:
        """What people should read about it."""
        parts = (("Begun", self.begun), ("Not complete yet", self.waiting))
        told = [f"{what}: {', '.join(names)}." for what, names in parts if names]
        told.append(f"Deliveries with a run already: {len(self.known)}.")
        return (*told, *self.refused)


def schedule_deliveries(
    api: Api,
    records: Records,
    inbox: Path,
    roots: Roots,
    story: StoryOfDeliveries,
    verified: set[str] | None = None,
    is_over: Callable[[], bool] = lambda: False,
) -> Scheduled:
    """Schedule a run for every complete delivery that has none.

    Parameters
    ----------
    records : remember what was done with a delivery, whatever becomes of the server's own records.
    verified, is_over : as of `read_inbox`.

    Raises
    ------
    InputError
        If the inbox cannot be read.
    InstallationError
        If server or records cannot be asked.
    """
    found = read_inbox(inbox, roots, verified, still_s=STILL_S, is_over=is_over)
    outcomes = {delivery.folder.name: _schedule(api, records, delivery, story) for delivery in found.complete}

    def with_outcome(outcome: str) -> tuple[str, ...]:
        return tuple(name for name, how in outcomes.items() if how == outcome)

    return Scheduled(
        with_outcome("begun"),
        with_outcome("known"),
        tuple(visible(folder.name) for folder in found.waiting),
        tuple(visible(f"{folder.name} is not started. {why}") for folder, why in found.refused.items()),
    )


def _schedule(
    api: Api, records: Records, delivery: Delivery, story: StoryOfDeliveries
) -> Literal["begun", "known"]:
    before = records.of_delivery(delivery.key)
    if before is not None and (before.state in DECIDED or not before.has_ended):
        return "known"
    project_file = delivery.folder / "project.toml"
    # The server hands back the run there is when it has seen the key before. So nothing is lost or doubled if
    # this process is killed before it can note the run, and one that the server has lost is made anew.
    body = {
        "parameters": {"project": str(project_file)},
        "idempotency_key": f"delivery-{delivery.key}",
        "tags": ["delivery"],
    }
    run = api.post(f"/deployments/{_deployment(api, story)}/create_flow_run", body)
    if before is not None and before.id == run["id"]:
        return "known"
    records.schedule(_scheduled(run["id"], project_file, story, delivery))
    return "begun"


def _scheduled(run_id: str, project_file: Path, story: str, delivery: Delivery) -> RunRecord:
    return RunRecord(
        run_id,
        project_name(project_file),
        str(project_file),
        str(project_file.parent / "results"),
        story,
        "Scheduled",
        "Its turn has not come yet.",
        datetime.now(UTC),
        delivery=delivery.key,
    )


def _deployment(api: Api, story: str) -> str:
    deployment = api.get(f"/deployments/name/{story}/{ON_DELIVERY}")
    if deployment is None:
        raise InstallationError(
            f"There is no deployment {story}/{ON_DELIVERY}.", "Start the server with --inbox."
        )
    return str(deployment["id"])
