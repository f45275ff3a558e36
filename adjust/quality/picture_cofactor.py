"""Cofactors of the exterior orientations of pictures: of a rig they follow from event and head.

    Q_ij = [E_i H_i] Q [E_j H_j]ᵀ

with the derivatives E by the pose of the event and H by what belongs to the head, see
:mod:`adjust.rig`. What is held of a head has no error, unless it is considered: the errors of considered
parameters and of corrections move the event, and those of a head its pictures, too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.parameters import ParameterLayout, State
from adjust.quality.cofactor import Cofactor
from adjust.quality.unknown_errors import UnknownErrors
from adjust.rig import OF_HEADS
from adjust.solve.covisibility import Covisibility
from adjust.solve.factorization import ReducedCofactor

# Pairs of pictures that are worked on together: some hundred megabytes.
_PAIRS_AT_ONCE = 50_000


def picture_cofactors(state: State, layout: ParameterLayout, quality: Cofactor, sigma0: float) -> Floats:
    """Those (n, 6, 6) of every picture, as of :func:`cofactors_between_pictures`."""
    every = np.arange(len(state.pictures.projection_centre))
    return cofactors_between_pictures(state, layout, quality, sigma0, every, every)


def cofactors_between_pictures(
    state: State, layout: ParameterLayout, quality: Cofactor, sigma0: float, one: Ints, other: Ints
) -> Floats:
    """Cofactors (k, 6, 6) which, times σ0², are covariances of pictures (k,) with others (k,).

    Of projection centre, local axes, and small rotation in the camera frame, with the errors of considered
    parameters and of corrections of image coordinates.

    Parameters
    ----------
    one, other : pictures whose events are joined in the pattern.
    """
    found = _between(state, layout, quality.reduced, one, other)
    for errors in (quality.considered, quality.corrections):
        if errors is not None:
            of_pictures = _errors_of_pictures(state, errors) / sigma0
            found = found + of_pictures[one] @ np.swapaxes(of_pictures[other], 1, 2)
    return found


def _errors_of_pictures(state: State, errors: UnknownErrors) -> Floats:
    """Errors (n, 6, k) of projection centre and small rotation."""
    if state.rig is None:
        return errors.of_unknowns.of_exposures
    of_event, of_head = state.pictures.jacobians()
    heads = np.concatenate([errors.of_families[family] for family in OF_HEADS], axis=1)
    of_events = errors.of_unknowns.of_exposures[state.rig.event_of_image]
    return np.asarray(of_event @ of_events + of_head @ heads[state.rig.camera_of_image])


def _between(
    state: State, layout: ParameterLayout, reduced: ReducedCofactor, one: Ints, other: Ints
) -> Floats:
    """Cofactors (k, 6, 6) without those errors."""
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
        blocks[part] = _between(state, layout, reduced, row[part], column[part])
    border = of_event @ reduced.border[state.rig.event_of_image] + of_head @ of_heads
    return replace(reduced, pattern=pairs, blocks=blocks, border=np.ascontiguousarray(border))
