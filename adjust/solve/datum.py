"""The datum: what fixes the block in space, and what is missing when nothing does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats
from adjust.errors import DatumDefectError
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


def explain_defect(system: System, state: State, null_space: Floats) -> DatumDefectError:
    """Name what a singular reduced system leaves undetermined."""
    layout = system.layout
    of_exposures, _ = datum_basis(state)
    n = layout.images
    parameters: list[str] = []
    sentences: list[str] = []
    border = layout.border_names()
    basis = of_exposures.reshape(6 * n, 7)
    for vector in null_space.T:
        exposures = vector[: 6 * n]
        involved = [
            f"{border[k][0]} of {border[k][1]}"
            for k in np.argsort(-np.abs(vector[6 * n :]), kind="stable")
            if abs(vector[6 * n + k]) > 0.3 * np.max(np.abs(vector[6 * n :]))
        ]
        movement, share = _as_similarity(basis, exposures)
        if share > 0.9:
            sentences.append(f"Nothing fixes the {movement} of the block{_with(involved)}.")
            parameters += [movement, *involved]
        elif involved and np.linalg.norm(exposures) < 1e-6 * np.linalg.norm(vector[6 * n :]):
            sentences.append(f"No observation depends on {', '.join(involved)}.")
            parameters += involved
        else:
            moves = np.linalg.norm(exposures.reshape(n, 6)[:, :3], axis=1)
            image = system.block.images[int(np.argmax(moves))]
            sentences.append(f"The orientation of image {image} is not determined{_with(involved)}.")
            parameters += [f"image {image}", *involved]
    return DatumDefectError(null_space.shape[1], tuple(dict.fromkeys(parameters)), tuple(sentences))


def _with(involved: list[str]) -> str:
    return f" together with {', '.join(involved)}" if involved else ""


def _as_similarity(basis: Floats, exposures: Floats) -> tuple[str, float]:
    """The similarity movement nearest to a direction, in words, and the part of it that it explains."""
    norms = np.linalg.norm(basis, axis=0)
    norms[norms == 0.0] = 1.0
    unit = basis / norms
    coefficients, *_ = np.linalg.lstsq(unit, exposures, rcond=None)
    length = float(np.linalg.norm(exposures))
    if length == 0.0:
        return "", 0.0
    share = 1.0 - float(np.linalg.norm(exposures - unit @ coefficients)) / length
    largest = np.argsort(-np.abs(coefficients), kind="stable")
    names = [
        DATUM_DIRECTIONS[k] for k in largest if abs(coefficients[k]) > 0.3 * abs(coefficients[largest[0]])
    ]
    return " and ".join(names), share
