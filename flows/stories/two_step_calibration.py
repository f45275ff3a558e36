"""Two-step calibration by itself: delivered orientations of another adjustment against GNSS and INS."""

from __future__ import annotations

from flows.runs.stage import stage
from flows.stories.block_preparation import import_exposures
from tasks.documents.report.provenance import delivered_names
from tasks.results import publish as publishing
from tasks.results.summary import Summary
from tasks.settings.inputs import ExposuresInput
from tasks.settings.project import Project
from tasks.stages import two_step, two_step_judgement, two_step_report
from tasks.store.artifact import Artifact
from tasks.store.store import Outputs, Store

calibrate_in_two_steps = stage(two_step.calibrate_in_two_steps)
judge_two_steps = stage(two_step_judgement.judge_two_steps)
write_two_step_report = stage(two_step_report.write_two_step_report)
publish = stage(publishing.publish)


def two_step_calibration(project: Project, store: Store, adjusted: ExposuresInput) -> Summary:
    """Read both orientations, average their differences, judge, report and publish the result."""
    publishing.require_replaceable(store, publishing.OF_EVERY_TWO_STEP_CALIBRATION)
    delivered = delivered_orientations(project, adjusted, store)
    read = import_exposures(
        store, sources=project.inputs.exposures, cameras=project.cameras, project=project.project
    )
    means = means_of_differences(project, store, read, delivered["exposures"])
    judged = judge_two_steps(store, two_step=means["notes"], limits=project.calibration.limits)
    # Of the delivered orientations only the notes: the exposures of the result are those of GNSS and INS.
    stages: tuple[Outputs, ...] = ({"notes": delivered["notes"]}, read, means, judged)
    report = write_two_step_report(
        store, stages=stages, project=project, name=project.project.name, files=delivered_names(project)
    )
    return publish(store, project, (*stages, report), publishing.OF_CALIBRATIONS)


def delivered_orientations(project: Project, adjusted: ExposuresInput, store: Store) -> Outputs:
    """Orientations of another program's adjustment."""
    return import_exposures(store, sources=(adjusted,), cameras=project.cameras, project=project.project)


def means_of_differences(
    project: Project, store: Store, read: Outputs, adjusted: Artifact, errors: Artifact | None = None
) -> Outputs:
    """Average the differences of adjusted orientations to GNSS and INS.

    Parameters
    ----------
    read : exposures and cameras as imported.
    errors : ``strip_errors`` of an adjustment of ours; None: not known.
    """
    return calibrate_in_two_steps(
        store,
        exposures=read["exposures"],
        adjusted=adjusted,
        cameras=read["cameras"],
        project=project.project,
        mounting=project.calibration.mounting,
        limits=project.calibration.limits,
        strip_bias_m=project.adjustment.priors.gnss_strip_bias_m,
        strip_errors=errors,
    )
