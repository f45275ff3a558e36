"""One run of a story on a project: settings in, published results or one clear reason out.

Whoever starts it (the command line, a Prefect flow) gets the same outcome: the project file is read,
the output folder is locked, the story runs, and an input error or an adjustment that cannot be
computed ends in a summary.json that says so and changes nothing else.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from tasks.errors import AerocalError, InputError, NotComputableError
from tasks.registered_cameras import with_registered_cameras
from tasks.settings.base import DATA_VARIABLE
from tasks.settings.load import load_project, load_variants
from tasks.settings.project import Project
from tasks.storage.installation import writing_into
from tasks.storage.run_lock import run_lock
from tasks.storage.stage_record import read_records, timings_s
from tasks.storage.store import Store
from tasks.summary import Summary, failed_summary, write_summary

Story: TypeAlias = Callable[[Project, Store], Summary]


@dataclass(frozen=True)
class RunRequest:
    """What to run.

    Attributes
    ----------
    project_file : the TOML file.
    out : the output folder; None: ``results`` beside the project file.
    overrides : texts ``a.b.c=VALUE`` that replace values of the project file.
    data : a second folder for relative input paths.
    roots : folders that every input file must lie under (runs of a deployment); empty: anywhere.
    """

    project_file: Path
    out: Path | None = None
    overrides: tuple[str, ...] = ()
    data: Path | None = None
    roots: tuple[Path, ...] = ()

    @property
    def directory(self) -> Path:
        """The output folder."""
        return self.out if self.out is not None else self.project_file.parent / "results"

    def project(self) -> Project:
        """Read the project file, and take what its cameras want from the registry of calibrations.

        Raises
        ------
        InputError
            If it, or a value in it, is wrong, or the registry has no calibration for a camera.
        """
        return with_registered_cameras(
            load_project(
                self.project_file,
                self.overrides,
                self.data,
                environment=self._environment(),
                roots=self.roots,
            )
        )

    def variants(self) -> dict[str, Project]:
        """The variants of the project that its sweep computes.

        Raises
        ------
        InputError
            If there is no sweep, or what a variant changes is wrong.
        """
        variants = load_variants(
            self.project_file, self.overrides, self.data, environment=self._environment(), roots=self.roots
        )
        return {name: with_registered_cameras(project) for name, project in variants.items()}

    def _environment(self) -> dict[str, str] | None:
        """The variables that paths may use; None: all."""
        if not self.roots:
            return None
        # A message about a path shows its variables; those of the server are nobody's business.
        return {name: value for name, value in os.environ.items() if name == DATA_VARIABLE}


@dataclass(frozen=True)
class RunOutcome:
    """How a run ended.

    Attributes
    ----------
    directory : the output folder.
    summary : what stands in its summary.json.
    error : why there is no result, in one line; None if there is one.
    failed_stage : the stage that could not be done; None: none, or it did not come to any.
    """

    directory: Path
    summary: Summary
    error: str | None = None
    failed_stage: str | None = None


def carry_out(story: Story, request: RunRequest) -> RunOutcome:
    """Run a story on a project and publish its result.

    Raises
    ------
    InstallationError
        If the machine stands in the way (full disk, no permission).
    """
    store = Store.of(request.directory)
    try:
        project = request.project()
        with run_lock(request.directory, request.roots):
            store.begin_run()
            return RunOutcome(request.directory, story(project, store))
    except InputError as error:
        return _without_result(request, store, "input_error", error)
    except NotComputableError as error:
        return _without_result(request, store, "not_computable", error)


def _without_result(
    request: RunRequest, store: Store, status: Literal["input_error", "not_computable"], error: AerocalError
) -> RunOutcome:
    """Say in summary.json why there is no result; everything else in the output folder stays as it is."""
    summary = failed_summary(status, str(error), timings_s(read_records(store.folder)))
    # A mistyped project path must not leave a results folder in some unrelated place.
    if request.out is not None or request.project_file.is_file():
        with writing_into(request.directory), run_lock(request.directory, request.roots):
            write_summary(request.directory, summary)
    return RunOutcome(request.directory, summary, str(error), error.stage)
