"""Heads of a rig that were exposed late, and where that is not known well enough."""

from __future__ import annotations

import numpy as np

from adjust.quality.late_heads import unknown_carriage
from adjust.result import AdjustmentResult
from adjust.rig import SYNCHRONISATION_OFFSET
from tasks.results.figures import LateHeadFigure

# A smaller part of a σ adds less than half a percent to it.
_PART = 0.1


def late_head_figures(result: AdjustmentResult) -> tuple[LateHeadFigure, ...]:
    """Heads that errors of the boresight, which σ do not contain, move by more than a tenth of a σ."""
    (error, part), block = unknown_carriage(result), result.block
    found = []
    for head in np.unique(block.camera_of_image[part > _PART]):
        image = int(np.argmax(np.where(block.camera_of_image == head, part, 0.0)))
        offset = float(result.state.system[SYNCHRONISATION_OFFSET][head, 0])
        found.append(
            LateHeadFigure(
                head=block.cameras[head].name,
                offset_s=offset,
                sigma_m=float(error[image]),
                part_of_sigma=float(part[image]),
            )
        )
    return tuple(found)
