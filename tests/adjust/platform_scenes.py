"""The four panchromatic heads of a DMC with the attitudes of a published platform calibration."""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.calibration.platform import Ties
from adjust.camera.virtual_image import PlatformHeads, in_heads
from adjust.geometry import rotation

#: Omega, phi, kappa of the heads, degrees, and their positions, metres (certificate DMC01-0008 of 2010).
PUBLISHED = np.array(
    [
        [17.976296, 10.130598, 86.983071],
        [17.959538, -10.164193, 92.882666],
        [-18.001623, -10.101944, -92.699751],
        [-17.931060, 10.138554, -87.060029],
    ]
)
POSITIONS = np.array([[0.064, -0.079, 0.0], [-0.064, -0.079, 0.0], [-0.064, 0.079, 0.0], [0.064, 0.079, 0.0]])
#: Half of the virtual image of 7,680 × 13,824 pixels of 12 µm, along and across the flight, metres.
HALF_VIRTUAL = np.array([7680, 13824]) * 6e-6


def dmc_heads() -> PlatformHeads:
    """Heads of 7,168 × 4,096 pixels of 12 µm and 120 mm."""
    return PlatformHeads(
        rotation.from_omega_phi_kappa(np.deg2rad(PUBLISHED)),
        POSITIONS,
        np.tile([0.120, 0.0, 0.0], (4, 1)),
        np.tile(np.array([7168, 4096]) * 6e-6, (4, 1)),
        0.120,
    )


def virtual_grid(columns: int = 40, rows: int = 60) -> Floats:
    """A grid over the virtual image, (n, 2) metres."""
    x, y = np.meshgrid(
        np.linspace(-HALF_VIRTUAL[0], HALF_VIRTUAL[0], columns),
        np.linspace(-HALF_VIRTUAL[1], HALF_VIRTUAL[1], rows),
    )
    return np.column_stack([x.ravel(), y.ravel()])


def ties_of(heads: PlatformHeads, wanted: int, distance: float, sigma: float, seed: int) -> Ties:
    """Points in the overlaps of heads as they are, measured with noise."""
    random = np.random.default_rng(seed)
    place = random.uniform(-1.0, 1.0, (200 * wanted, 2)) * HALF_VIRTUAL
    below = distance + random.uniform(-25.0, 25.0, len(place))
    seen = np.stack([in_heads(heads, np.full(len(place), k), place, below) for k in range(len(heads))])
    inside = (np.abs(seen) <= heads.half_format[:, None]).all(axis=2)
    twice = np.flatnonzero(inside.sum(axis=0) == 2)[:wanted]
    head = np.stack([np.flatnonzero(inside[:, point]) for point in twice])
    xy = np.swapaxes(seen[head.T, twice], 0, 1) + random.normal(0.0, sigma, (len(twice), 2, 2))
    return Ties(head, xy, below[twice], sigma)
