"""The inbox: one folder for each delivery, complete when its marker file says so; each gets one run.

Prefect begins runs by schedule and by events, and knows no folder that something is copied into. A delivery
is a folder with a ``project.toml``. Whoever copies it writes the file ``DELIVERED`` last. It may be empty,
or list what belongs to the delivery in the form of ``sha256sum`` (digest, two spaces, path): then every
file must be there with these bytes.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from flows.server.api import Api
from flows.server.roots import Roots
from tasks.errors import InputError, Location
from tasks.files.delivered_file import read_delivered, trouble_of
from tasks.files.installation import InstallationError
from tasks.plain_text import trouble_in, visible
from tasks.production.records import Records
from tasks.production.run_record import DECIDED, RunRecord

#: Name of the marker file.
MARKER = "DELIVERED"
#: Set by ``aerocal serve``: the folder that deliveries are copied into.
INBOX_VARIABLE = "AEROCAL_INBOX"

#: A delivery is taken up once it has been still for so long, s.
STILL_S = 5.0
#: What is read of a listed file before it is asked whether the look is called off, bytes.
_PIECE_BYTES = 4_000_000

_LISTED = re.compile(r"([0-9a-fA-F]{64}) [ *](.+)")


@dataclass(frozen=True)
class Delivery:
    """A complete delivery.

    Attributes
    ----------
    folder : where it lies, links resolved.
    key : what tells it from another delivery into the same folder.
    """

    folder: Path
    key: str


@dataclass(frozen=True)
class Inbox:
    """Contents of an inbox.

    Attributes
    ----------
    complete : the deliveries that can be started, by folder.
    waiting : folders without a marker file, or that still change.
    refused : by folder, why a marked delivery is not started, a sentence.
    """

    complete: tuple[Delivery, ...]
    waiting: tuple[Path, ...]
    refused: Mapping[Path, str]


def configured_inbox(environment: Mapping[str, str] = os.environ) -> Path:
    """The inbox of this process, as the server that started it has set it.

    Raises
    ------
    InputError
        If it has none.
    """
    text = environment.get(INBOX_VARIABLE)
    if not text:
        raise InputError("This server has no inbox.", "Start it with --inbox DIR.")
    return Path(text)


class CalledOffError(Exception):
    """The search of the inbox was cancelled."""


def read_inbox(
    folder: Path,
    roots: Roots,
    verified: set[str] | None = None,
    *,
    still_s: float = 0.0,
    is_over: Callable[[], bool] = lambda: False,
) -> Inbox:
    """Search an inbox for deliveries.

    Parameters
    ----------
    verified : keys of deliveries whose listed files have been read before, so that nobody reads them again
        every few seconds; those found now are added.
    still_s : a marked delivery that has changed within so many seconds waits, too.
    is_over : whether the look is called off; asked while files are read.

    Raises
    ------
    InputError
        If it cannot be read.
    CalledOffError
        If it is called off.
    """
    try:
        folders = sorted(entry for entry in folder.iterdir() if entry.is_dir() and entry.name[0] != ".")
    except OSError as error:
        raise Location(folder).error(
            f"The inbox cannot be read ({error.strerror}).", "Check --inbox."
        ) from error
    verified = set() if verified is None else verified
    complete, waiting, refused = [], [], {}
    for one in folders:
        try:
            if not os.path.lexists(one / MARKER) or _has_just_changed(one, still_s):
                waiting.append(one)
                continue
            trouble = _trouble(one, roots)
            key = "" if trouble is not None else _key(one)
            if trouble is None and key not in verified:
                trouble = _trouble_of_listed(one, roots, is_over)
            if trouble is None:
                verified.add(key)
                complete.append(Delivery(one.resolve(), key))
        except OSError as error:
            trouble = f"It cannot be read ({error.strerror or error})."
        if trouble is not None:
            refused[one] = trouble
    return Inbox(tuple(complete), tuple(waiting), refused)


def _trouble(folder: Path, roots: Roots) -> str | None:
    """Why a marked delivery is not started; None: it can be."""
    unreadable = trouble_in(folder.name)
    if unreadable is not None:
        return unreadable
    marker, project = folder / MARKER, folder / "project.toml"
    for file in (marker, project):
        if not roots.hold(file):
            return f"{file.name} lies outside the folders of this server."
    if not project.is_file():
        return "It has no project.toml."
    if trouble_of(marker.resolve(), "document") is not None:
        return f"{MARKER} is not a list of files."
    return None


def _trouble_of_listed(folder: Path, roots: Roots, is_over: Callable[[], bool]) -> str | None:
    """Why the files listed in the marker file are incomplete; None: they are complete."""
    try:
        text = read_delivered((folder / MARKER).resolve(), "document").decode(errors="replace")
    except InputError as error:
        return str(error)
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip():
            continue
        found = _LISTED.fullmatch(line)
        if found is None:
            return f"{MARKER}, line {number}: not a digest and a path as written by sha256sum."
        digest, file = found.group(1).lower(), folder / found.group(2)
        if not roots.hold(file):
            return f"{MARKER}, line {number}: the file lies outside the folders of this server."
        if not file.is_file():
            return f"{MARKER}, line {number}: {found.group(2)} does not exist."
        too_much = trouble_of(file.resolve(), "table")
        if too_much is not None:
            return f"{MARKER}, line {number}: {too_much}"
        if _digest(file, is_over) != digest:
            return f"{MARKER}, line {number}: the content of {found.group(2)} differs from its digest."
    return None


def _digest(file: Path, is_over: Callable[[], bool]) -> str:
    digest = hashlib.sha256()
    with file.open("rb") as stream:
        while piece := stream.read(_PIECE_BYTES):
            if is_over():
                raise CalledOffError
            digest.update(piece)
    return digest.hexdigest()


def _has_just_changed(folder: Path, still_s: float) -> bool:
    """Whether a file was written or renamed there just now; a clock that was set back has no effect."""
    if still_s == 0.0:
        return False
    newest = max((file.stat().st_ctime for file in _delivered(folder)), default=0.0)
    return 0.0 <= time.time() - newest < still_s


def _key(folder: Path) -> str:
    """Digest of what was delivered: names, sizes and times of all files but results."""
    told = [str(folder.resolve())]
    for file in sorted(_delivered(folder)):
        status = file.stat()
        told.append(f"{file.relative_to(folder)} {status.st_size} {status.st_mtime_ns}")
    return hashlib.sha256(json.dumps(told).encode()).hexdigest()


def _delivered(folder: Path) -> Iterator[Path]:
    for at, folders, files in os.walk(folder):
        # Output folders are known by their stage store.
        folders[:] = [
            name for name in folders if name[0] != "." and not (Path(at) / name / ".store").is_dir()
        ]
        yield from (Path(at) / name for name in files if (Path(at) / name).is_file())


#: Flow to run for each delivery.
StoryOfDeliveries: TypeAlias = Literal[
    "aerial-triangulation", "system-calibration", "direct-georeferencing-check"
]
#: Name of the deployments whose runs are started by hand.
MANUAL = "manual"
#: Name of the deployments that runs of deliveries belong to.
ON_DELIVERY = "on-delivery"


@dataclass(frozen=True)
class Scheduled:
    """What has been scheduled from an inbox.

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
        """Sentences for the log and the page."""
        parts = (("Started", self.begun), ("Not complete yet", self.waiting))
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
        tuple(visible(f"{folder.name} was not started. {why}") for folder, why in found.refused.items()),
    )


def _schedule(
    api: Api, records: Records, delivery: Delivery, story: StoryOfDeliveries
) -> Literal["begun", "known"]:
    before = records.of_delivery(delivery.key)
    if before is not None and (before.state in DECIDED or not before.has_ended):
        return "known"
    project_file = delivery.folder / "project.toml"
    # The server hands back the run there is when it has seen the key before. So nothing is lost or doubled if
    # this process is killed before it can note the run, and one that the server has lost is made again.
    body = {
        "parameters": {"project": str(project_file)},
        "idempotency_key": f"delivery-{delivery.key}",
        "tags": ["delivery"],
    }
    run = api.post(f"/deployments/{_deployment(api, story)}/create_flow_run", body)
    if before is not None and before.id == run["id"]:
        return "known"
    message, results = "It is not its turn yet.", str(project_file.parent / "results")
    known = {"directory": results, "delivery": delivery.key}
    records.schedule(RunRecord.of(run["id"], project_file, story, "Scheduled", message, **known))
    return "begun"


def _deployment(api: Api, story: str) -> str:
    deployment = api.get(f"/deployments/name/{story}/{ON_DELIVERY}")
    if deployment is None:
        raise InstallationError(
            f"There is no deployment {story}/{ON_DELIVERY}.", "Start the server with --inbox."
        )
    return str(deployment["id"])
