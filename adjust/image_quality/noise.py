"""Noise of images: in homogeneous areas, by grey level, without the structure of the scene.

The mask N = [1 −2 1; −2 4 −2; 1 −2 1] takes away whatever is linear; of white noise σ it leaves 6 σ (Immerkær
1996). Its median does not mind the edges of the scene:

    σ = 1.4826 median |I ∗ N| / 6
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adjust.arrays import Floats

_OF_MASK = 6.0
_OF_MEDIAN = 1.4826


def masked(grey: NDArray[Any]) -> Floats:
    """I ∗ N (rows − 2, columns − 2) of an image (rows, columns)."""
    image = np.asarray(grey, dtype=np.float32)
    across = image[:, 2:] - 2.0 * image[:, 1:-1] + image[:, :-2]
    return np.asarray(across[2:] - 2.0 * across[1:-1] + across[:-2])


def noise_of(grey: NDArray[Any]) -> float:
    """Standard deviation of the noise of an image (rows, columns), grey values; NaN if it is too small.

    In an image of whole grey values the quantisation is a part of it.
    """
    if min(grey.shape) < 3:
        return float("nan")
    return float(_OF_MEDIAN * np.median(np.abs(masked(grey))) / _OF_MASK)
