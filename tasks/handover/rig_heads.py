"""Which images of a block the heads of a rig took together, for formats that have rigs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from adjust.arrays import Floats, Ints
from tasks.block.exposure_events import joined_images

# Relative poses of one head in all its events: metres, and elements of rotations.
_SAME_M, _SAME_ROTATION = 1e-6, 1e-9


@dataclass(frozen=True, eq=False)
class RigHeads:
    """Heads and events.

    Attributes
    ----------
    reference : (c,) reference head of each camera; a camera alone is its own; −1 if it took no image.
    event : (n,) number of the event of each image, from 0.
    """

    reference: Ints
    event: Ints

    def against_reference(
        self, camera: Ints, rotation: Floats, translation: Floats
    ) -> tuple[Floats, Floats] | None:
        """Rotations (c, 3, 3) and translations (c, 3) head from reference head.

        Parameters
        ----------
        camera : (n,) of the images.
        rotation, translation : (n, 3, 3) and (n, 3): X_camera = R X + t.

        Returns
        -------
        None if a head never has its reference head beside it, or sits in its events in different ways, as
        with an offset between the shutters: no format of rigs can have that.
        """
        turn, shift = np.tile(np.eye(3), (len(self.reference), 1, 1)), np.zeros((len(self.reference), 3))
        first = np.full(int(self.event.max(initial=-1)) + 1, -1)
        is_reference = self.reference[camera] == camera
        first[self.event[is_reference]] = np.flatnonzero(is_reference)
        for head in np.flatnonzero(self.reference != np.arange(len(self.reference))):
            image = np.flatnonzero((camera == head) & (first[self.event] >= 0))
            beside = first[self.event[image]]
            if not len(image):
                return None
            turns = rotation[image] @ np.swapaxes(rotation[beside], 1, 2)
            shifts = translation[image] - np.einsum("nij,nj->ni", turns, translation[beside])
            turn[head], shift[head] = turns[0], shifts[0]
            if np.abs(turns - turns[0]).max() > _SAME_ROTATION or np.abs(shifts - shifts[0]).max() > _SAME_M:
                return None
        return turn, shift


def rig_heads(exposures: pd.DataFrame, cameras: pd.DataFrame, names: list[str]) -> RigHeads | None:
    """Heads and events of the images of these names; None without rigs.

    Parameters
    ----------
    exposures, cameras : tables of the results, the cameras in their order.
    """
    own = np.where(cameras["head_of"].notna(), cameras["head_of"], cameras["camera"])
    listed = pd.Index(cameras["camera"])
    reference = listed.get_indexer(pd.Index(own)).astype(np.int64)
    if (reference == np.arange(len(reference))).all() or (reference < 0).any():
        return None
    taken = exposures.set_index("image").loc[names]
    camera = listed.get_indexer(pd.Index(taken["camera"]))
    flight = np.unique(taken["flight"].fillna(""), return_inverse=True)[1]
    event = joined_images(
        taken["time_s"].to_numpy(np.float64),
        flight,
        taken["event"].fillna("").to_numpy(),
        reference[camera],
        (np.bincount(reference) > 1)[reference[camera]],
    )
    return RigHeads(reference, event)
