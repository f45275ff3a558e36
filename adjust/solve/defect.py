"""What singular normal equations leave undetermined, in words.

The null space comes as an arbitrary basis; a mixture of seven movements tells nobody anything. So
each datum direction is looked for in it by itself, then what is left is brought to a basis in which
every direction has as few parameters as possible. All comparisons are made in units of the standard
deviation each unknown would have alone, because metres and radians cannot be compared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from adjust.arrays import Floats
from adjust.errors import DatumDefectError
from adjust.parameters import State
from adjust.solve.datum import DATUM_DIRECTIONS, datum_basis
from adjust.solve.factorization import SingularNormalsError
from adjust.solve.full_vectors import FullVectors
from adjust.solve.normal_equations import ReducedNormals
from adjust.solve.system import System

# A datum direction lies in the null space if it is reproduced to this part of its length.
_CONTAINED = 1e-2
# A parameter is named if it takes at least this part of the largest one's change.
_INVOLVED = 0.1
# Changes of the exposures below this part of a direction are rounding.
_STILL = 1e-4


@dataclass(frozen=True, eq=False)
class _NullSpace:
    """Orthonormal basis (6 n + g, k) in units of each unknown's own σ, split into its two parts."""

    of_exposures: Floats
    of_border: Floats
    border_names: tuple[str, ...]

    def involved(self, coefficients: Floats, least: float = 0.0) -> tuple[str, ...]:
        """System parameters that change most in one direction of the null space, strongest first."""
        change = np.abs(self.of_border @ coefficients)
        if change.size == 0 or change.max() <= least:
            return ()
        # Of changes that are equal but for rounding the first parameter comes first.
        order = np.argsort(-np.round(change / change.max(), 6), kind="stable")
        return tuple(self.border_names[k] for k in order if change[k] > max(_INVOLVED * change.max(), least))


@dataclass(frozen=True)
class OpenDirection:
    """A movement of the whole block that the observations leave open.

    Attributes
    ----------
    movement : one of ``DATUM_DIRECTIONS``, or several of them in words.
    parameters : system parameters that go with it, strongest first.
    """

    movement: str
    parameters: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.movement}{_together(self.parameters)}"


def explain_defect(system: System, state: State, singular: SingularNormalsError) -> DatumDefectError:
    """Name what a singular reduced system leaves undetermined."""
    n, g = system.layout.events, system.layout.border
    scaled = singular.null_space / singular.scale[:, None]
    null = _NullSpace(scaled[: 6 * n], scaled[6 * n : 6 * n + g], _border_names(system))
    movements = datum_basis(state).reshape(6 * n, 7) / singular.scale[: 6 * n, None]
    directions, found = _pure_directions(null, movements)
    parameters: list[str] = []
    sentences = [
        f"Nothing fixes the {direction.movement} of the block{_together(direction.parameters)}."
        for direction in directions
    ]
    for direction in directions:
        parameters += [direction.movement, *direction.parameters]
    of_block = bool(directions)
    for coefficients in _sparse_rest(null, found).T:
        sentence, named, moves = _rest(system, null, movements, coefficients)
        sentences.append(sentence)
        parameters += named
        of_block |= moves
    return DatumDefectError(scaled.shape[1], tuple(dict.fromkeys(parameters)), tuple(sentences), of_block)


def open_directions(
    system: System, state: State, normals: ReducedNormals, vectors: FullVectors
) -> tuple[OpenDirection, ...]:
    """Name the movements that a free network has open."""
    n, g, d = system.layout.events, system.layout.border, vectors.count
    root = np.sqrt(np.where(normals.diagonal_exposure > 0.0, normals.diagonal_exposure, 1.0)).reshape(-1, 1)
    diagonal = normals.diagonal_border[:g]
    root_border = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    basis = np.concatenate(
        [root * vectors.of_exposures.reshape(6 * n, d), root_border[:, None] * vectors.of_border[:g]]
    )
    basis, _ = np.linalg.qr(basis)
    null = _NullSpace(basis[: 6 * n], basis[6 * n :], _border_names(system))
    movements = root * datum_basis(state).reshape(6 * n, 7)
    directions, found = _pure_directions(null, movements)
    for coefficients in _sparse_rest(null, found).T:
        combined = _combination(movements, null.of_exposures @ coefficients)
        directions.append(
            OpenDirection(f"movement that combines {_and(combined)}", null.involved(coefficients, _STILL))
        )
    return tuple(directions)


def _border_names(system: System) -> tuple[str, ...]:
    return tuple(str(quantity) for quantity in system.layout.border_quantities)


def _pure_directions(null: _NullSpace, movements: Floats) -> tuple[list[OpenDirection], list[Floats]]:
    """The datum directions that lie in the null space by themselves, and their coefficients (k,) in it."""
    directions: list[OpenDirection] = []
    found: list[Floats] = []
    for name, movement in zip(DATUM_DIRECTIONS, movements.T, strict=True):
        length = float(np.linalg.norm(movement))
        coefficients = np.linalg.pinv(null.of_exposures, rcond=_STILL) @ movement
        missed = float(np.linalg.norm(null.of_exposures @ coefficients - movement))
        if length > 0.0 and missed < _CONTAINED * length:
            directions.append(OpenDirection(name, null.involved(coefficients, _STILL * length)))
            found.append(coefficients)
    return directions, found


def _sparse_rest(null: _NullSpace, found: list[Floats]) -> Floats:
    """Coefficients (k, rest) of what the found directions leave, each with few system parameters."""
    dimension = null.of_exposures.shape[1]
    rest = scipy.linalg.null_space(np.stack(found), rcond=1e-6) if found else np.eye(dimension)
    of_border = null.of_border @ rest
    if rest.shape[1] == 0 or np.linalg.matrix_rank(of_border, tol=_STILL) < rest.shape[1]:
        return np.asarray(rest)
    # Reduced echelon form: with the pivot rows made the identity each direction has one pivot of its own.
    _, _, order = scipy.linalg.qr(of_border.T, pivoting=True, mode="economic")
    pivots = of_border[np.sort(order[: rest.shape[1]])]
    return np.asarray(rest @ np.linalg.inv(pivots))


def _rest(
    system: System, null: _NullSpace, movements: Floats, coefficients: Floats
) -> tuple[str, list[str], bool]:
    """One undetermined direction that is not a datum direction by itself.

    Returns
    -------
    sentence, parameters, of_block : the last whether it is a movement of the whole block.
    """
    exposures = null.of_exposures @ coefficients
    length = float(np.linalg.norm(exposures))
    whole = float(np.hypot(length, np.linalg.norm(null.of_border @ coefficients)))
    involved = null.involved(coefficients)
    if length < _STILL * whole and len(involved) == 1:
        return f"No observation depends on {involved[0]}.", list(involved), False
    if length < _STILL * whole:
        return f"{_and(involved)} cannot be separated.", list(involved), False
    involved = null.involved(coefficients, _STILL * whole)
    combined = _combination(movements, exposures)
    if combined:
        sentence = f"Nothing fixes a movement of the block that combines {_and(combined)}"
        return f"{sentence}{_together(involved)}.", [*combined, *involved], True
    largest = np.argmax(np.linalg.norm(exposures.reshape(-1, 6), axis=1))
    kind = "image" if system.block.rig is None else "event"
    image = f"{kind} {system.block.events[int(largest)]}"
    sentence = f"The orientation of {image} is not determined{_together(involved)}."
    return sentence, [image, *involved], False


def _combination(movements: Floats, exposures: Floats) -> tuple[str, ...]:
    """The datum directions that make up a movement of the exposures; none if it is not a similarity."""
    unit = movements / np.maximum(np.linalg.norm(movements, axis=0), np.finfo(float).tiny)
    parts, *_ = np.linalg.lstsq(unit, exposures, rcond=None)
    missed = float(np.linalg.norm(unit @ parts - exposures))
    if missed > _CONTAINED * float(np.linalg.norm(exposures)):
        return ()
    order = np.argsort(-np.abs(parts), kind="stable")
    return tuple(DATUM_DIRECTIONS[k] for k in order if abs(parts[k]) > _INVOLVED * np.abs(parts).max())


def _and(names: tuple[str, ...]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _together(involved: tuple[str, ...]) -> str:
    return f" together with {_and(involved)}" if involved else ""
