"""One step of the iteration: from a state, by normal equations, to the next state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from adjust.arrays import Floats
from adjust.parameters import State
from adjust.solve.defect import explain_defect
from adjust.solve.factorization import Factorization, SingularNormalsError, factorize
from adjust.solve.free_network import OpenMovements, open_movements, settled
from adjust.solve.normal_equations import ReducedNormals, substitute_back
from adjust.solve.system import System


@dataclass(frozen=True, eq=False)
class Step:
    """One step from a state.

    Attributes
    ----------
    state : before it.
    normals : the normal equations, with right-hand sides of that state.
    factorization : of their matrix.
    of_exposures, of_border : (n, 6) and (g,).
    movements : what the observations leave open of the datum of a free network; None if nothing.
    is_newton : whether the matrix is that of the state, and not of an earlier one.
    """

    system: System
    state: State
    normals: ReducedNormals
    factorization: Factorization
    of_exposures: Floats
    of_border: Floats
    movements: OpenMovements | None
    is_newton: bool

    @classmethod
    def newton(cls, system: System, state: State, normals: ReducedNormals) -> Step:
        """By the normal equations of a state; a free network also moves to its inner constraints.

        Raises
        ------
        DatumDefectError : singular normal equations, explained.
        """
        factorization, movements = factorized(system, state, normals)
        if movements is not None:
            relieved = movements.relieved(factorization.normals, factorization.solve()[0])
            factorization = replace(factorization, normals=relieved)
        return cls(system, state, normals, factorization, *factorization.solve(), movements, True)

    @classmethod
    def repeated(
        cls, system: System, state: State, normals: ReducedNormals, factorization: Factorization
    ) -> Step:
        """A step that was made before, by factors that are there; not of a network with an open datum."""
        solved = factorization.factor.solve(normals.rhs_exposure, normals.rhs_border)
        return cls(system, state, normals, factorization, *solved, None, factorization.normals is normals)

    def then(self, state: State, normals: ReducedNormals) -> Step:
        """A step from a later state with the factors of this one; not of a network with an open datum.

        Parameters
        ----------
        normals : those of this step, with right-hand sides of that state.
        """
        solved = self.factorization.factor.solve(normals.rhs_exposure, normals.rhs_border)
        return Step(self.system, state, normals, self.factorization, *solved, None, False)

    @cached_property
    def decrement(self) -> float:
        """The decrement bᵀdx, which no choice of the datum changes; b is what the step was solved with."""
        normals = self.normals if self.movements is None else self.factorization.normals
        reduced = float(
            np.sum(normals.rhs_exposure * self.of_exposures) + normals.rhs_border @ self.of_border
        )
        return normals.eliminated + reduced

    @property
    def largest_move(self) -> float:
        """Upper bound of |dx_i|/σ_i over all unknowns."""
        return float(np.sqrt(max(self.decrement, 0.0)))

    @cached_property
    def _towards_datum(self) -> tuple[Floats, Floats, Floats] | None:
        """Increments (n, 6), (g,), (m, 3) of a free network to its inner constraints; None of others."""
        if self.movements is None:
            return None
        return self.movements.towards_approximate_values(
            self.system, self.state, self.of_exposures, self._of_points
        )

    @cached_property
    def _of_points(self) -> Floats:
        """Increments (m, 3) of the object points."""
        return substitute_back(self.system, self.state, self.normals, self.of_exposures, self.of_border)

    @property
    def datum_settled(self) -> bool:
        """Whether the block as a whole moves no more."""
        added = self._towards_datum
        return added is None or settled(self.normals, added[0])

    @cached_property
    def increments(self) -> tuple[Floats, Floats, Floats]:
        """Of exposures (n, 6), border (g,) and object points (m, 3), with those to the inner constraints."""
        increments = (self.of_exposures, self.of_border, self._of_points)
        if self._towards_datum is not None:
            exposures, border, points = (
                own + added for own, added in zip(increments, self._towards_datum, strict=True)
            )
            increments = exposures, border, points
        return increments

    @cached_property
    def moved(self) -> State:
        """The state after the step."""
        return self.system.layout.update(self.state, *self.increments)


def factorized(
    system: System, state: State, normals: ReducedNormals
) -> tuple[Factorization, OpenMovements | None]:
    """Factorised normal equations, and the movements of a free network that had to be fixed for it.

    Raises
    ------
    DatumDefectError : singular normal equations, explained.
    """
    movements = open_movements(system, state, normals)
    try:
        return factorize(normals if movements is None else movements.held(normals), system.threads), movements
    except SingularNormalsError as error:
        raise explain_defect(system, state, error) from error
