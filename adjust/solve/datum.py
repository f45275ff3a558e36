"""The datum: what fixes the block in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.rotation import cross_matrix
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT, State
from adjust.solve.normal_equations import System, whiten

DATUM_DIRECTIONS = (
    "shift in x",
    "shift in y",
    "shift in z",
    "rotation about x",
    "rotation about y",
    "rotation about z",
    "scale",
)


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


def datum_basis(state: State) -> tuple[Floats, Floats]:
    """The seven similarity movements of the block: (n, 6, 7) on exposures, (m, 3, 7) on points.

    Shifts by 1 m along x, y, z; rotations by 1 rad about x, y, z and scale by 1 about the centroid of
    the projection centres. Image points do not notice them (as long as c is held).
    """
    centre = state.projection_centre.mean(axis=0)
    exposures = state.projection_centre - centre
    points = state.object_point - centre
    n, m = len(exposures), len(points)
    of_exposures, of_points = np.zeros((n, 6, 7)), np.zeros((m, 3, 7))
    of_exposures[:, :3, :3] = np.eye(3)
    of_exposures[:, :3, 3:6] = -cross_matrix(exposures)
    of_exposures[:, 3:, 3:6] = np.swapaxes(state.local_from_camera, 1, 2)
    of_exposures[:, :3, 6] = exposures
    of_points[:, :, :3] = np.eye(3)
    of_points[:, :, 3:6] = -cross_matrix(points)
    of_points[:, :, 6] = points
    return of_exposures, of_points


def datum_shares(system: System, state: State) -> tuple[DatumShare, ...]:
    """Which groups of observations fix which direction of the datum, and how well."""
    of_exposures, of_points = datum_basis(state)
    names: list[str] = []
    information: list[Floats] = []
    for group in system.observations.others:
        equations = whiten(group, group.linearize(state))
        moved = np.zeros((*equations.misclosure.shape, 7))
        for term in equations.terms:
            if term.block == EXTERIOR_ORIENTATION:
                moved += term.jacobian @ of_exposures[term.index]
            elif term.block == OBJECT_POINT:
                moved += term.jacobian @ of_points[term.index]
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
