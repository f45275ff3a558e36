"""The datum: what fixes the block in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.geometry.rotation import cross_matrix
from adjust.observations.base import Linearization
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT, State
from adjust.solve.system import System
from adjust.solve.whitening import whiten

DATUM_DIRECTIONS = (
    "shift in x",
    "shift in y",
    "shift in z",
    "rotation about x",
    "rotation about y",
    "rotation about z",
    "scale",
)


# A sum below this part of its addends is rounding.
_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class DatumShare:
    """How strongly each group of observations holds one direction of the datum.

    Attributes
    ----------
    direction : one of ``DATUM_DIRECTIONS``.
    sigma : standard deviation with which all groups together hold it if nothing else were unknown;
        metres for shifts, radians for rotations, relative for the scale. Infinite if nothing does.
    shares : (group name, part of the information), largest first, parts above 0.1 %.
    """

    direction: str
    sigma: float
    shares: tuple[tuple[str, float], ...]


def datum_basis(state: State) -> Floats:
    """The seven similarity movements of the exposures, (n, 6, 7).

    Shifts by 1 m along x, y, z; rotations by 1 rad about x, y, z and scale by 1 about the centroid of
    the projection centres. Image points do not notice them (as long as c is held) if the object points
    move likewise, see :func:`movements_of_points`.
    """
    exposures = state.projection_centre - state.projection_centre.mean(axis=0)
    movements = np.zeros((len(exposures), 6, 7))
    movements[:, :3] = _similarity(exposures)
    movements[:, 3:, 3:6] = np.swapaxes(state.local_from_camera, 1, 2)
    return movements


def movements_of_points(state: State, point: Ints) -> Floats:
    """The same movements of some object points (k,), (k, 3, 7)."""
    return _similarity(state.object_point[point] - state.projection_centre.mean(axis=0))


def _similarity(x: Floats) -> Floats:
    """Movements (n, 3, 7) of points (n, 3) that count from the fixed point of rotation and scale."""
    movements = np.zeros((len(x), 3, 7))
    movements[:, :, :3] = np.eye(3)
    movements[:, :, 3:6] = -cross_matrix(x)
    movements[:, :, 6] = x
    return movements


def noticed_movements(equations: Linearization, state: State, of_exposures: Floats) -> Floats:
    """What the seven movements of everything change in whitened observations of one group, (n, m, 7).

    Zero where only rounding is left: a rotation turns both ends of a distance alike.

    Parameters
    ----------
    of_exposures : the movements of the exposures, see :func:`datum_basis`.
    """
    moved, addends = (np.zeros((*equations.misclosure.shape, 7)) for _ in range(2))
    for term in equations.terms:
        if term.block == EXTERIOR_ORIENTATION:
            movements = of_exposures[term.index]
        elif term.block == OBJECT_POINT:
            movements = movements_of_points(state, term.index)
        else:
            continue
        moved += term.jacobian @ movements
        addends += np.abs(term.jacobian) @ np.abs(movements)
    return np.where(np.abs(moved) > _ROUNDING * addends, moved, 0.0)


def datum_shares(system: System, state: State) -> tuple[DatumShare, ...]:
    """Which groups of observations fix which direction of the datum, and how well."""
    of_exposures = datum_basis(state)
    names: list[str] = []
    information: list[Floats] = []
    for group in system.observations.others:
        equations = whiten(group, group.linearize(state))
        moved = noticed_movements(equations, state, of_exposures)
        names.append(group.name)
        information.append(np.sum(moved**2, axis=(0, 1)))
    shares = []
    for index, direction in enumerate(DATUM_DIRECTIONS):
        parts = np.array([part[index] for part in information])
        total = float(parts.sum())
        sigma = float("inf") if total <= 0.0 else 1.0 / np.sqrt(total)
        order = np.argsort(-parts, kind="stable")
        listed = tuple(
            (names[k], float(parts[k] / total)) for k in order if total > 0 and parts[k] > 1e-3 * total
        )
        shares.append(DatumShare(direction, float(sigma), listed))
    return tuple(shares)
