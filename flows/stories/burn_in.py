"""The triangulation with virtual images that ends a burn-in flight, and its protocol."""

from __future__ import annotations

from collections.abc import Mapping

from flows.runs.stage import stage
from flows.stories.aerial_triangulation import adjusted_block, remarks_on
from flows.stories.block_preparation import ImportedBlock, PreparedBlock
from tasks.settings.adjustment import SelfCalibrationSettings
from tasks.settings.project import Project
from tasks.settings.published_sweep import published_table
from tasks.stages import burn_in_protocol, virtual_images
from tasks.store.artifact import Artifact
from tasks.store.store import Outputs, Store

compose_virtual_images = stage(virtual_images.compose_virtual_images)
write_burn_in_protocol = stage(burn_in_protocol.write_burn_in_protocol)


def burn_in_protocol_of(
    project: Project,
    store: Store,
    block: PreparedBlock,
    calibrated: Outputs,
    platform: Outputs,
    described: Outputs,
) -> tuple[Outputs, ...]:
    """Compose the virtual images, triangulate them, write the protocol; nothing if none is requested.

    Parameters
    ----------
    block : the flight of the heads.
    calibrated : outputs of its last adjustment.
    platform : the heads as calibrated.
    described : the verdict of the calibration.
    """
    if project.burn_in is None or "platform" not in platform:
        return ()
    composed = compose_virtual_images(
        store,
        parameters=calibrated["parameters"],
        correlations=calibrated["correlations"],
        cameras=block.tables["cameras"],
        images=block.approximate["images"],
        exposures=block.tables["exposures"],
        image_points=block.tables["image_points"],
        project=project.project,
    )
    own = triangulation_of(project)
    virtual = ImportedBlock(composed, block.control, composed).approximated(own, store, ())
    adjusted = adjusted_block(own, store, virtual)
    remarks = remarks_on(adjusted, store)
    stages: tuple[Mapping[str, Artifact], ...] = (
        composed,
        block.control,
        virtual.approximate,
        adjusted,
        remarks,
    )
    comparison = project.burn_in.compare_with
    protocol = write_burn_in_protocol(
        store,
        stages=stages,
        platform=platform["platform"],
        calibration=described["notes"],
        project=own,
        published=None if comparison is None else published_table(comparison),
    )
    return ({"notes": composed["notes"]}, protocol)


def triangulation_of(project: Project) -> Project:
    """The same project with the virtual image as its only camera, and without self-calibration."""
    assert project.burn_in is not None  # a story of projects that want a protocol
    (platform,) = {camera.head.reference for camera in project.cameras.values() if camera.head is not None}
    adjustment = project.adjustment.model_copy(
        update={"free": project.burn_in.free, "self_calibration": SelfCalibrationSettings()}
    )
    return project.model_copy(
        update={"cameras": {platform: project.cameras[platform]}, "adjustment": adjustment}
    )
