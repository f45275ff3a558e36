"""Image points without distortion, and the inverse: additional parameters and mean residuals.

Both are points in the image system, from the centre of the format.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.correction import measured_from_ideal
from tasks.handover.results import CalibratedCamera


def ideal_points(camera: CalibratedCamera, measured: Floats) -> Floats:
    """Ideal points (n, 2) of measured ones (n, 2), metres."""
    return np.asarray(camera.corrected(measured) + np.array(camera.frame.principal_point))


def measured_points(camera: CalibratedCamera, ideal: Floats) -> Floats:
    """Measured points (n, 2) of ideal ones (n, 2), metres; at a seam, a nearby one."""
    x0 = np.array(camera.frame.principal_point)
    found, _ = measured_from_ideal(
        camera.additional, camera.values, ideal - x0, lambda reduced: camera.mean_residuals(reduced + x0)
    )
    return np.asarray(found + x0)
