"""Stereo models: pairs of successive images of a strip, and the points they share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.observations.image_point import ImagePoints


@dataclass(frozen=True, eq=False)
class StereoModels:
    """m pairs of images.

    Attributes
    ----------
    left, right : (m,) indices of the images, in the order of flight.
    """

    left: Ints
    right: Ints

    @property
    def count(self) -> int:
        """Number of models m."""
        return len(self.left)


@dataclass(frozen=True, eq=False)
class CommonPoints:
    """Points measured in both images of a model, model by model.

    Attributes
    ----------
    model : (q,) ascending.
    left, right : (q,) indices of the image points in the left and in the right image.
    """

    model: Ints
    left: Ints
    right: Ints


def consecutive_images(strip: Ints, order: Floats) -> StereoModels:
    """Models of successive images.

    Parameters
    ----------
    strip : (n,) images of different strips (and different cameras in one) form no model; −1: none at all.
    order : (n,) ascending along the strip, such as the time of exposure.
    """
    sequence = np.lexsort((order, strip))
    sequence = sequence[strip[sequence] >= 0]
    left, right = sequence[:-1], sequence[1:]
    follows = strip[left] == strip[right]
    return StereoModels(left[follows], right[follows])


def common_points(rays: ImagePoints, models: StereoModels) -> CommonPoints:
    """The points that were measured in both images of each model.

    An image is the left one of at most one model, so every image point has at most one partner.
    """
    images = len(rays.camera_of_image)
    model_of_left = np.full(images, -1, dtype=np.int64)
    model_of_left[models.left] = np.arange(models.count)
    # Rays are sorted by point, not necessarily by image within a point.
    order = np.lexsort((rays.image, rays.point))
    keys = rays.point[order] * images + rays.image[order]
    left = order[model_of_left[rays.image[order]] >= 0]
    model = model_of_left[rays.image[left]]
    wanted = rays.point[left] * images + models.right[model]
    place = np.minimum(np.searchsorted(keys, wanted), max(len(keys) - 1, 0))
    found = keys[place] == wanted if len(keys) else np.zeros(0, dtype=bool)
    left, right, model = left[found], order[place[found]], model[found]
    by_model = np.argsort(model, kind="stable")
    return CommonPoints(model[by_model], left[by_model], right[by_model])
