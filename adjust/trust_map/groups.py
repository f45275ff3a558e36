"""Groups of cells that are worked on side by side."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adjust.arrays import Ints
from adjust.trust_map import groups_kernel


class CellGroups(NamedTuple):
    """Groups of cells, each with all images that any of its cells sees.

    Attributes
    ----------
    cells : (c,) those that at least two images see, group after group.
    cell_start : (groups + 1,) where the cells of each group begin.
    images : images of each group, ascending, group after group.
    image_start : (groups + 1,) where they begin.
    """

    cells: Ints
    cell_start: Ints
    images: Ints
    image_start: Ints

    @classmethod
    def of(cls, start: Ints, image: Ints) -> CellGroups:
        """Group the cells whose rays start[j] … start[j + 1] − 1 are, images ascending.

        Runs of cells with the same images mostly lie in rows above each other. They are brought together by a
        hash of their images; two sets of images with the same hash do no harm. Small sets with nearly the
        same images, which follow each other when sorted by their first images, share a group.
        """
        runs, keys = groups_kernel.runs_of_images(start, image)
        runs = runs[np.argsort(keys, kind="stable")]
        begun, sorted_by = groups_kernel.sets_of_runs(runs, start, image)
        order = np.lexsort(sorted_by)
        return cls(*groups_kernel.groups_of_sets(runs, begun, sorted_by[2], order, start, image))
