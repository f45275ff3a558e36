"""Aerial triangulation: from the deliveries of a flight to adjusted exterior orientations."""

from __future__ import annotations

from flows.runs.stage import stage
from flows.stories.block_preparation import PreparedBlock, prepare_block
from tasks.documents.report.provenance import delivered_names
from tasks.results import publish as publishing
from tasks.results.summary import Summary
from tasks.settings.project import Project
from tasks.settings.trust_map import TrustMapSettings
from tasks.stages import (
    bundle_adjustment_stage,
    delivery,
    remarks_stage,
    report,
    statements,
    trust_map_stage,
)
from tasks.store.artifact import Artifact
from tasks.store.store import Outputs, Store

adjust_bundle = stage(bundle_adjustment_stage.adjust_bundle)
describe_adjustment = stage(remarks_stage.describe_adjustment)
draw_trust_map = stage(trust_map_stage.draw_trust_map)
write_statements = stage(statements.write_statements)
write_report = stage(report.write_report)
publish = stage(publishing.publish)
write_deliveries = stage(delivery.deliver)


def aerial_triangulation(project: Project, store: Store) -> Summary:
    """Read the files, find approximate values, adjust the bundle, report, publish and deliver the result."""
    publishing.require_replaceable(store, publishing.OF_EVERY_ADJUSTMENT)
    block = prepare_block(project, store)
    adjusted = adjusted_block(project, store, block, trust_map=project.trust_map)
    remarks = remarks_on(adjusted, store)
    stages = (*block.stages, adjusted, remarks, *trust_map_of(project, store, adjusted))
    stages = (*stages, *statements_of(project, store, stages))
    summary = publish(store, project, (*stages, report_of(project, store, stages)))
    return deliver(store, project, summary)


def deliver(store: Store, project: Project, summary: Summary) -> Summary:
    """Write the deliveries that the project declares, if any."""
    return write_deliveries(store, project, summary) if project.deliver else summary


def adjusted_block(
    project: Project,
    store: Store,
    block: PreparedBlock,
    calibrated: tuple[Artifact, Artifact] | None = None,
    trust_map: TrustMapSettings | None = None,
) -> Outputs:
    """Adjust the bundle of a prepared block.

    Parameters
    ----------
    calibrated : parameters and correlations its cameras come from, as the first of two steps.
    trust_map : how the accuracy of new points is mapped; None: not at all.
    """
    return adjust_bundle(
        store,
        **block.start,
        project=project.project,
        adjustment=project.adjustment,
        calibrated=calibrated,
        trust_map=trust_map,
    )


def remarks_on(adjusted: Outputs, store: Store, *, calibrating: bool = False) -> Outputs:
    """The findings on an adjusted block, and what the user should know about it, in sentences."""
    return describe_adjustment(
        store,
        notes=adjusted["notes"],
        model_alternatives=adjusted["model_alternatives"],
        distance_residuals=adjusted["distance_residuals"],
        residual_autocorrelation=adjusted["residual_autocorrelation"],
        calibrating=calibrating,
    )


def trust_map_of(project: Project, store: Store, adjusted: Outputs) -> tuple[Outputs, ...]:
    """The trust map of an adjusted block as a raster, if the project requests one and it exists."""
    if project.trust_map is None or "trust_map_cells" not in adjusted:
        return ()
    return (
        draw_trust_map(
            store,
            cells=adjusted["trust_map_cells"],
            notes=adjusted["notes"],
            project=project.project,
            settings=project.trust_map,
        ),
    )


def statements_of(project: Project, store: Store, stages: tuple[Outputs, ...]) -> tuple[Outputs, ...]:
    """The accuracy statements that the project requests for the adjustment among the stages, if any."""
    if not project.statement:
        return ()
    return (write_statements(store, stages=stages, statement=project.statement, name=project.project.name),)


def report_of(project: Project, store: Store, stages: tuple[Outputs, ...]) -> Outputs:
    """Report on the adjustment among the stages."""
    return write_report(
        store,
        stages=stages,
        project=project,
        name=project.project.name,
        flown="" if project.project.flown is None else project.project.flown.isoformat(),
        files=delivered_names(project),
    )
