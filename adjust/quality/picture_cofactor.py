"""Cofactors of the exterior orientations of pictures: of a rig they follow from event and head.

    Q_ij = [E_i H_i] Q [E_j H_j]ᵀ

with the derivatives E by the pose of the event and H by what belongs to the head, see
:mod:`adjust.rig`. What is held of a head has no error.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.parameters import ParameterLayout, State
from adjust.rig import OF_HEADS
from adjust.solve.covisibility import Covisibility
from adjust.solve.factorization import ReducedCofactor

# Pairs of pictures that are worked on together: some hundred megabytes.
_PAIRS_AT_ONCE = 50_000


def picture_cofactors(state: State, layout: ParameterLayout, reduced: ReducedCofactor) -> Floats:
    """Cofactors (n, 6, 6) of projection centre, local axes, and small rotation in the camera frame."""
    if state.rig is None:
        return reduced.of_exposures
    every = np.arange(len(state.rig.event_of_image))
    return cofactors_between_pictures(state, layout, reduced, every, every)


def cofactors_between_pictures(
    state: State, layout: ParameterLayout, reduced: ReducedCofactor, one: Ints, other: Ints
) -> Floats:
    """Cofactors (k, 6, 6) of pictures (k,) with others (k,), whose events are joined in the pattern."""
    if state.rig is None:
        return reduced.between(one, other)
    event, camera = state.rig.event_of_image, state.rig.camera_of_image
    of_event, of_head = state.pictures.jacobians()
    columns = np.concatenate([layout.columns[family] for family in OF_HEADS], axis=1)[camera]
    # What is held is in one more column, of zeros.
    place = np.where(columns >= 0, columns, len(reduced.corner))
    border = np.concatenate([reduced.border, np.zeros((*reduced.border.shape[:2], 1))], axis=2)
    own = np.pad(reduced.corner, (0, 1))[place[one][:, :, None], place[other][:, None, :]]

    def mixed(exposure: Ints, head: Ints) -> Floats:
        """(k, 6, 7) of the events of pictures with the heads of others."""
        return np.stack([border[event[exposure], :, place[head, k]] for k in range(place.shape[1])], axis=2)

    events = reduced.between(event[one], event[other])
    of_one = np.concatenate([of_event[one], of_head[one]], axis=2)
    of_other = np.concatenate([of_event[other], of_head[other]], axis=2)
    upper = np.concatenate([events, mixed(one, other)], axis=2)
    lower = np.concatenate([np.swapaxes(mixed(other, one), 1, 2), own], axis=2)
    return np.asarray(of_one @ np.concatenate([upper, lower], axis=1) @ np.swapaxes(of_other, 1, 2))


def reduced_to_pictures(
    state: State, layout: ParameterLayout, reduced: ReducedCofactor, pairs: Covisibility
) -> ReducedCofactor:
    """Cofactors of the pictures of a rig in place of those of its events.

    Parameters
    ----------
    pairs : of pictures; their events are joined in the pattern of the given cofactors.
    """
    assert state.rig is not None
    of_event, of_head = state.pictures.jacobians()
    columns = np.concatenate([layout.columns[family] for family in OF_HEADS], axis=1)
    columns = columns[state.rig.camera_of_image]
    of_heads = np.where((columns >= 0)[:, :, None], reduced.corner[columns], 0.0)
    row, column = pairs.row, pairs.column
    blocks = np.empty((len(column), 6, 6))
    for first in range(0, len(column), _PAIRS_AT_ONCE):
        part = slice(first, first + _PAIRS_AT_ONCE)
        blocks[part] = cofactors_between_pictures(state, layout, reduced, row[part], column[part])
    border = of_event @ reduced.border[state.rig.event_of_image] + of_head @ of_heads
    return replace(reduced, pattern=pairs, blocks=blocks, border=np.ascontiguousarray(border))
