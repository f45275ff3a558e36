"""Which system parameters the image points touch: interior orientation, additional parameters, heads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Ints
from adjust.observations.image_point import ImagePoints
from adjust.parameters import ADDITIONAL_PARAMETERS, INTERIOR_ORIENTATION, ParameterLayout
from adjust.rig import OF_HEADS


@dataclass(frozen=True, eq=False)
class RayColumns:
    """Columns of the border that rays touch.

    Attributes
    ----------
    of_image : (n, 3 + t) column of c, x0, y0 and t additional parameters of each image; −1 where held. Where
        parameters of heads are free seven more: relative position, relative rotation, synchronisation.
    components : (t,) which components of the additional parameters these are: those free anywhere.
    border : (k,) all columns that occur: those of the cameras ascending, then those of the heads.
    compact : the same as ``of_image`` counted among those in ``border`` alone; ascending in every image.
    """

    of_image: Ints
    components: Ints
    border: Ints
    compact: Ints

    @property
    def principal_point_is_free(self) -> bool:
        """Whether x0 or y0 of a camera is unknown."""
        return bool(np.any(self.of_image[:, 1:3] >= 0))


def ray_columns(layout: ParameterLayout, rays: ImagePoints) -> RayColumns:
    """Columns of the free parameters of the cameras, image by image."""
    of_image = layout.columns[INTERIOR_ORIENTATION][rays.camera_of_image]
    components = np.zeros(0, dtype=np.int64)
    if rays.self_calibration is not None:
        of_entity = layout.columns[ADDITIONAL_PARAMETERS]
        components = np.flatnonzero(np.any(of_entity >= 0, axis=0))
        additional = of_entity[rays.self_calibration.entity_of_image][:, components]
        of_image = np.concatenate([of_image, additional], axis=1)
    heads = [layout.columns[family][rays.camera_of_image] for family in OF_HEADS if family in layout.columns]
    if not any(np.any(columns >= 0) for columns in heads):
        heads = []
    # The kernels fill the upper triangle of the corner.
    border = np.concatenate([np.unique(part[part >= 0]) for part in (of_image, *heads)])
    of_image = np.concatenate([of_image, *heads], axis=1)
    number = np.full(layout.border + 1, -1, dtype=np.int64)
    number[border] = np.arange(len(border))
    return RayColumns(of_image, components, border, number[of_image])
