"""The block moved as a whole: by finite similarities, which deform nothing.

Observations of little weight may leave a similarity movement with a σ of degrees or of a part of the flying
height. Added to coordinates, an increment of a rotation θ is a tangent: it stretches the block by θ²/2, which
image points notice at a small part of that σ. So a step is split into the movement of the block, made
exactly, and the rest, and what holds the block as a whole is minimised over these few movements alone; image
points notice none of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Floats
from adjust.errors import DatumDefectError, InconsistentBlockError
from adjust.geometry import rotation
from adjust.parameters import State
from adjust.solve.datum import DATUM_DIRECTIONS, datum_basis, movements_of_points, noticed_movements
from adjust.solve.normal_equations import reduced_normals
from adjust.solve.step import Step
from adjust.solve.system import System
from adjust.solve.whitening import whiten

# Radians, or logarithm of a scale, that one step may turn or stretch the block.
_FAR = 0.5
# A step of an iteration that diverges would stretch the block beyond all numbers.
_MOST_STRETCH = 20.0
_MOST_STEPS, _SMALLEST_GAIN = 100, 1e-10
# Directions that change the observations by less than this part of the others are left as they are.
_UNKNOWN = 1e-12
_FIRST_DAMPING = 1e-14
# A σ of this many radians, or of so large a part of the scale, is beyond what a network is expected to have.
_WEAK, _ANY = 1e-3, np.pi / 2.0
# Part of the largest component that makes one worth a word.
_INVOLVED = 0.1


@dataclass(frozen=True, eq=False)
class WholeBlock:
    """The similarity movements of a block at one state.

    Attributes
    ----------
    every : (7, k) combinations of ``DATUM_DIRECTIONS``, each of which moves the exposures by as much as one σ
        of theirs, if all else were known, in the mean square. In a rig the scale is left: the mountings of
        its heads do not go with it.
    held : (7, k − d) those that the observations do not leave open.
    """

    system: System
    every: Floats
    held: Floats

    @classmethod
    def of(cls, step: Step) -> WholeBlock:
        """At the state before a step."""
        weight = np.sqrt(step.normals.diagonal_exposure).reshape(-1, 1)
        count = 7 if step.system.block.rig is None else 6
        moved = weight * datum_basis(step.state).reshape(len(weight), 7)[:, :count]
        _, sizes, directions = np.linalg.svd(moved, full_matrices=False)
        every = np.zeros((7, count))
        every[:count] = np.sqrt(step.system.layout.events) * directions.T / sizes
        held = every
        if step.movements is not None:
            is_open = weight * step.movements.vectors.of_exposures.reshape(len(weight), -1)
            turned, *_ = np.linalg.svd((moved @ every[:count]).T @ is_open)
            held = every @ turned[:, step.movements.defect :]
        return cls(step.system, every, held)

    def moved(self, step: Step) -> State:
        """The state after a step whose movement of the block is made exactly."""
        state, (exposures, border, points) = step.state, step.increments
        weight = np.sqrt(step.normals.diagonal_exposure).reshape(-1, 1)
        own = weight * (datum_basis(state) @ self.every).reshape(len(weight), -1)
        part = self.every @ np.linalg.lstsq(own, weight[:, 0] * exposures.ravel(), rcond=None)[0]
        rest_of_points = points - movements_of_points(state, np.arange(len(points))) @ part
        rest = self.system.layout.update(state, exposures - datum_basis(state) @ part, border, rest_of_points)
        return transformed(rest, part, state.projection_centre.mean(axis=0))

    def placed(self, state: State) -> State:
        """The state with the block moved as a whole to where the observations that hold it fit best."""
        damping, (rows, misclosure) = 0.0, self._held(state)
        for _ in range(_MOST_STEPS):
            left, sizes, right = np.linalg.svd(rows, full_matrices=False)
            known = sizes > _UNKNOWN * sizes.max(initial=0.0)
            part = left[:, known].T @ misclosure
            shrunk = sizes[known] ** 2 / (sizes[known] ** 2 + damping * sizes.max(initial=0.0) ** 2)
            promised = float(np.sum((2.0 - shrunk) * shrunk * part**2))
            if promised < _SMALLEST_GAIN:
                break
            movement = self.held @ (right[known].T @ (shrunk * part / sizes[known]))
            new = transformed(state, movement, state.projection_centre.mean(axis=0))
            following = self._held(new)
            gain = float(misclosure @ misclosure - following[1] @ following[1]) / promised
            if np.linalg.norm(movement[3:6]) > _FAR or abs(movement[6]) > _FAR or not gain > 0.0:
                damping = max(10.0 * damping, _FIRST_DAMPING)
                continue
            state, (rows, misclosure) = new, following
            damping *= 0.1 if gain > 0.75 else 1.0
        return state

    def weakest(self, state: State) -> str:
        """The movement that is held least and its σ in words; empty if it is held as well as usual.

        Where the block is placed best: a tilt may be held by its square alone.
        """
        _, sizes, right = np.linalg.svd(self._held(self.placed(state))[0], full_matrices=False)
        if len(sizes) == 0 or sizes[-1] <= 0.0:
            return ""
        return _in_words(self.held @ right[-1] / sizes[-1])

    def weakest_bending(self, state: State) -> str:
        """The same where the block may bend, with which a movement may be free that is held without.

        Of increments e of the exposures with weights W, movements are the part p = (W B)⁺ W e, B the columns
        of ``held``, with the covariance (W B)⁺ W Q W (W B)⁺ᵀ whatever else moves: that of the largest σ.
        """
        try:
            step = Step.newton(self.system, state, reduced_normals(self.system, state))
        except (DatumDefectError, InconsistentBlockError):
            return ""
        weight = np.sqrt(step.normals.diagonal_exposure).reshape(-1, 1)
        own = weight * (datum_basis(state) @ self.held).reshape(len(weight), -1)
        part, nothing = np.linalg.pinv(own) * weight.T, np.zeros_like(step.normals.rhs_border)
        solve = step.factorization.factor.solve
        moved = np.array([solve(row.reshape(-1, 6), nothing)[0].ravel() for row in part])
        variances, movements = np.linalg.eigh(part @ moved.T)
        return _in_words(self.held @ movements[:, -1] * np.sqrt(max(variances[-1], 0.0)))

    def _held(self, state: State) -> tuple[Floats, Floats]:
        """What the movements change in whitened observations that are no image points, and misclosures."""
        movements = datum_basis(state)
        rows, misclosure = [np.zeros((0, 7))], [np.zeros(0)]
        for group in self.system.observations.others:
            equations = whiten(group, group.linearize(state))
            rows.append(noticed_movements(equations, state, movements).reshape(-1, 7))
            misclosure.append(equations.misclosure.ravel())
        return np.concatenate(rows) @ self.held, np.concatenate(misclosure)


def _in_words(movement: Floats) -> str:
    """What one σ (7,) turns or stretches, and by how much; empty if no more than usual."""
    turn, stretch = float(np.linalg.norm(movement[3:6])), abs(float(movement[6]))
    angles = (
        [name for name, own in zip(DATUM_DIRECTIONS[3:6], np.abs(movement[3:6]), strict=True)
         if own > _INVOLVED * turn] if turn >= _WEAK else []
    )  # fmt: skip
    size = f"σ {np.rad2deg(turn):.2g}°" if turn < _ANY else "σ above 90°"
    words = [f"{' and '.join(angles)} ({size})"] if angles else []
    size = f"σ {100.0 * stretch:.2g} %" if stretch < 1.0 else "σ above 100 %"
    words += [f"scale ({size})"] if stretch >= _WEAK else []
    return " together with ".join(words)


def transformed(state: State, movement: Floats, centre: Floats) -> State:
    """A block after a finite similarity.

    Parameters
    ----------
    movement : (7,) shift, rotation vector, and logarithm of the scale.
    centre : (3,) the point about which it turns and stretches.
    """
    turn = rotation.exp(movement[3:6])
    stretch = float(np.exp(np.clip(movement[6], -_MOST_STRETCH, _MOST_STRETCH)))

    def places(x: Floats) -> Floats:
        return np.asarray(centre + movement[:3] + stretch * (x - centre) @ turn.T)

    return replace(
        state,
        projection_centre=places(state.projection_centre),
        local_from_camera=turn @ state.local_from_camera,
        object_point=places(state.object_point),
    )
