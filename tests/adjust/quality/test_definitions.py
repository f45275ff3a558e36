"""Redundancy, w, detectable errors and their effects from definitions, with derivatives by differences.

Nothing of the adjustment is used but the misclosures at a state and its adjusted values: no derivative, no
whitener, no normal equations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest
import scipy.linalg

from adjust.adjustment import adjust_block
from adjust.arrays import Floats
from adjust.observations.base import StochasticModel
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT, INTERIOR_ORIENTATION, LEVER_ARM, ConsideredParameters, ParameterPlace
from adjust.quality.detectability import NON_CENTRALITY, UNCONTROLLED
from adjust.result import AdjustmentResult, ObservationStatus
from tests.adjust.scenes import Scene, two_strips, variants

SCENES = variants()
# Of every kind of observation and parameter, correlations, positions and distances that are rejected.
DAILY = ("everything_free_two_cameras", "distances", "correlated_over_time")
# Relative to its largest eigenvalue 1, what a datum leaves open; what is determined is far above.
_OPEN = 1e-9


@dataclass(frozen=True, eq=False)
class Definitions:
    """Covariance Σ and misclosures of all scalars that are used, and what follows from them.

    Attributes
    ----------
    residual, weight, scatter, fitted : v, P, P Q_vv P and P A Q Aᵀ P.
    spread : the same as the scatter with the errors of considered parameters.
    covariance, defect : Σ, and the number of open movements.
    """

    residual: Floats
    covariance: Floats
    weight: Floats
    scatter: Floats
    fitted: Floats
    spread: Floats
    unknowns: int
    defect: int

    @classmethod
    def of(cls, result: AdjustmentResult) -> Definitions:
        groups, layout, state = result.system.observations.groups, result.layout, result.state
        used = np.concatenate([group.stochastic.present.ravel() for group in groups])
        covariance = scipy.linalg.block_diag(*(covariance_of(group.stochastic) for group in groups))
        covariance = covariance[np.ix_(used, used)]
        sigma = np.sqrt(np.diagonal(covariance))

        def misclosure(at: object) -> Floats:
            return np.concatenate([np.nan_to_num(g.linearize(at).misclosure).ravel() for g in groups])[used]  # type: ignore[arg-type]

        def unknown(number: int, step: float) -> object:
            vector = np.zeros(6 * layout.events + layout.border + 3 * layout.points)
            vector[number] = step
            parts = np.split(vector, [6 * layout.events, 6 * layout.events + layout.border])
            return layout.update(state, parts[0].reshape(-1, 6), parts[1], parts[2].reshape(-1, 3))

        def considered(place: ParameterPlace, step: float) -> object:
            values = {name: np.array(state.system[name]) for name in state.system}
            values[place.family][place.entity, place.component] += step
            return replace(state, system=values)

        def step_of(moved: object) -> float:
            """Of the central differences: it changes the most sensitive observation by one σ."""
            slope = np.abs((misclosure(moved(1e-7)) - misclosure(moved(-1e-7))) / sigma).max() / 2e-7  # type: ignore[operator]
            return float(1.0 / slope) if slope > 0.0 else 1e-7

        def column(moved: object, step: float) -> Floats:
            return -(misclosure(moved(step)) - misclosure(moved(-step))) / (2.0 * step)  # type: ignore[operator]

        points = np.repeat(result.active_point, 3)
        numbers = [*range(6 * layout.events + layout.border)]
        numbers += [len(numbers) + int(k) for k in np.flatnonzero(points)]
        # One step for a component of all exposures, and for one of all points.
        first_point, steps = 6 * layout.events + layout.border, dict[object, float]()

        def column_of(k: int) -> Floats:
            kind = "exposure", k % 6
            if k >= 6 * layout.events:
                kind = ("border", k) if k < first_point else ("point", (k - first_point) % 3)
            move = partial(unknown, k)
            if kind not in steps:
                steps[kind] = step_of(move)
            return column(move, steps[kind])

        a = np.stack([column_of(k) for k in numbers], axis=1)
        weight = np.linalg.inv(covariance)
        normal = a.T @ weight @ a
        scale = 1.0 / np.sqrt(np.diagonal(normal))
        values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
        told = values > _OPEN * values[-1]
        root = scale[:, None] * vectors[:, told] / np.sqrt(values[told])
        half = weight @ a @ root
        fitted = half @ half.T
        spread = scatter = weight - fitted
        known = result.block.considered
        if known is not None:
            moves = [partial(considered, at) for at in known.places]
            b = np.stack([column(move, step_of(move)) for move in moves], axis=1)
            moved = scatter @ b
            spread = scatter + moved @ known.covariance @ moved.T
        open_movements = int(np.sum(~told))
        return cls(
            -misclosure(state), covariance, weight, scatter, fitted, spread, len(numbers), open_movements
        )


def covariance_of(model: StochasticModel) -> Floats:
    """Σ (n m, n m) of a group: L_i L_jᵀ exp(−|t_i − t_j|/τ) of two observations of a strip."""
    n, m = model.present.shape
    correlation = np.eye(n)
    if model.over_time is not None:
        process = model.over_time
        same = process.strip[:, None] == process.strip
        apart = np.abs(process.time[:, None] - process.time)
        correlation = np.where(same, np.exp(-apart / process.correlation_time), 0.0)
    return np.einsum("ij,iac,jbc->iajb", correlation, model.unwhitener, model.unwhitener).reshape(
        n * m, n * m
    )


def assert_as_defined(scene: Scene, options: AdjustmentOptions | None = None) -> None:
    result = adjust_block(scene.block, scene.observations, options)
    found = Definitions.of(result)
    assert result.test.redundancy == len(found.residual) - found.unknowns + found.defect
    squares = found.residual @ found.weight @ found.residual
    assert result.test.weighted_squares == pytest.approx(squares, rel=1e-6)
    control = np.diagonal(found.scatter) * np.diagonal(found.covariance)
    with np.errstate(invalid="ignore"):
        deviation = np.sqrt(np.diagonal(found.spread))
        detectable = NON_CENTRALITY * deviation / np.diagonal(found.scatter)
        expected = {
            "redundancy": np.einsum("ij,ji->i", found.covariance, found.scatter),
            "control": control,
            "standardized": found.weight @ found.residual / deviation,
            "detectable": detectable,
            "external": detectable * np.sqrt(np.maximum(np.diagonal(found.fitted), 0.0)),
        }
    # Below this the differences have no digits left.
    told = control > 1e-3
    first = 0
    for group, left in zip(result.groups, result.system.observations.groups, strict=True):
        present = left.stochastic.present
        own = slice(first, first + int(present.sum()))
        first = own.stop
        for name, values in expected.items():
            ours, theirs = getattr(group, name)[present][told[own]], values[own][told[own]]
            np.testing.assert_allclose(
                ours, theirs, rtol=1e-4, atol=2e-4, err_msg=f"{group.group.name} {name}"
            )
        status = np.where(control[own] < UNCONTROLLED, ObservationStatus.UNCONTROLLED, ObservationStatus.USED)
        np.testing.assert_array_equal(group.status[present], status)


@pytest.mark.parametrize(
    "name",
    [name if name in DAILY else pytest.param(name, marks=pytest.mark.slow) for name in sorted(SCENES)],
)
def test_every_figure_of_an_observation_is_that_of_its_definition(name: str) -> None:
    assert_as_defined(SCENES[name])


@pytest.mark.parametrize("correlation_s", [pytest.param(None, marks=pytest.mark.slow), 20.0])
def test_the_same_with_considered_parameters(correlation_s: float | None) -> None:
    scene = two_strips(noise_seed=3, start_seed=4, free={LEVER_ARM: True}, gnss_correlation_s=correlation_s)
    places = tuple(ParameterPlace(name, 0, k) for name in (INTERIOR_ORIENTATION, BORESIGHT) for k in range(3))
    sigma = np.array([2e-5, 5e-6, 5e-6, 1e-4, 1e-4, 2e-4])
    correlation = 0.3 + 0.7 * np.eye(6)
    known = ConsideredParameters(places, correlation * np.outer(sigma, sigma))
    assert_as_defined(replace(scene, block=replace(scene.block, considered=known)))


@pytest.mark.parametrize("constrained", ["object_points", "both"])
def test_the_same_in_a_free_network(constrained: str) -> None:
    scene = two_strips(noise_seed=3, start_seed=4, control=(), gnss=False, ins=False, distances=3)
    assert_as_defined(scene, AdjustmentOptions(free_network=constrained))  # type: ignore[arg-type]
