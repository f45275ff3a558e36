"""One run of a story on a project: settings in, published results or one clear reason out.

The outcome is the same for every caller (the command line, a Prefect flow): the project file is read,
the output folder is locked, the story runs, and an input error or an adjustment that cannot be
computed ends in a summary.json that says so and changes nothing else.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, TypeAlias

from tasks.errors import InputError, NotComputableError
from tasks.files.delivered_file import is_there, trouble_of_folder
from tasks.files.installation import InstallationError, writing_into
from tasks.object_storage.address import ObjectAddress, output_place
from tasks.object_storage.connection import local_folder
from tasks.plain_text import some_of
from tasks.production.run_record import State
from tasks.results.own_files import foreign_document
from tasks.results.summary import Status, Summary, failed_summary, write_summary
from tasks.settings.base import DATA_VARIABLE
from tasks.settings.cameras import REGISTRY, RIG_REGISTRY
from tasks.settings.load import load_project, load_variants
from tasks.settings.project import Project
from tasks.store.run_lock import run_lock
from tasks.store.stage_key import input_files
from tasks.store.stage_record import read_records, timings_s
from tasks.store.store import Store

#: What is computed of what a request reads, which is a project for all but the examination of images.
Story: TypeAlias = Callable[[Any, Store], Summary]

_log = logging.getLogger("aerocal")

#: Delivered files that a remark names.
_LISTED = 3

#: A story of a project: module in flows.stories, function in it, and Prefect flow all have this name.
StoryName: TypeAlias = Literal["aerial_triangulation", "system_calibration", "direct_georeferencing_check"]


#: Names of the states of a run, by the status in summary.json.
STATE_NAMES: Mapping[Status, State] = {
    "done": "Completed",
    "gate_failed": "GateFailed",
    "input_error": "InputError",
    "not_computable": "NotComputable",
}


def story_named(name: StoryName | Literal["image_quality"]) -> Story:
    """The story of this name, which is loaded only when it is needed."""
    story: Story = getattr(import_module(f"flows.stories.{name}"), name)
    return story


@dataclass(frozen=True)
class RunRequest:
    """What to run.

    Attributes
    ----------
    project_file : the TOML file.
    out : the output folder; None: ``results`` next to the project file, or with an address the folder of this
        user that stands for it.
    overrides : texts ``a.b.c=VALUE`` that replace values of the project file.
    data : a second folder for relative input paths.
    roots : folders that every input file must lie under (runs of a deployment); empty: anywhere.
    address : where finished stages and results are kept on object storage, too; None: nowhere.
    """

    project_file: Path
    out: Path | None = None
    overrides: tuple[str, ...] = ()
    data: Path | None = None
    roots: tuple[Path, ...] = ()
    address: ObjectAddress | None = None

    @classmethod
    def of(
        cls, project_file: Path, out: str | None, overrides: tuple[str, ...], data: Path | None
    ) -> RunRequest:
        """The request of a command or a flow parameter; `out`: a folder or an address, as text.

        Raises
        ------
        InputError
            If the output location looks like an address but is invalid.
        """
        place = None if out is None else output_place(out)
        if isinstance(place, ObjectAddress):
            return cls(project_file, None, overrides, data, address=place)
        return cls(project_file, place, overrides, data)

    @property
    def directory(self) -> Path:
        """The output folder."""
        if self.out is not None:
            return self.out
        return self.project_file.parent / "results" if self.address is None else local_folder(self.address)

    @property
    def place(self) -> Path | ObjectAddress | None:
        """The folder or address that was given to `of`; None: neither."""
        return self.out if self.out is not None else self.address

    def store(self) -> Store:
        """The store of the output folder, with its remote side if there is an address."""
        if self.address is None:
            return Store.of(self.directory)
        # Loaded only for an address, as the client of the storage is.
        from tasks.object_storage.workspace import ObjectWorkspace

        return Store.of(self.directory, ObjectWorkspace.at(self.address))

    def project(self) -> Project:
        """Read the project file, and take the calibrations that its cameras request from the registry.

        Raises
        ------
        InputError
            If it, or a value in it, is wrong, or the registry has no calibration for a camera.
        """
        return _with_registered_cameras(
            load_project(
                self.project_file,
                self.overrides,
                self.data,
                environment=self._environment(),
                roots=self.roots,
            )
        )

    def read(self) -> Any:
        """The input of this request's story; raises the errors of `project`."""
        return self.project()

    def declared_story(self) -> StoryName:
        """The declared story: a calibration, a check, or, without either, an adjustment.

        A calibration includes the check. An unreadable project is refused by the story.
        """
        try:
            project = load_project(self.project_file, self.overrides, self.data)
        except InputError:
            return "aerial_triangulation"
        if "calibration" in project.model_fields_set:
            return "system_calibration"
        return (
            "direct_georeferencing_check"
            if "direct_georeferencing" in project.model_fields_set
            else "aerial_triangulation"
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
        return {name: _with_registered_cameras(project) for name, project in variants.items()}

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
    request : what was to be run.
    summary : what is in its summary.json.
    error : why there is no result, in one line; None if there is one.
    failed_stage : the stage that failed; None: none, or none was reached.
    """

    request: RunRequest
    summary: Summary
    error: str | None = None
    failed_stage: str | None = None

    @property
    def directory(self) -> Path:
        """The output folder."""
        return self.request.directory

    @property
    def place(self) -> Path | ObjectAddress:
        """Where the results are: the output folder, or the address that was requested in place of one."""
        return self.request.place or self.directory

    @property
    def state(self) -> State:
        """The state it ends in, as the dashboard and the records of production call it."""
        return STATE_NAMES[self.summary.status]

    @property
    def message(self) -> str:
        """A sentence about the state."""
        if self.summary.status == "done":
            return f"Results are in {self.place}."
        if self.summary.status == "gate_failed":
            failed = ", ".join(gate.name for gate in self.summary.gates if not gate.passed)
            return f"Gates not passed: {failed}."
        return str(self.error)


def carry_out(story: Story, request: RunRequest) -> RunOutcome:
    """Run a story on a project and publish its result.

    Raises
    ------
    InstallationError
        If the machine prevents the run (full disk, no permission, object storage that does not answer).
    """
    try:
        trouble = trouble_of_folder(request.directory) or foreign_document(request.directory)
    except InputError as error:
        trouble = error
    if trouble is not None:
        # There, its summary cannot be written either.
        return RunOutcome(request, failed_summary("input_error", (str(trouble),), {}), str(trouble))
    store = request.store()
    try:
        read = request.read()
        _say_what_is_between_results(request, read)
        with run_lock(request.directory, request.roots):
            store.begin_run()
            return RunOutcome(request, story(read, store))
    except (InputError, NotComputableError) as error:
        return _without_result(request, store, error)


def _say_what_is_between_results(request: RunRequest, read: object) -> None:
    """Give a remark if results go into a folder of delivered files."""
    there = request.directory.resolve()
    files = {
        path.name for path in (request.project_file, *input_files(read)) if path.resolve().parent == there
    }
    if files:
        _log.warning(
            "the output folder %s is one of the delivery (%s): results will lie between delivered files; "
            "--out names another one", request.directory, some_of(sorted(files), _LISTED),
        )  # fmt: skip


def _without_result(request: RunRequest, store: Store, error: InputError | NotComputableError) -> RunOutcome:
    """State in summary.json why there is no result; all other files are left unchanged.

    What cannot be computed often has its cause in what the stages before have noted of the delivery.
    """
    timings = timings_s(read_records(store.folder))
    summary = (
        failed_summary("input_error", (str(error),), timings)
        if isinstance(error, InputError)
        else failed_summary("not_computable", (str(error), *store.remarks()), timings)
    )
    # A mistyped project path must not leave a results folder in some unrelated place.
    if request.place is not None or is_there(request.project_file):
        with writing_into(request.directory), run_lock(request.directory, request.roots):
            write_summary(request.directory, summary)
        _tell_remotely(store, summary)
    return RunOutcome(request, summary, str(error), error.stage)


def _tell_remotely(store: Store, summary: Summary) -> None:
    """State it on the remote side, too; the original error is reported even if that fails."""
    if store.remote is None:
        return
    try:
        store.remote.tell(summary.to_json())
    except InstallationError as error:
        _log.warning("the reason could not be written to object storage: %s", error)


def _with_registered_cameras(project: Project) -> Project:
    """The project with the calibrations of its cameras from the registry."""
    if all(camera.calibration not in (REGISTRY, RIG_REGISTRY) for camera in project.cameras.values()):
        return project
    # Loaded only for a camera that wants it, as the clients of databases are.
    from tasks.georeferencing.registered_cameras import with_registered_cameras

    return with_registered_cameras(project)
