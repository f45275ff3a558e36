"""The runner as a child process: what it is told, and what of its surroundings it is given."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from flows.serving.api import Api
from flows.serving.child import Child, Lifeline
from flows.serving.inbox import INBOX_VARIABLE
from flows.serving.options import RunnerOptions
from flows.serving.results import RESULTS_VARIABLE
from flows.serving.roots import ROOTS_VARIABLE, Roots, as_variable
from flows.serving.server_process import CLIENT_WORDS
from flows.serving.state_file import STATE_VARIABLE
from tasks.object_storage.address import ObjectAddress
from tasks.production.variable import OVERVIEW_VARIABLE, RECORDS_VARIABLE
from tasks.settings.registry import REGISTRY_VARIABLE


@dataclass(frozen=True)
class RunnerPlace:
    """Where a runner works.

    Attributes
    ----------
    roots : folders that its runs may read and write.
    records : address of the records of production, without a password.
    inbox : folder of deliveries; None: there is none.
    registry : address of the registry of calibrations; None: there is none.
    results : where results go besides the folders of projects; None: nowhere else.
    state : folder of the server's state, or of its own.
    overview : address of the production page; None: it is not known.
    """

    roots: Roots
    records: str
    inbox: Path | None
    registry: str | None
    results: ObjectAddress | None
    state: Path
    overview: str | None


def start_runner(
    api: Api,
    options: RunnerOptions,
    place: RunnerPlace,
    lifeline: Lifeline,
    holds: Sequence[Lifeline] = (),
    *,
    name: str = "runner",
) -> Child:
    """Start a runner; it does not ask for runs yet.

    Parameters
    ----------
    lifeline, holds : as of `Child`.
    name : of its log.
    """
    return Child(
        "flows.serving.runner",
        options.as_text(),
        environment=runner_environment(api, place),
        log=place.state / "logs" / f"{name}.log",
        lifeline=lifeline,
        holds=holds,
    )


def runner_environment(api: Api, place: RunnerPlace) -> dict[str, str]:
    """The variables of a runner and of what it starts."""
    return {
        **os.environ,
        "PREFECT_API_URL": api.url,
        "PREFECT_LOGGING_TO_API_WHEN_MISSING_FLOW": "ignore",
        ROOTS_VARIABLE: as_variable(place.roots),
        RECORDS_VARIABLE: place.records,
        STATE_VARIABLE: str(place.state),
        RESULTS_VARIABLE: "" if place.results is None else str(place.results),
        **({CLIENT_WORDS: api.words} if api.words else {}),
        **({OVERVIEW_VARIABLE: place.overview} if place.overview is not None else {}),
        **({INBOX_VARIABLE: str(place.inbox.resolve())} if place.inbox is not None else {}),
        **({REGISTRY_VARIABLE: place.registry} if place.registry is not None else {}),
    }
