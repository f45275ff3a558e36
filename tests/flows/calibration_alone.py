"""A system calibration without report, certificate and page of the check, which take half of its time."""

from __future__ import annotations

from flows.stories.block_preparation import prepare_block
from flows.stories.direct_georeferencing_check import checked_block
from flows.stories.system_calibration import (
    calibrated_block,
    described_calibration,
    publish,
    second_step,
    write_certificate,
)
from tasks.calibration.observable import is_georeferenced, observable
from tasks.georeferencing.registered_cameras import with_initial_calibrations
from tasks.results.publish import OF_CALIBRATIONS
from tasks.results.summary import Summary
from tasks.settings.project import Project
from tasks.store.store import Outputs, Store


def calibration_alone(project: Project, store: Store) -> Summary:
    """The story for tests that read record, tables and summary only."""
    return _published(project, store, *_described(project, store)[1:])


def calibration_with_certificate(project: Project, store: Store) -> Summary:
    """The story for tests that read the certificate of a single camera, too."""
    calibrated, stages, described = _described(project, store)
    certificate = write_certificate(
        store,
        record=described["calibration"],
        stages=(*stages, described),
        project=calibrated,
        certificate=project.certificate,
        project_file=project.source.sha256,
        overrides=project.source.overrides,
        suffix="",
    )
    return _published(project, store, stages, {**described, **certificate})


def _described(project: Project, store: Store) -> tuple[Project, tuple[Outputs, ...], Outputs]:
    """The project with what was free in the end, the stages, and the record of the calibration."""
    project, remarks = observable(with_initial_calibrations(project))
    block = prepare_block(project, store, project.calibration.free)
    one = calibrated_block(project, store, block)
    two = second_step(one, store, block)
    stages = (*block.stages, one.adjusted, one.remarks, *two.outputs)
    if is_georeferenced(project) and not project.has_heads:
        stages = (*stages, checked_block(one.project, store, stages))
    return one.project, stages, described_calibration(one, (*remarks, *two.remarks), two, store, stages)


def _published(project: Project, store: Store, stages: tuple[Outputs, ...], described: Outputs) -> Summary:
    own = (name for name in described if name != "notes")
    return publish(store, project, (*stages, described), (*OF_CALIBRATIONS, *own))
