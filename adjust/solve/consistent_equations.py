"""Whether the equations of a group of observations fit its block, and what the group says of itself.

Kernels and sums take them as they are: a wrong shape would be broadcast, a wrong index be that of another
unknown.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import require_shape
from adjust.block import Block
from adjust.errors import InconsistentBlockError
from adjust.observations.base import JoinsPoints, Linearization, ObservationGroup, Term
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT, State
from adjust.solve.derivative_check import refuse_wrong_derivatives
from adjust.unknown_names import unknown_name


def refuse_wrong_equations(block: Block, state: State, group: ObservationGroup) -> None:
    """Refuse a group whose equations at the approximate values are not those of its observations.

    Raises
    ------
    InconsistentBlockError : with the group, and what is wrong.
    UnknownNameError : a term is of a kind of unknowns that the block does not have.
    """
    name, shape = group.name, (len(group.point), len(group.components))
    require_shape(f"{name}: the array of weights", group.stochastic.present.shape, shape)
    equations = group.linearize(state)
    require_shape(f"{name}: the array of misclosures", np.shape(equations.misclosure), shape)
    if not np.isfinite(equations.misclosure[group.stochastic.present]).all():
        raise InconsistentBlockError(f"{name}: a misclosure is not finite at the approximate values.")
    if not equations.terms:
        raise InconsistentBlockError(f"{name}: its equations have no terms, so they depend on no unknown.")
    for term in equations.terms:
        _refuse_wrong_term(block, state, name, shape, term)
    _refuse_other_points(group, equations)
    refuse_wrong_derivatives(block.layout, state, group, equations)


def _refuse_wrong_term(block: Block, state: State, name: str, shape: tuple[int, int], term: Term) -> None:
    sizes = {EXTERIOR_ORIENTATION: (len(block.events), 6), OBJECT_POINT: (len(block.points), 3)}
    sizes |= {family: (values.shape[0], values.shape[1]) for family, values in state.system.items()}
    if term.block not in sizes:
        raise unknown_name(f"kind of unknowns, of which {name} has a term,", term.block, sizes)
    entities, parameters = sizes[term.block]
    what = f"{name}: the array of derivatives with respect to {term.block}"
    require_shape(f"{name}: the array of indices of {term.block}", np.shape(term.index), shape[:1])
    require_shape(what, np.shape(term.jacobian), (*shape, parameters))
    if not np.isfinite(term.jacobian).all():
        raise InconsistentBlockError(f"{what} is not finite at the approximate values.")
    # An observation without one, such as a position of no strip, has the index −1 and no derivative.
    nothing = (term.index == -1) & ~term.jacobian.any(axis=(1, 2))
    if not (nothing | ((term.index >= 0) & (term.index < entities))).all():
        raise InconsistentBlockError(f"{name}: an index of {term.block} is outside 0 … {entities - 1}.")


def _refuse_other_points(group: ObservationGroup, equations: Linearization) -> None:
    """Which object points an observation is of decides what is determined, and what is left out with them."""
    found = [term.index for term in equations.terms if term.block == OBJECT_POINT]
    stated = [group.point]
    if isinstance(group, JoinsPoints):
        stated.append(group.other_point)
        if len(group.components) > 1 or group.stochastic.over_time is not None:
            raise InconsistentBlockError(
                f"{group.name}: observations that join two object points have one component each, and errors "
                "independent of each other. Make an observation of every component."
            )
    elif not found and (group.point < 0).all():
        return
    if len(found) != len(stated) or not all(map(np.array_equal, found, stated)):
        raise InconsistentBlockError(
            f"{group.name}: the object points of its terms must be those that it states as `point`. Where an "
            "observation of one component joins two, it states the second as `other_point`, and the terms "
            "come in this order."
        )
