"""Direct-georeferencing check: what GNSS, INS and a calibration give without any control."""

from __future__ import annotations

from flows.runs.stage import stage
from flows.stories.aerial_triangulation import adjusted_block, deliver, remarks_on, report_of
from flows.stories.block_preparation import prepare_block
from tasks.documents.report.provenance import delivered_names
from tasks.errors import InputError
from tasks.georeferencing import approved_calibrations as choosing
from tasks.georeferencing.registered_calibration import RegisteredCalibration
from tasks.results import publish as publishing
from tasks.results.summary import Summary
from tasks.settings.project import Project
from tasks.stages import direct_georeferencing, georeferencing_page
from tasks.store.store import Outputs, Store

choose_calibrations = stage(choosing.choose_calibrations)
check_georeferencing = stage(direct_georeferencing.check_georeferencing)
write_georeferencing_page = stage(georeferencing_page.write_georeferencing_page)
publish = stage(publishing.publish)


def direct_georeferencing_check(project: Project, store: Store) -> Summary:
    """Read the deliveries, georeference them with the calibration, compare, report and publish the result.

    The calibration may be what the project's own adjustment estimates; then that is done first.

    Raises
    ------
    InputError
        If the project has a rig: its heads would count one reading of GNSS and INS several times.
    """
    if project.has_heads:
        raise InputError(
            "The check of direct georeferencing is of single cameras; the project has a rig of several heads "
            "that share one reading of GNSS and INS.",
            "Adjust the block with its control points as check points (`role` check): their differences show "
            "what GNSS, INS and the calibration of the rig give together with the image points.",
        )
    adjusts = project.direct_georeferencing.calibration.adjustment
    certain = publishing.OF_EVERY_ADJUSTMENT if adjusts else publishing.OF_EVERY_CHECK
    publishing.require_replaceable(store, certain)
    block = prepare_block(project, store)
    stages = block.stages
    if adjusts:
        adjusted = adjusted_block(project, store, block)
        stages = (*stages, adjusted, remarks_on(adjusted, store))
    stages = (*stages, checked_block(project, store, stages))
    page_outputs = page_of_check(project, store, stages)
    if not adjusts:
        return publish(store, project, (*stages, page_outputs), publishing.OF_CHECKS)
    summary = publish(store, project, (*stages, page_outputs, report_of(project, store, stages)))
    return deliver(store, project, summary)


def checked_block(project: Project, store: Store, stages: tuple[Outputs, ...]) -> Outputs:
    """Georeference a prepared block with the stated calibration, or with that of the preceding adjustment."""
    outputs = {name: artifact for one in stages for name, artifact in one.items()}
    return check_georeferencing(
        store,
        exposures=outputs["exposures"],
        cameras=outputs["cameras"],
        image_points=outputs["image_points"],
        control_points=outputs["control_points"],
        project=project.project,
        direct=project.direct_georeferencing,
        adjustment=project.adjustment,
        checks=project.checks,
        parameters=outputs.get("parameters"),
        correlations=outputs.get("correlations"),
        parameter_influences=outputs.get("parameter_influences"),
        control_residuals=outputs.get("control_residuals"),
        residual_grid=outputs.get("residual_grid"),
        registered=registered_calibrations(project, outputs),
    )


def registered_calibrations(project: Project, outputs: Outputs) -> tuple[RegisteredCalibration, ...]:
    """The calibrations of the registry for the cameras of a project, if it requests them."""
    if not project.direct_georeferencing.calibration.registry:
        return ()
    return choose_calibrations(
        exposures=outputs["exposures"],
        cameras=project.cameras,
        control=project.inputs.control,
        project=project.project,
    )


def page_of_check(project: Project, store: Store, stages: tuple[Outputs, ...]) -> Outputs:
    """The page about the check among the stages."""
    return write_georeferencing_page(
        store,
        stages=stages,
        project=project,
        name=project.project.name,
        files=delivered_names(project),
    )
