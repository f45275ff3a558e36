"""What is not known of the way on which late heads were carried: the boresight directs their velocity.

The boresight b by which the motion is turned is no unknown of the image points (:mod:`adjust.rig`), so its
errors there are in no standard deviation. Turned back into the axes of the body, they move a head by

    d(X0) = τ_h [v_b]× E(b) db,    Cov = τ_h² [v_b]× E Cov(b) Eᵀ [v_b]×ᵀ

across the flight. Along it, where they would look like another τ_h, they move nothing.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.parameters import BORESIGHT
from adjust.quality.considered import with_considered
from adjust.result import AdjustmentResult
from adjust.result_columns import sigma_of_images
from adjust.rig import SYNCHRONISATION_OFFSET


def unknown_carriage(result: AdjustmentResult) -> tuple[Floats, Floats]:
    """Its σ (n,) for every picture, metres, across the flight where it is largest, and as part of σ of X0.

    Of the σ of the three coordinates of the projection centre it is the smallest that counts.
    """
    rig, system = result.block.rig, result.state.system
    if rig is None or rig.motion is None or not system[SYNCHRONISATION_OFFSET].any():
        return np.zeros(len(result.block.images)), np.zeros(len(result.block.images))
    reference, later = rig.reference[rig.camera_of_image], system[SYNCHRONISATION_OFFSET][rig.camera_of_image]
    turns = rotation.roll_pitch_yaw_jacobian(system[BORESIGHT])[reference]
    carried = later[:, :, None] * rotation.cross_matrix(rig.motion.velocity[rig.event_of_image]) @ turns
    covariance = carried @ _of_boresights(result)[reference] @ np.swapaxes(carried, 1, 2)
    sigma = np.sqrt(np.maximum(np.linalg.eigvalsh(covariance)[:, -1], 0.0))
    return sigma, sigma / sigma_of_images(result)[:, :3].min(axis=1)


def _of_boresights(result: AdjustmentResult) -> Floats:
    """Covariance (c, 3, 3) of the boresight of every camera, free or considered."""
    columns, block = result.layout.columns[BORESIGHT], result.block
    of_free = with_considered(result.cofactor, result.sigma0).reduced.corner * result.sigma0**2
    # What is held is in one more column, of zeros.
    place = np.where(columns >= 0, columns, len(of_free))
    found = np.pad(of_free, (0, 1))[place[:, :, None], place[:, None, :]]
    if block.considered is not None:
        for i, one in enumerate(block.considered.places):
            for k, other in enumerate(block.considered.places):
                if one[:2] == other[:2] and one.family == BORESIGHT:
                    found[one.entity, one.component, other.component] = block.considered.covariance[i, k]
    return np.asarray(found)
