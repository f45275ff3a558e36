"""Ground cells and the images that see them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.block import Block
from adjust.parameters import INTERIOR_ORIENTATION, State
from adjust.simulate.visibility import ImageGeometry, images_of_points


@dataclass(frozen=True, eq=False)
class GroundCells:
    """m points of the ground, each standing for a cell of a grid, row after row.

    Attributes
    ----------
    x_in_local : (m, 3) metres, local frame.
    local_from_axes : (m, 3, 3) the axes in which accuracies are wanted, the third one up.
    neighbour : (m,) index of the next cell of the same row, −1 where there is none.
    """

    x_in_local: Floats
    local_from_axes: Floats
    neighbour: Ints


@dataclass(frozen=True, eq=False)
class Sight:
    """Which images see which cells, cell after cell, images ascending.

    Attributes
    ----------
    start : (m + 1,) where the rays of each cell begin.
    image : (r,) index of the image.
    """

    start: Ints
    image: Ints

    @property
    def rays(self) -> Ints:
        """(m,) number of images that see each cell."""
        return np.diff(self.start)

    def of_events(self, event_of_image: Ints | None) -> Sight:
        """Which events of a rig see which cells, each once; None: every image is an event."""
        if event_of_image is None:
            return self
        cells, events = len(self.start) - 1, int(event_of_image.max()) + 1
        cell = np.repeat(np.arange(cells), self.rays)
        cell, event = np.divmod(np.unique(cell * events + event_of_image[self.image]), events)
        return Sight(np.searchsorted(cell, np.arange(cells + 1)).astype(np.int64), event)

    def where(self, chosen: Bools) -> Sight:
        """That of some cells (m,)."""
        rays = self.rays
        return Sight(np.append(0, np.cumsum(rays[chosen])), self.image[np.repeat(chosen, rays)])

    def only(self, chosen: Ints) -> Sight:
        """That of some cells (k,), in their order."""
        count = self.rays[chosen]
        start = np.append(0, np.cumsum(count))
        return Sight(
            start, self.image[np.repeat(self.start[chosen] - start[:-1], count) + np.arange(start[-1])]
        )


def sight_of(block: Block, state: State, x_in_local: Floats) -> Sight:
    """The images in whose format each of the places (m, 3) in the local frame lies.

    Formats are taken without distortion, and nothing on the ground hides anything.
    """
    interior = state.system[INTERIOR_ORIENTATION][block.camera_of_image]
    half_format = np.array([camera.half_format for camera in block.cameras])[block.camera_of_image]
    pictures = state.pictures
    images = ImageGeometry(pictures.projection_centre, pictures.local_from_camera, interior, half_format)
    return Sight(*images_of_points(images, x_in_local))
