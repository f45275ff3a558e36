"""System calibration: camera, mounting and GNSS from a calibration flight, in one step and in two."""

from __future__ import annotations

from dataclasses import dataclass

from flows.runs.stage import stage
from flows.stories.aerial_triangulation import (
    adjusted_block,
    deliver,
    remarks_on,
    report_of,
    statements_of,
)
from flows.stories.block_preparation import PreparedBlock, prepare_block
from flows.stories.burn_in import burn_in_protocol_of
from flows.stories.direct_georeferencing_check import checked_block, page_of_check
from flows.stories.two_step_calibration import (
    delivered_orientations,
    means_of_differences,
    two_step_calibration,
)
from tasks.calibration.evidence import model_refuses
from tasks.calibration.observable import control_alone, is_georeferenced, observable
from tasks.calibration.release import Held, Release, held_after, releases, undetermined_after
from tasks.documents.report.provenance import computed_with
from tasks.errors import NotComputableError
from tasks.files.json_text import JSON
from tasks.georeferencing.registered_cameras import with_initial_calibrations
from tasks.results import publish as publishing
from tasks.results.figures import figures_of
from tasks.results.summary import Summary, merged_figures
from tasks.settings.project import Project
from tasks.stages import calibrated_cameras as applied_cameras
from tasks.stages import calibration as describe
from tasks.stages import certificate, platform
from tasks.stages import judgement as judge
from tasks.store.artifact import Artifact
from tasks.store.notes import read_notes
from tasks.store.store import Outputs, Store

judge_release = stage(judge.judge_release)
apply_to_cameras = stage(applied_cameras.apply_to_cameras)
describe_platform = stage(platform.describe_platform)
describe_calibration = stage(describe.describe_calibration)
write_certificate = stage(certificate.write_certificate)
publish = stage(publishing.publish)


@dataclass(frozen=True)
class OneStep:
    """A calibration in the adjustment.

    Attributes
    ----------
    project : with the settings of the last adjustment; its own calibration is what is checked.
    adjusted, remarks : outputs of that adjustment, and the findings on it.
    releases : what was free at each stage and what was held after it.
    """

    project: Project
    adjusted: Outputs
    remarks: Outputs
    releases: tuple[JSON, ...]


@dataclass(frozen=True)
class SecondStep:
    """The two-step calibration in addition; without outputs, remarks say why there is none."""

    outputs: tuple[Outputs, ...] = ()
    remarks: tuple[str, ...] = ()


def system_calibration(project: Project, store: Store) -> Summary:
    """Read the deliveries, calibrate in one step and in two, check what the calibration gives, publish.

    Without image points the second step is all there is.
    """
    if not project.inputs.image_points and project.calibration.adjusted is not None:
        return two_step_calibration(project, store, project.calibration.adjusted)
    alone = len(project.cameras) == 1
    certain = publishing.OF_EVERY_CALIBRATION if alone else publishing.OF_EVERY_ADJUSTMENT
    publishing.require_replaceable(store, certain)
    project, remarks = observable(with_initial_calibrations(project))
    block = prepare_block(project, store, project.calibration.free)
    one = calibrated_block(project, store, block)
    two = second_step(one, store, block)
    stages = (*block.stages, one.adjusted, one.remarks, *two.outputs)
    # Approximate exposures are nothing that could be checked.
    checked = is_georeferenced(project) and not project.has_heads
    if checked:
        stages = (*stages, checked_block(one.project, store, stages))
    heads: Outputs = {}
    if one.project.has_heads:
        heads = described_platform(one, store, block)
        stages = (*stages, heads)
    described = described_calibration(one, (*remarks, *two.remarks), two, store, stages)
    protocol = burn_in_protocol_of(project, store, block, one.adjusted, heads, described)
    stages = (*stages, described, *statements_of(one.project, store, stages))
    pages = (page_of_check(one.project, store, stages),) if checked else ()
    pages = (*pages, report_of(one.project, store, stages))
    certificates = tuple(
        write_certificate(
            store,
            record=record,
            stages=stages,
            project=one.project,
            certificate=project.certificate,
            project_file=project.source.sha256,
            overrides=project.source.overrides,
            suffix=name.removeprefix(describe.CALIBRATION),
        )
        for name, record in described.items()
        if name != "notes"
    )
    own = {name for outputs in (described, *certificates) for name in outputs} - {"notes"}
    summary = publish(
        store,
        project,
        (*stages, *pages, *certificates, *protocol),
        (*publishing.OF_CALIBRATIONS, *sorted(own)),
    )
    return deliver(store, project, summary)


def calibrated_block(project: Project, store: Store, block: PreparedBlock) -> OneStep:
    """Release the parameters in stages; those that are not determined are held from then on."""
    held: Held = {}
    undetermined: tuple[str, ...] = ()
    history: list[JSON] = []
    for wanted in releases(project.calibration, project.adjustment):
        while True:
            release = wanted.without(held)
            used = release.applied_to(project)
            adjusted = adjusted_block(used, store, block)
            judged = _judged(used, store, block, adjusted, release, undetermined)
            found = held_after(judged)
            history.append(release.told(found))
            if not found:
                break
            held = {**held, **found}
        undetermined = undetermined_after(judged)
    # First with the stated σ: estimated ones would hide an error of the model as noise of its group.
    remarks = remarks_on(adjusted, store, calibrating=True)
    found_first = figures_of(merged_figures([read_notes(one["notes"]) for one in (adjusted, remarks)]))
    calibration = used.calibration
    if calibration.variance_components and not model_refuses(found_first, calibration.limits):
        weighting = used.adjustment.model_copy(update={"variance_components": True})
        used = used.model_copy(update={"adjustment": weighting})
        adjusted = adjusted_block(used, store, block)
        remarks = remarks_on(adjusted, store, calibrating=True)
    return OneStep(used, adjusted, remarks, tuple(history))


def _judged(
    project: Project,
    store: Store,
    block: PreparedBlock,
    adjusted: Outputs,
    release: Release,
    undetermined_before: tuple[str, ...],
) -> Artifact:
    """What a release has determined."""
    return judge_release(
        store,
        images=block.approximate["images"],
        parameters=adjusted["parameters"],
        correlations=adjusted["correlations"],
        before=release.before,
        new=release.new,
        additional=release.additional,
        undetermined_before=undetermined_before,
        calibration=project.calibration,
    )["notes"]


def second_step(one: OneStep, store: Store, block: PreparedBlock) -> SecondStep:
    """Average the differences of adjusted orientations to GNSS and INS."""
    calibration = one.project.calibration
    if not calibration.two_step:
        return SecondStep()
    if one.project.has_heads:
        return SecondStep(
            remarks=(
                "There is no two-step calibration and no check of direct georeferencing of a rig: both "
                "handle single cameras only.",
            )
        )
    if not is_georeferenced(one.project):
        return SecondStep(
            remarks=(
                "There is no two-step calibration and no check of direct georeferencing: GNSS and INS are "
                "not both observed.",
            )
        )
    errors: Artifact | None = None
    try:
        if calibration.adjusted is None:
            on_control = _adjusted_on_control(one, store, block)
            adjusted, errors = on_control["exterior_orientations"], on_control["strip_errors"]
        else:
            adjusted = delivered_orientations(one.project, calibration.adjusted, store)["exposures"]
    except NotComputableError as error:
        return SecondStep(
            remarks=(
                "There is no two-step calibration: the block cannot be adjusted with control points only. "
                f"{str(error).partition('. ')[0].rstrip('.')}.",
            )
        )
    return SecondStep((means_of_differences(one.project, store, block.exposures, adjusted, errors),))


def _adjusted_on_control(one: OneStep, store: Store, block: PreparedBlock) -> Outputs:
    """An adjustment on control alone with the calibrated camera."""
    cameras = apply_to_cameras(
        store,
        cameras=block.tables["cameras"],
        parameters=one.adjusted["parameters"],
        correlations=one.adjusted["correlations"],
    )
    again = block.with_cameras(cameras["cameras"])
    calibrated = one.adjusted["parameters"], one.adjusted["correlations"]
    return adjusted_block(control_alone(one.project), store, again, calibrated)


def described_platform(one: OneStep, store: Store, block: PreparedBlock) -> Outputs:
    """Heads of a platform that takes no pictures itself, and the virtual image composed of their images."""
    return describe_platform(
        store,
        parameters=one.adjusted["parameters"],
        correlations=one.adjusted["correlations"],
        cameras=block.tables["cameras"],
        images=block.approximate["images"],
    )


def described_calibration(
    one: OneStep, remarks: tuple[str, ...], two: SecondStep, store: Store, stages: tuple[Outputs, ...]
) -> Outputs:
    """The records of the calibration: covariances, and the verdict from the evidence of all stages."""
    return describe_calibration(
        store,
        stages=stages,
        adjusted=(one.adjusted["notes"], one.remarks["notes"]),
        means=two.outputs[0]["orientation_difference_means"] if two.outputs else None,
        releases=one.releases,
        remarks=remarks,
        settings=one.project.calibration,
        given=one.project.cameras,
        inputs=one.project.inputs,
        gates=one.project.gates,
        crs=one.project.project.crs,
        name=one.project.project.name,
        flown=one.project.project.flown,
        software=computed_with(),
    )
