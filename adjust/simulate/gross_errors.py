"""Gross errors: wrong image points, swapped names of control points, strips with a wrong time.

Each is listed with what was done, so that a search for gross errors can be judged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.simulate.random_streams import RandomStreams, Source


@dataclass(frozen=True)
class GrossErrorSpecification:
    """How many gross errors there are, and how large; metres and seconds.

    Attributes
    ----------
    image_rate : part of the image points that are wrong.
    image_size : smallest and largest error; the direction is any.
    control_swaps : pairs of surveyed points whose coordinates are exchanged.
    wrong_strips : strips whose positions belong to another moment.
    time_error : by how much, seconds.
    """

    image_rate: float = 0.0
    image_size: tuple[float, float] = (20e-6, 200e-6)
    control_swaps: int = 0
    wrong_strips: int = 0
    time_error: float = 1.0


@dataclass(frozen=True, eq=False)
class GrossErrors:
    """What was made wrong.

    Attributes
    ----------
    image_points : (g,) which rays.  displacement : (g, 2) metres.
    swapped : (w, 2) which surveyed points were exchanged with each other.
    strips : (s,) which strips.  time_error : seconds.
    """

    image_points: Ints
    displacement: Floats
    swapped: Ints
    strips: Ints
    time_error: float


def gross_errors_of(
    specification: GrossErrorSpecification,
    streams: RandomStreams,
    xy: Floats,
    half_format: Floats,
    swappable: Ints,
    strips: int,
) -> GrossErrors:
    """Choose what is wrong.

    Parameters
    ----------
    xy : (r, 2) image points; none is displaced out of its image.
    half_format : (r, 2) half sides of their images.
    swappable : indices of the surveyed points that may be swapped.
    strips : number of strips.
    """
    random = streams.of(Source.GROSS_IMAGE_POINTS)
    chosen = np.flatnonzero(random.uniform(size=len(xy)) < specification.image_rate)
    size = random.uniform(*specification.image_size, len(chosen))
    direction = random.uniform(0.0, 2.0 * np.pi, len(chosen))
    displacement = size[:, None] * np.stack([np.cos(direction), np.sin(direction)], -1)
    outside = np.abs(xy[chosen] + displacement) > half_format[chosen]
    displacement = np.where(outside, -displacement, displacement)
    pairs = min(specification.control_swaps, len(swappable) // 2)
    shuffled = streams.of(Source.GROSS_CONTROL).permutation(swappable)[: 2 * pairs]
    wrong = streams.of(Source.GROSS_TIME).permutation(strips)[: specification.wrong_strips]
    return GrossErrors(
        chosen.astype(np.int64),
        displacement,
        shuffled.reshape(pairs, 2).astype(np.int64),
        np.sort(wrong).astype(np.int64),
        specification.time_error,
    )
