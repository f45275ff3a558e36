"""Random numbers: one stream for every source of chance, so that they do not disturb each other.

The stream of a source is the child of a seed with the source's fixed number. Switching one source off,
or drawing more from it, leaves the numbers of all others as they were. New sources are appended.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np


class Source(IntEnum):
    """What chance decides in a simulation; the number is the key of its stream and never changes."""

    TERRAIN = 0
    TRAJECTORY = 1
    OBJECT_POINTS = 2
    DETECTION = 3
    IMAGE_ERRORS = 4
    STRIP_BIAS = 5
    STRIP_DRIFT = 6
    IMAGE_NOISE = 7
    CONTROL_NOISE = 8
    GNSS_WHITE = 9
    GNSS_MARKOV = 10
    INS_NOISE = 11
    GROSS_IMAGE_POINTS = 12
    GROSS_CONTROL = 13
    GROSS_TIME = 14
    INS_MARKOV = 15
    INS_STRIP_BIAS = 16
    INS_STRIP_DRIFT = 17
    FILM = 18
    FIDUCIAL_NOISE = 19


@dataclass(frozen=True)
class RandomStreams:
    """The streams that belong to one seed."""

    seed: int

    def of(self, source: Source) -> np.random.Generator:
        """A new generator at the beginning of the stream of a source."""
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(int(source),)))
