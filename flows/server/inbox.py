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
import stat
import time
from collections.abc import Callable, Mapping, Sequence
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

#: Names of what programs and network shares write into a folder that somebody looks at or opens files of.
_OF_VIEWERS = re.compile(r"\..*|~\$.*|Thumbs\.db|desktop\.ini", re.DOTALL)
_LISTED = re.compile(r"([0-9a-fA-F]{64}) [ *](.+)")


@dataclass(frozen=True)
class Delivery:
    """A complete delivery.

    Attributes
    ----------
    folder : where it lies, links resolved.
    key : what tells it from another delivery into the same folder.
    changed : when a file of it was last written or renamed, s since 1970.
    """

    folder: Path
    key: str
    changed: float


@dataclass(frozen=True)
class Inbox:
    """Contents of an inbox.

    Attributes
    ----------
    complete : the deliveries that can be started, by folder.
    waiting : folders without a marker file, or that still change.
    refused : by folder, why a marked delivery is not started, a sentence.
    runs : by key, the latest run of the deliveries that have had one.
    """

    complete: tuple[Delivery, ...]
    waiting: tuple[Path, ...]
    refused: Mapping[Path, str]
    runs: Mapping[str, RunRecord]


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
    known: dict[Delivery, str | None] | None = None,
    *,
    still_s: float = 0.0,
    runs_of: Callable[[Sequence[str]], Mapping[str, RunRecord]] = lambda _keys: {},
    is_over: Callable[[], bool] = lambda: False,
) -> Inbox:
    """Search an inbox for deliveries.

    Parameters
    ----------
    known : why the listed files of deliveries are incomplete (None: they are complete) as an earlier look has
        found, so that nobody reads them again every few seconds; what is found now is added.
    still_s : a marked delivery that has changed within so many seconds waits, too.
    runs_of : finds the latest run of each delivery that has had one, by their keys; the listed files of these
        are not read again.
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
    known = {} if known is None else known
    found = {one: _marked(one, roots, still_s) for one in folders}
    runs = runs_of([marked.key for marked in found.values() if isinstance(marked, Delivery)])
    complete, refused = [], {}
    for one, marked in found.items():
        trouble = marked
        if isinstance(marked, Delivery):
            trouble = None if marked.key in runs else _trouble_of_listed(marked, roots, known, is_over)
            if trouble is None:
                complete.append(marked)
        if isinstance(trouble, str):
            refused[one] = trouble
    waiting = tuple(one for one, marked in found.items() if marked is None)
    return Inbox(tuple(complete), waiting, refused, runs)


def _marked(folder: Path, roots: Roots, still_s: float) -> Delivery | str | None:
    """A marked delivery before its listed files are read, or why it is not started; None: it waits."""
    try:
        if not os.path.lexists(folder / MARKER):
            return None
        files = _delivered(folder)
        newest = max((status.st_ctime for status in files.values()), default=0.0)
        # A clock that was set back has no effect.
        if 0.0 <= time.time() - newest < still_s:
            return None
        return _trouble(folder, roots) or Delivery(folder.resolve(), _key(folder, files), newest)
    except FileNotFoundError:
        # A file was renamed between two looks at it: it is being copied.
        return None
    except OSError as error:
        return f"It cannot be read ({error.strerror or error})."


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


def _trouble_of_listed(
    delivery: Delivery, roots: Roots, known: dict[Delivery, str | None], is_over: Callable[[], bool]
) -> str | None:
    """Why the files listed in the marker file are incomplete; None: they are complete."""
    try:
        if delivery not in known:
            known[delivery] = _trouble_of_lines(delivery.folder, roots, is_over)
        return known[delivery]
    except OSError as error:
        # Of a disk that does not answer for a moment; the next look reads again.
        return f"It cannot be read ({error.strerror or error})."


def _trouble_of_lines(folder: Path, roots: Roots, is_over: Callable[[], bool]) -> str | None:
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


def _key(folder: Path, files: Mapping[Path, os.stat_result]) -> str:
    """Digest of what was delivered: names, sizes and times of all files but results and what viewers write.

    Another form of it would process all deliveries again.
    """
    told = [str(folder.resolve())]
    delivered = ((file, status) for file, status in files.items() if not _OF_VIEWERS.fullmatch(file.name))
    for file, status in sorted(delivered, key=lambda one: one[0]):
        told.append(f"{file.relative_to(folder)} {status.st_size} {status.st_mtime_ns}")
    return hashlib.sha256(json.dumps(told).encode()).hexdigest()


def _delivered(folder: Path) -> dict[Path, os.stat_result]:
    """The files of a delivery with what the system knows of them, without those of results."""
    found = {}
    for at, folders, files in os.walk(folder):
        # Output folders are known by their stage store.
        folders[:] = [
            name for name in folders if name[0] != "." and not (Path(at) / name / ".store").is_dir()
        ]
        for file in (Path(at) / name for name in files):
            # Links that lead nowhere are no files.
            if not file.is_symlink() or file.exists():
                found[file] = file.stat()
    return {file: status for file, status in found.items() if stat.S_ISREG(status.st_mode)}


#: Flow to run for each delivery.
StoryOfDeliveries: TypeAlias = Literal[
    "aerial-triangulation", "system-calibration", "direct-georeferencing-check"
]
#: Name of the flow that searches the inbox.
SEARCH = "inbox"
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
    on_schedule : complete folders that wait for the scheduled search.
    """

    begun: tuple[str, ...]
    known: tuple[str, ...]
    waiting: tuple[str, ...]
    refused: tuple[str, ...]
    on_schedule: tuple[str, ...] = ()

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
    known: dict[Delivery, str | None] | None = None,
    is_over: Callable[[], bool] = lambda: False,
    *,
    only_look: bool = False,
) -> Scheduled:
    """Schedule a run for every complete delivery that has none.

    Parameters
    ----------
    records : remember what was done with a delivery, whatever becomes of the server's own records.
    known, is_over : as of `read_inbox`.
    only_look : schedule nothing; complete deliveries wait for another call.

    Raises
    ------
    InputError
        If the inbox cannot be read.
    InstallationError
        If server or records cannot be asked.
    """
    found = read_inbox(inbox, roots, known, still_s=STILL_S, runs_of=records.of_deliveries, is_over=is_over)
    begun: list[str] = []
    before: list[str] = []
    later: list[str] = []
    for delivery in found.complete:
        if _has_its_run(found.runs.get(delivery.key)):
            before.append(delivery.folder.name)
        elif only_look:
            later.append(delivery.folder.name)
        else:
            is_new = _schedule(api, records, delivery, story, found.runs.get(delivery.key))
            (begun if is_new else before).append(delivery.folder.name)
    return Scheduled(
        tuple(begun),
        tuple(before),
        tuple(visible(folder.name) for folder in found.waiting),
        tuple(visible(f"{folder.name} was not started. {why}") for folder, why in found.refused.items()),
        tuple(later),
    )


def _has_its_run(latest: RunRecord | None) -> bool:
    return latest is not None and (latest.state in DECIDED or not latest.has_ended)


def _schedule(
    api: Api, records: Records, delivery: Delivery, story: StoryOfDeliveries, before: RunRecord | None
) -> bool:
    """Schedule the run of a delivery; returns whether it is a new one.

    Parameters
    ----------
    before : its latest run; None: it has had none.
    """
    project_file = delivery.folder / "project.toml"
    # The server hands back the run there is when it has seen the key before. So nothing is lost or doubled if
    # this process is killed before it can note the run, and one that the server has lost is made again.
    body = {
        "name": f"{delivery.folder.name} · {story}",
        "parameters": {"project": str(project_file)},
        "idempotency_key": f"delivery-{delivery.key}",
        "tags": ["delivery"],
    }
    run = api.post(f"/deployments/{_deployment(api, story)}/create_flow_run", body)
    if before is not None and before.id == run["id"]:
        return False
    message, results = "It is not its turn yet.", str(project_file.parent / "results")
    of_delivery = {"directory": results, "delivery": delivery.key}
    records.schedule(RunRecord.of(run["id"], project_file, story, "Scheduled", message, **of_delivery))
    return True


def _deployment(api: Api, story: str) -> str:
    deployment = api.get(f"/deployments/name/{story}/{ON_DELIVERY}")
    if deployment is None:
        raise InstallationError(
            f"There is no deployment {story}/{ON_DELIVERY}.", "Start the server with --inbox."
        )
    return str(deployment["id"])
