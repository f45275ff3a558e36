"""The runs that a further runner can take: those of projects that it can read, and that it knows.

A relative path is that of the first folder of the server that has it. A runner with other folders may find
another project at the same path, or none.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping, Sequence
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias
from uuid import UUID

from flows.server.roots import Roots
from tasks.errors import InputError
from tasks.plain_text import visible

if TYPE_CHECKING:
    from prefect.client.schemas.objects import FlowRun

_log = logging.getLogger("aerocal")

#: Those of the server, by deployment.
Folders: TypeAlias = Mapping[UUID, tuple[Path, ...]]


class Readable:
    """The runs that a runner can take; the others are left to other runners, and said once.

    Parameters
    ----------
    roots : folders of the runner.
    folders : the question for those of the server, by deployment.
    """

    def __init__(self, roots: Roots, folders: Callable[[], Awaitable[Folders]]) -> None:
        self._roots, self._folders, self._told = roots, folders, set[str]()

    def only(self, found: Callable[[], Awaitable[list[FlowRun]]]) -> Callable[[], Awaitable[list[FlowRun]]]:
        """The question for scheduled runs, answered with those that it can take."""

        async def asked() -> list[FlowRun]:
            runs = await found()
            relative = any(not Path(_project(run)).is_absolute() for run in runs)
            folders = await self._folders() if relative else {}
            # Not in the loop, which a share that does not answer would stop.
            return await asyncio.to_thread(self._of, runs, folders)

        return asked

    def _of(self, runs: Sequence[FlowRun], folders: Folders) -> list[FlowRun]:
        return [run for run in runs if self._takes(run, folders)]

    def _takes(self, run: FlowRun, folders: Folders) -> bool:
        project = _project(run)
        known = () if run.deployment_id is None else folders.get(run.deployment_id, ())
        trouble = self._trouble(project, known)
        if trouble is not None and project not in self._told:
            _log.warning("a run of %s is left to other runners: %s (--root)", visible(project), trouble)
            self._told.add(project)
        return trouble is None

    def _trouble(self, project: str, of_server: tuple[Path, ...]) -> str | None:
        """Why a project is not this runner's, as part of a sentence; None: it is."""
        try:
            file = self._roots.project_file(project)
        except InputError:
            return f"this one can read projects in {_named(self._roots.folders)} only"
        # What is in a folder of the server that this runner does not have, it does not know.
        shared = Roots(tuple(takewhile(self._roots.hold, of_server)))
        if Path(project).is_absolute() or _found(shared, project) == file:
            return None
        return (
            f"the path is relative to the folders of the server, {_named(of_server)}, where it may be "
            f"another project than in those of this one, {_named(self._roots.folders)}"
        )


def _found(roots: Roots, project: str) -> Path | None:
    try:
        return roots.project_file(project)
    except InputError:
        return None


def _named(folders: Sequence[Path]) -> str:
    return ", ".join(map(str, folders)) or "which are not known"


def _project(run: FlowRun) -> str:
    return str(run.parameters.get("project", ""))
