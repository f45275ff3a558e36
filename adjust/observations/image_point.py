"""Image points: measured image coordinates of object points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.errors import InconsistentBlockError
from adjust.observations import image_point_kernel
from adjust.observations.base import Linearization, StochasticModel, Term
from adjust.parameters import (
    EXTERIOR_ORIENTATION,
    INTERIOR_ORIENTATION,
    OBJECT_POINT,
    State,
    Unit,
)


@dataclass(frozen=True, eq=False)
class ImagePoints:
    """Image coordinates, sorted by object point.

    The observation is zero when the ray through the measured point meets the object point:

        x − x0 = −c p1/p3,    y − y0 = −c p2/p3,    p = R_cᵀ (X − X0)

    Attributes
    ----------
    image, point : (n,) indices; point is ascending.
    camera_of_image : index of the camera of every image of the block.
    xy : (n, 2) metres, image system.
    sigma : (n, 2) metres.
    active : (n,) false for rejected observations.
    """

    image: Ints
    point: Ints
    camera_of_image: Ints
    xy: Floats
    sigma: Floats
    active: Bools

    name: ClassVar[str] = "image_points"
    components: ClassVar[tuple[str, ...]] = ("x", "y")
    unit: ClassVar[Unit] = "m"

    def __post_init__(self) -> None:
        if np.any(np.diff(self.point) < 0):
            raise InconsistentBlockError("Image points must be sorted by object point.")
        if not (np.all(self.sigma > 0.0) and np.isfinite(self.sigma).all() and np.isfinite(self.xy).all()):
            raise InconsistentBlockError(
                "Image coordinates and their sigmas must be finite, sigmas positive."
            )

    @cached_property
    def inverse_sigma(self) -> Floats:
        """(n, 2) 1/σ, zero for rejected observations."""
        return np.where(self.active[:, None], 1.0 / self.sigma, 0.0)

    @cached_property
    def stochastic(self) -> StochasticModel:
        """The weights in the general form (the kernels use ``inverse_sigma``)."""
        return StochasticModel.from_sigma(self.sigma).without(~self.active)

    def linearize(self, state: State) -> Linearization:
        """Observation equations at a state, not whitened; derivatives exact."""
        n = len(self.image)
        misclosure, of_exterior = np.empty((n, 2)), np.empty((n, 2, 6))
        of_interior, of_point = np.empty((n, 2, 3)), np.empty((n, 2, 3))
        image_point_kernel.linearize_all(
            self.image,
            self.point,
            self.camera_of_image,
            state.projection_centre,
            state.local_from_camera,
            state.object_point,
            state.system[INTERIOR_ORIENTATION],
            self.xy,
            np.ones((n, 2)),
            misclosure,
            of_exterior,
            of_interior,
            of_point,
        )
        camera = self.camera_of_image[self.image]
        terms = (
            Term(EXTERIOR_ORIENTATION, self.image, of_exterior),
            Term(OBJECT_POINT, self.point, of_point),
            Term(INTERIOR_ORIENTATION, camera, of_interior),
        )
        return Linearization(misclosure, terms)

    def misclosure(self, state: State) -> Floats:
        """Observed − computed (n, 2), metres; NaN where the object point lies behind the camera."""
        result: Floats = image_point_kernel.misclosures(
            self.image,
            self.point,
            self.camera_of_image,
            state.projection_centre,
            state.local_from_camera,
            state.object_point,
            state.system[INTERIOR_ORIENTATION],
            self.xy,
        )
        return result

    def without(self, rejected: Bools) -> Self:
        """The same group with the image points (n,) that are rejected taken out."""
        return replace(self, active=self.active & ~rejected)

    def rescaled(self, factor: Floats) -> Self:
        """The same group with its standard deviations multiplied by factors that broadcast to (n, 2)."""
        return replace(self, sigma=self.sigma * factor)
