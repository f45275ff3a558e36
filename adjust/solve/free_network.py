"""Free network: where observations leave the datum open, the approximate values carry it.

The movements of the whole block that no observation notices are the columns of G: N G = 0. They are
combinations of the seven similarity movements, and of system parameters that go with them (a GNSS shift
with a shift of the block). Of the infinitely many solutions the one is taken whose corrections to the
approximate values of chosen unknowns have the least norm; its inner constraints are

    G_selᵀ (x − x⁰) = 0

with the rows of the chosen unknowns in G_sel (Meissl 1962). The dense border of

    [ N       G_sel ]
    [ G_selᵀ    0   ]

is never formed. A few unknowns of exposures, as many as there are open movements and as far apart as
possible, get the weight w of an observation of their own, N + Hᵀ w H. As b ⟂ G, that moves nothing:
H dx = 0. From this minimal datum a movement G t leads to the inner constraints; residuals and
redundancy numbers notice none of it.

Observations of little weight may notice a movement, but by less than the digits of N: it is open, too. What
they say of it arrives as the force w H dx at H, which would turn what they hardly determine. Taken out of b
by F (HG)ᵀ w H dx with Fᵀ G = I, where it moves nothing but G, it leaves the rest where all of them want it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from adjust.arrays import Floats, Ints
from adjust.errors import InconsistentBlockError
from adjust.observations.base import ObservationGroup
from adjust.parameters import InnerConstraints, State
from adjust.rig import RELATIVE_POSITION
from adjust.solve.datum import datum_basis, movements_of_points, noticed_movements
from adjust.solve.full_vectors import FullVectors
from adjust.solve.joined_points import Joins
from adjust.solve.normal_equations import ReducedNormals
from adjust.solve.system import System
from adjust.solve.whitening import add_border_columns, whiten

# Information below this part of what an exposure's own observations would give alone leaves a movement open:
# with it the normal equations would count as singular.
_UNNOTICED = 1e-10
# So many times as much determines the next movement at least: what is left in N of an open one is otherwise a
# part of it. Observations of little weight notice all movements alike.
_GAP = 100.0
# Part of a movement, squared, that must lie in exposures, or in the chosen unknowns.
_MOVES = 1e-10
# A system parameter that takes less than this part in a movement takes none.
_STILL = 1e-12
# So many image points at a time bound the memory of their equations.
_AT_ONCE = 65_536
# No exposure is moved by the datum by more than this part of the σ it would have alone any more.
_SETTLED = 1e-3


@dataclass(frozen=True, eq=False)
class OpenMovements:
    """The movements of a block that its observations leave open, at one state.

    Attributes
    ----------
    vectors : G; its chosen rows are orthonormal, G_selᵀ G_sel = I.
    constrained : the chosen unknowns.
    """

    vectors: FullVectors
    constrained: InnerConstraints

    @property
    def defect(self) -> int:
        """Number d of open movements."""
        return self.vectors.count

    @property
    def selected(self) -> FullVectors:
        """G_sel: the rows of the chosen unknowns, zero elsewhere."""
        return _selected(self.vectors, self.constrained)

    def held(self, normals: ReducedNormals) -> ReducedNormals:
        """Normal equations N + Hᵀ w H: d unknowns of exposures hold the datum."""
        held, weight = self._held_unknowns(normals), normals.diagonal_exposure.ravel()
        exposure, component = np.divmod(held, 6)
        blocks = normals.blocks.copy()
        blocks[normals.pattern.diagonal[exposure], component, component] += weight[held]
        return replace(normals, blocks=blocks)

    def relieved(self, normals: ReducedNormals, of_exposures: Floats) -> ReducedNormals:
        """The same normal equations with b − F (HG)ᵀ w H dx for increments dx (n, 6) of theirs.

        F = W G (Gᵀ W G)⁻¹ with the weights W of all exposures, in whose metric G is orthogonal to what is not
        open.
        """
        held, weight = self._held_unknowns(normals), normals.diagonal_exposure.ravel()
        moved = self.vectors.of_exposures.reshape(-1, self.defect)
        force = moved[held].T @ (weight[held] * of_exposures.ravel()[held])
        spread = weight * (moved @ np.linalg.solve(moved.T @ (weight[:, None] * moved), force))
        return replace(normals, rhs_exposure=normals.rhs_exposure - spread.reshape(-1, 6))

    def _held_unknowns(self, normals: ReducedNormals) -> Ints:
        """Numbers (d,) of unknowns of exposures: each moves most with what the ones before leave free."""
        root = np.sqrt(normals.diagonal_exposure).reshape(-1, 1)
        scaled = root * self.vectors.of_exposures.reshape(-1, self.defect)
        *_, order = scipy.linalg.qr(scaled.T, mode="economic", pivoting=True)
        return np.asarray(order[: self.defect], dtype=np.int64)

    def towards_approximate_values(
        self, system: System, state: State, of_exposures: Floats, of_points: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """The movement G t, (n, 6), (g,), (m, 3), after which the inner constraints are kept.

        G_selᵀ (x + dx + G t − x⁰) = 0 for increments dx of the exposures (n, 6) and points (m, 3).
        """
        start, chosen = system.block.approximate_state(), self.selected
        centres = state.projection_centre + of_exposures[:, :3] - start.projection_centre
        points = state.object_point + of_points - start.object_point
        t = -np.einsum("nid,ni->d", chosen.of_exposures[:, :3], centres)
        t -= np.einsum("mid,mi->d", chosen.of_points, points)
        return self.vectors.of_exposures @ t, self.vectors.of_border @ t, self.vectors.of_points @ t


def settled(normals: ReducedNormals, added: Floats) -> bool:
    """Whether a movement (n, 6) added for the datum is negligible for every exposure."""
    return bool(np.all(np.abs(added) * np.sqrt(normals.diagonal_exposure) < _SETTLED))


def open_movements(system: System, state: State, normals: ReducedNormals) -> OpenMovements | None:
    """The movements that nothing notices; None where the network is not free or nothing is open.

    Image points notice none of the seven, and every system parameter they know; so the other groups decide.
    In a rig they notice a scale, as long as the relative positions of its heads do not scale with the block.

    Raises
    ------
    InconsistentBlockError : if the chosen unknowns cannot carry the datum.
    """
    if system.inner_constraints is None:
        return None
    movements = datum_basis(state)
    coefficients, of_border = _unnoticed(system, state, normals, movements)
    if coefficients.shape[1] == 0:
        return None
    of_points = movements_of_points(state, np.arange(system.layout.points)) @ coefficients
    of_points = np.where(system.active_point[:, None, None], of_points, 0.0)
    of_joins = [
        joined.moved(of_points)
        for group in system.observations.others
        if (joined := Joins.of(whiten(group, group.linearize(state)))) is not None
    ]
    vectors = FullVectors(movements @ coefficients, np.concatenate([of_border, *of_joins]), of_points)
    return OpenMovements(_orthonormal(vectors, system.inner_constraints), system.inner_constraints)


def _unnoticed(
    system: System, state: State, normals: ReducedNormals, movements: Floats
) -> tuple[Floats, Floats]:
    """Coefficients (7, d) of the similarity movements and rows (g, d) of the system parameters."""
    g = system.layout.border
    # What rays know does not move with the block.
    along = np.setdiff1d(np.arange(g), system.ray_columns.border)
    if RELATIVE_POSITION in system.layout.columns:
        columns = system.layout.columns[RELATIVE_POSITION]
        along = np.union1d(along, columns[columns >= 0])
    scale, size = _scale(normals, movements, normals.diagonal_border[along]), 7 + len(along)
    # The triangle of the rows: their squares would hide small information next to large in rounding.
    triangle = np.zeros((size, size))
    for group in _noticing(system):
        equations = whiten(group, group.linearize(state))
        of_border = np.zeros((*equations.misclosure.shape, g))
        for term in equations.terms:
            if term.block in system.layout.columns:
                columns = system.layout.columns[term.block][term.index]
                add_border_columns(of_border, columns, term.jacobian)
        noticed = np.concatenate([noticed_movements(equations, state, movements), of_border[:, :, along]], 2)
        rows = noticed.reshape(-1, size) @ scale
        # Where a row knows more than the rays of an exposure, the block bends before it moves.
        rows /= np.hypot(1.0, np.linalg.norm(rows, axis=1))[:, None]
        triangle = np.asarray(np.linalg.qr(np.concatenate([triangle, rows]), mode="r"))
    _, roots, vectors = np.linalg.svd(triangle)
    null = vectors[::-1].T[:, : _open(roots[::-1] ** 2)]
    null[7:][np.abs(null[7:]) < _STILL] = 0.0
    # What moves system parameters only is not a datum: it stays, and is refused as a singularity.
    _, sizes, turned = np.linalg.svd(null[:7], full_matrices=False)
    found = scale @ null @ turned[sizes**2 > _MOVES].T
    of_border = np.zeros((g, found.shape[1]))
    of_border[along] = found[7:]
    return found[:7], of_border


def _open(information: Floats) -> int:
    """Number of movements that are open, the least informed first."""
    count = int(np.searchsorted(information, _UNNOTICED))
    while 0 < count < len(information) and information[count] < _GAP * information[count - 1]:
        count += 1
    return count


def _noticing(system: System) -> Iterator[ObservationGroup]:
    """The groups that may notice a movement of the block; of a rig its image points, too, some at a time."""
    yield from system.observations.others
    if system.block.rig is not None:
        rays = system.observations.image_points
        for first in range(0, len(rays.image), _AT_ONCE):
            yield rays.only(np.arange(first, min(first + _AT_ONCE, len(rays.image))))


def _scale(normals: ReducedNormals, movements: Floats, diagonal: Floats) -> Floats:
    """Units T of movements and system parameters: metres and radians cannot be compared.

    TᵀC T of the information C is one where it is as large as that of one exposure, or of one system
    parameter, if all else were known.

    Raises
    ------
    InconsistentBlockError : if nothing is known of the exposures.
    """
    metric = np.einsum("nik,ni,nil->kl", movements, normals.diagonal_exposure, movements) / len(movements)
    scale = np.diag(np.concatenate([np.ones(7), 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))]))
    try:
        scale[:7, :7] = np.linalg.inv(np.linalg.cholesky(metric)).T
    except np.linalg.LinAlgError as error:
        raise InconsistentBlockError(
            "Nothing in the free network has a shape: no object point is measured in two images. Add image "
            "points that are common to images, or observations that fix the block."
        ) from error
    return scale


def _selected(vectors: FullVectors, constrained: InnerConstraints) -> FullVectors:
    """The rows of the chosen unknowns, zero elsewhere."""
    of_exposures = np.zeros_like(vectors.of_exposures)
    of_points = np.zeros_like(vectors.of_points)
    if constrained != "object_points":
        of_exposures[:, :3] = vectors.of_exposures[:, :3]
    if constrained != "projection_centres":
        of_points = vectors.of_points
    return FullVectors(of_exposures, np.zeros_like(vectors.of_border), of_points)


def _orthonormal(vectors: FullVectors, constrained: InnerConstraints) -> FullVectors:
    """The same movements with G_selᵀ G_sel = I."""
    chosen = _selected(vectors, constrained)
    gram = chosen.dot(chosen)
    values = np.linalg.eigvalsh(gram)
    if values[0] <= _MOVES * values[-1]:
        words = {"object_points": "object points", "projection_centres": "projection centres"}
        named = words.get(constrained, "projection centres and object points")
        raise InconsistentBlockError(
            f"The {named} cannot define the datum of a free network: an undetermined movement of the "
            "block does not change them, such as a rotation about the line on which they lie."
        )
    return vectors.times(np.linalg.inv(np.linalg.cholesky(gram)).T)
