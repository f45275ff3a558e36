"""The stages of all stories: one row for each, in an order that suits every story."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from tasks.production.run_record import SWEEP

TRIANGULATION, CALIBRATION = "aerial-triangulation", "system-calibration"
CHECK, IMAGE_QUALITY = "direct-georeferencing-check", "image-quality"
_BLOCKS = (TRIANGULATION, CALIBRATION, CHECK, SWEEP)


@dataclass(frozen=True)
class StageRow:
    """A stage as the production page shows it.

    Attributes
    ----------
    name : as in the store (`tasks.store.store.stored`).
    label : head of its column.
    always : stories that come to it whatever their project file says.
    often : stories that may do without it, and usually do not.

    Other stories show it once they have come to it.
    """

    name: str
    label: str
    always: tuple[str, ...] = ()
    often: tuple[str, ...] = ()


STAGES: Mapping[str, StageRow] = {
    row.name: row
    for row in (
        StageRow("import_exposures", "exposures", _BLOCKS, (IMAGE_QUALITY,)),
        StageRow("import_control", "control", _BLOCKS),
        StageRow("import_image_points", "image points", _BLOCKS),
        StageRow("film_orientations", "film"),
        StageRow("approximate_values", "approximate", _BLOCKS),
        StageRow("sub_block", "sub-blocks", often=(SWEEP,)),
        StageRow("control_roles", "control roles", often=(SWEEP,)),
        StageRow("bundle_adjustment", "adjustment", (TRIANGULATION, CALIBRATION, SWEEP), (CHECK,)),
        StageRow("judgement", "judgement", (CALIBRATION,)),
        StageRow("remarks", "remarks", (TRIANGULATION, CALIBRATION), (CHECK,)),
        StageRow("trust_map", "trust map"),
        StageRow("calibrated_cameras", "cameras", often=(CALIBRATION,)),
        StageRow("two_step", "two steps", often=(CALIBRATION,)),
        StageRow("platform", "platform"),
        StageRow("calibration", "calibration", (CALIBRATION,)),
        StageRow("virtual_images", "virtual images"),
        StageRow("burn_in_protocol", "burn-in"),
        StageRow("statements", "statements"),
        StageRow("direct_georeferencing", "direct check", (CALIBRATION, CHECK)),
        StageRow("georeferencing_page", "check page", (CALIBRATION, CHECK)),
        StageRow("report", "report", (TRIANGULATION, CALIBRATION), (CHECK,)),
        StageRow("certificate", "certificate", (CALIBRATION,)),
        StageRow("sweep_table", "sweep table", (SWEEP,)),
        StageRow("sweep_page", "sweep page", (SWEEP,)),
        StageRow("image_quality", "edges, noise", often=(IMAGE_QUALITY,)),
        StageRow("smear_motion", "smear", often=(IMAGE_QUALITY,)),
        StageRow("sensor_quality", "sensor", often=(IMAGE_QUALITY,)),
        StageRow("drift", "drift", often=(IMAGE_QUALITY,)),
        StageRow("image_quality_page", "quality page", (IMAGE_QUALITY,)),
        StageRow("radiometric_certificate", "radiometric certificate", often=(IMAGE_QUALITY,)),
    )
}


def stages_of(story: str) -> tuple[str, ...]:
    """The stages that a story is expected to come to, in their order; empty: no story of ours."""
    return tuple(row.name for row in STAGES.values() if story in row.always or story in row.often)
