"""Whether the derivatives of a group are those of its misclosures, by numerical differences.

The unknowns of one kind move together, each by a part of the step that is its own, so that a derivative with
respect to a wrong one shows. A step too small leaves rounding, one too large what is not linear; wrong
derivatives differ at every size.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.errors import InconsistentBlockError
from adjust.observations.base import Linearization, ObservationGroup, Term
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT, ParameterLayout, State

# Part of the standard deviation by which an observation changes, powers of ten by which that is multiplied,
# and the part of the derivatives that may be wrong.
_STEP, _SIZES, _TOLERANCE = 0.01, (0, 2, -2, 4, -4, 6, -6, 8), 0.01


def refuse_wrong_derivatives(
    layout: ParameterLayout, state: State, group: ObservationGroup, equations: Linearization
) -> None:
    """Refuse a group whose derivatives are wrong by more than a hundredth at every size of the step.

    Parameters
    ----------
    equations : of the group at the state.

    Raises
    ------
    InconsistentBlockError : with the kind of unknowns, and by how much.
    """
    random = np.random.default_rng(35)
    for kind in dict.fromkeys(term.block for term in equations.terms):
        terms = tuple(term for term in equations.terms if term.block == kind)
        direction = _direction(layout, kind, random) * _step(group, terms)
        wrong = np.inf
        for power in _SIZES:
            wrong = min(wrong, _wrong_part(layout, state, group, terms, direction * 10.0**power))
            if wrong <= _TOLERANCE:
                break
        else:
            raise InconsistentBlockError(
                f"{group.name}: the derivatives with respect to {kind} are not those of the misclosures; "
                f"numerical differences differ from them by {100.0 * wrong:.3g} %. Derivatives are of the "
                "computed values: those of the misclosures with the opposite sign."
            )


def _step(group: ObservationGroup, terms: tuple[Term, ...]) -> Floats:
    """(d,) that changes no observation by more than a hundredth of its standard deviation."""
    sigma = np.where(group.stochastic.present, group.stochastic.sigma, np.inf)[:, :, None]
    largest = np.max([np.max(np.abs(t.jacobian) / sigma, axis=(0, 1), initial=0.0) for t in terms], axis=0)
    return np.asarray(np.divide(_STEP, largest, out=np.zeros_like(largest), where=largest > 0.0))


def _wrong_part(
    layout: ParameterLayout, state: State, group: ObservationGroup, terms: tuple[Term, ...], change: Floats
) -> float:
    """Largest difference between numerical and given change, relative to the sum of the given parts."""
    expected, size = np.zeros((2, *group.stochastic.present.shape))
    for term in terms:
        parts = term.jacobian * change[term.index][:, None, :]
        expected += parts.sum(axis=2)
        size += np.abs(parts).sum(axis=2)
    before, after = (
        group.linearize(_moved(layout, state, terms[0].block, sign * change)).misclosure for sign in (-1, 1)
    )
    used = group.stochastic.present
    size = np.where(used, size, 0.0)
    # What hardly depends on these unknowns has derivatives of rounding errors.
    size += _TOLERANCE * size.max(axis=0, initial=0.0)
    error = np.abs(0.5 * (before - after) - expected)[used] / size[used]
    return float(np.max(np.where(np.isfinite(error), error, np.inf), initial=0.0))


def _moved(layout: ParameterLayout, state: State, kind: str, change: Floats) -> State:
    exposures, border = np.zeros((layout.events, 6)), np.zeros(layout.border)
    points = np.zeros((layout.points, 3))
    if kind == EXTERIOR_ORIENTATION:
        exposures = change
    elif kind == OBJECT_POINT:
        points = change
    else:
        free = layout.columns[kind] >= 0
        border[layout.columns[kind][free]] = change[free]
    return layout.update(state, exposures, border, points)


def _direction(layout: ParameterLayout, kind: str, random: np.random.Generator) -> Floats:
    """Of every unknown of a kind another part of the step, in either direction; zero of what is held."""
    free = np.ones((layout.events, 6) if kind == EXTERIOR_ORIENTATION else (layout.points, 3), dtype=bool)
    if kind in layout.columns:
        free = layout.columns[kind] >= 0
    size = random.uniform(0.5, 1.0, free.shape) * random.choice([-1.0, 1.0], free.shape)
    return np.where(free, size, 0.0)
