"""Errors that corrections of image coordinates leave in everything that is adjusted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from adjust.arrays import Floats, Ints
from adjust.observations.base import Linearization
from adjust.observations.image_point import ImagePoints
from adjust.quality.unknown_errors import UnknownErrors


@dataclass(frozen=True, eq=False)
class CorrectionErrors(UnknownErrors):
    """What k independent errors of unit variance in the corrections of image coordinates change.

    Attributes
    ----------
    at : errors (r, 2, k) of the corrections themselves, metres, at image points (r, 2) of images (r,).
    sigma : standard deviation that systematic errors of the image coordinates are taken to have, metres, of
        each set of images; None for one without corrections.
    parts : into how many, along each side, the sub-areas of each set were divided to see errors within them.
    """

    at: Callable[[Ints, Floats], Floats]
    sigma: Sequence[float | None]
    parts: Sequence[int | None]

    def of_rays(self, rays: ImagePoints, equations: Linearization) -> Floats:
        """Errors (n, 2, k) of computed − corrected image coordinates, metres; equations not whitened."""
        return self.of_computed(equations) - self.at(rays.image, rays.xy)
