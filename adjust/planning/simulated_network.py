"""The network of a simulated block: its true geometry, and the standard deviations it states."""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.parameters import BORESIGHT, INTERIOR_ORIENTATION, LEVER_ARM
from adjust.planning.network import PlannedControl, PlannedExposures, PlannedNetwork, PlannedRays
from adjust.rig import OF_HEADS
from adjust.simulate.image_errors import image_format_of
from adjust.simulate.truth import BlockSpecification, BlockTruth, block_truth


def simulated_network(specification: BlockSpecification) -> PlannedNetwork:
    """The network of a specification; no noise is drawn, and check points are rays only.

    Raises
    ------
    InconsistentBlockError : if the flight plan gives no block.
    """
    truth = block_truth(specification)
    plan, flown, noise = truth.plan, truth.trajectory, specification.noise
    n = len(plan.images)
    exposures = PlannedExposures(
        plan.camera,
        plan.flight,
        plan.strip,
        flown.time,
        flown.velocity,
        flown.rate,
        flown.projection_centre,
        truth.state.local_from_camera,
        np.tile(noise.stated_gnss, (n, 1)),
        np.asarray(specification.frame.local_from_enu(flown.projection_centre)),
        np.tile(np.diag(noise.stated_ins**2), (n, 1, 1)),
        np.ones(n, dtype=bool),
    )
    rig = truth.state.rig
    names = (INTERIOR_ORIENTATION, BORESIGHT, LEVER_ARM, *(() if rig is None else OF_HEADS))
    return PlannedNetwork(
        specification.frame,
        specification.cameras,
        plan.flights,
        plan.strips,
        exposures,
        truth.state.object_point,
        PlannedRays(truth.image, truth.point, np.full((len(truth.image), 2), noise.image)),
        _control(truth, np.array(noise.control)),
        {name: truth.state.system[name] for name in names},
        tuple(image_format_of(specification.image_errors, camera) for camera in specification.cameras),
        (0,) * len(specification.cameras),
        rig=rig,
    )


def _control(truth: BlockTruth, sigma: Floats) -> PlannedControl:
    kept = np.flatnonzero(~truth.is_check)
    covariance = np.tile(np.diag(sigma**2), (len(kept), 1, 1))
    return PlannedControl(truth.surveyed[kept], covariance, truth.present[kept])
