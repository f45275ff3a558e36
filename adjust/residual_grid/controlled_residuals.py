"""Which residuals of an adjustment reveal errors of the measurements."""

from __future__ import annotations

import numpy as np

from adjust.arrays import Bools
from adjust.residual_grid.residual_grid import LEAST_REDUNDANCY
from adjust.result import GroupResult, ObservationStatus


def controlled(rays: GroupResult) -> Bools:
    """(n, 2) the residuals of image points that show errors: used, and controlled by other observations."""
    used = rays.status == ObservationStatus.USED
    return np.asarray(used & (rays.redundancy > LEAST_REDUNDANCY))
