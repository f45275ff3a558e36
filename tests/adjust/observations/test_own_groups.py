"""Observation types of other packages: those that join two object points, and equations that are refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
import pytest

from adjust import AdjustmentOptions, adjust_block
from adjust.arrays import Bools, Floats, Ints
from adjust.errors import AdjustmentError
from adjust.observations.base import Linearization, StochasticModel, Term
from adjust.parameters import OBJECT_POINT, State, Unit
from adjust.result import ObservationStatus
from adjust.solve.consistency import refuse_wrong_derivatives
from adjust.solve.design_matrix import design_matrix, full_cofactor, redundancy_numbers
from adjust.solve.system import Observations, System
from tests.adjust.scenes import Scene, two_strips

SIGMA = 0.02


@dataclass(frozen=True, eq=False)
class Offsets:
    """Differences of one coordinate between two object points, such as of the ends of a vertical edge."""

    point: Ints
    other_point: Ints
    axis: Ints
    given: Floats
    stochastic: StochasticModel

    name: ClassVar[str] = "offsets"
    components: ClassVar[tuple[str, ...]] = ("offset",)
    unit: ClassVar[Unit] = "m"

    @property
    def event(self) -> Ints:
        return np.full(len(self.point), -1, dtype=np.int64)

    def linearize(self, state: State) -> Linearization:
        between = state.object_point[self.other_point] - state.object_point[self.point]
        computed = np.take_along_axis(between, self.axis[:, None], axis=1)
        along = np.eye(3)[self.axis][:, None, :]
        terms = (Term(OBJECT_POINT, self.point, -along), Term(OBJECT_POINT, self.other_point, along))
        return Linearization(self.given[:, None] - computed, terms)

    def without(self, rejected: Bools) -> Self:
        return replace(self, stochastic=self.stochastic.without(rejected))

    def rescaled(self, factor: Floats) -> Self:
        return replace(self, stochastic=self.stochastic.rescaled(factor))


class Azimuths(Offsets):
    """Directions in plan from one object point to another, radians."""

    name: ClassVar[str] = "azimuths"
    components: ClassVar[tuple[str, ...]] = ("azimuth",)
    unit: ClassVar[Unit] = "rad"

    def linearize(self, state: State) -> Linearization:
        x, y, _ = (state.object_point[self.other_point] - state.object_point[self.point]).T
        across = (np.column_stack([y, -x, np.zeros_like(x)]) / (x * x + y * y)[:, None])[:, None, :]
        terms = (Term(OBJECT_POINT, self.point, -across), Term(OBJECT_POINT, self.other_point, across))
        return Linearization((self.given - np.arctan2(x, y))[:, None], terms)


def offsets(scene: Scene, pairs: tuple[tuple[int, int], ...]) -> Offsets:
    """Both plan coordinates of every pair, with errors."""
    point, other = np.repeat(np.array(pairs), 2, axis=0).T
    axis = np.tile([0, 1], len(pairs))
    between = (scene.truth.object_point[other] - scene.truth.object_point[point])[np.arange(len(axis)), axis]
    noise = SIGMA * np.random.default_rng(8).standard_normal(len(axis))
    model = StochasticModel.from_sigma(np.full((len(axis), 1), SIGMA))
    return Offsets(point, other, axis, between + noise, model)


def with_group(scene: Scene, group: Any) -> Observations:
    return replace(scene.observations, others=(*scene.observations.others, group))


def test_own_observations_may_join_two_object_points() -> None:
    # The same pair comes twice, once for each coordinate, and one point is in two pairs.
    scene = two_strips(noise_seed=3, start_seed=3, distances=2)
    group = offsets(scene, ((3, 17), (40, 3), (21, 22)))
    result = adjust_block(scene.block, with_group(scene, group))
    system = System.of(scene.block, result.observations)
    design = design_matrix(system, result.state)
    cofactor = full_cofactor(design)
    columns = design.point_columns[[3, 17, 40]].ravel()
    points = tuple(scene.block.points[j] for j in (3, 17, 40))
    expected = result.sigma0**2 * cofactor[np.ix_(columns, columns)]
    root = np.sqrt(np.diagonal(expected))
    assert np.abs(result.covariance(points).matrix - expected).max() < 1e-9 * root.max() ** 2
    numbers = redundancy_numbers(system, design, cofactor)
    np.testing.assert_allclose(result.groups[-1].redundancy, numbers[-1], atol=1e-9)
    gradient = design.matrix.T @ design.misclosure
    assert np.abs(gradient * np.sqrt(np.diagonal(cofactor))).max() < 1e-3
    assert result.groups[-1].rejected == 0


def test_an_own_observation_that_joins_points_is_rejected_by_itself() -> None:
    scene = two_strips(noise_seed=3)
    group = offsets(scene, ((3, 17), (40, 3), (21, 22)))
    wrong = replace(group, given=group.given + np.where(np.arange(6) == 2, 100 * SIGMA, 0.0))
    result = adjust_block(scene.block, with_group(scene, wrong), AdjustmentOptions(critical_value=4.0))
    rejected = result.groups[-1].status[:, 0] == ObservationStatus.REJECTED
    assert np.flatnonzero(rejected).tolist() == [2]
    assert result.groups[0].rejected == 0


def test_an_own_observation_of_a_point_that_is_not_used_is_left_out() -> None:
    scene = two_strips(noise_seed=3)
    rays = scene.observations.image_points
    group = offsets(scene, ((3, 17), (21, 22)))
    observations = replace(with_group(scene, group), image_points=rays.without(rays.point == 22))
    result = adjust_block(scene.block, observations)
    assert not result.active_point[22]
    used = result.groups[-1].status[:, 0] != ObservationStatus.NOT_USED
    assert used.tolist() == [True, True, False, False]


Change = Callable[[Linearization], Linearization]


@dataclass(frozen=True, eq=False)
class Changed:
    """A group whose equations, or whatever else it says, are changed."""

    group: Any
    change: Change = lambda equations: equations
    said: dict[str, Any] | None = None

    def __post_init__(self) -> None:
        its = {name: getattr(self.group, name) for name in dir(self.group) if name[0] != "_"}
        its.pop("linearize", None)
        self.__dict__.update(its | (self.said or {}))

    def linearize(self, state: State) -> Linearization:
        return self.change(self.group.linearize(state))


def term(change: Callable[[Term], Term], place: int = 0) -> Change:
    """The equations with one term changed."""

    def changed(equations: Linearization) -> Linearization:
        terms = list(equations.terms)
        terms[place] = change(terms[place])
        return replace(equations, terms=tuple(terms))

    return changed


NO_POINT = np.full(4, -1, dtype=np.int64)
WRONG: dict[str, tuple[Changed, str]] = {
    "misclosures (n,)": (
        Changed(None, lambda e: replace(e, misclosure=e.misclosure[:, 0])),
        r"offsets: the array of misclosures has the shape \(4,\); expected: \(4, 1\)",
    ),
    "derivatives (n, d)": (
        Changed(None, term(lambda t: replace(t, jacobian=t.jacobian[:, 0]))),
        r"offsets: the array of derivatives with respect to object_point has the shape \(4, 3\)",
    ),
    "one derivative for all": (
        Changed(None, term(lambda t: replace(t, jacobian=t.jacobian[:1]))),
        r"has the shape \(1, 1, 3\); expected: \(4, 1, 3\)",
    ),
    "derivatives not finite": (
        Changed(None, term(lambda t: replace(t, jacobian=t.jacobian / 0.0 * 0.0))),
        "object_point is not finite",
    ),
    "misclosures not finite": (
        Changed(None, lambda e: replace(e, misclosure=e.misclosure * np.nan)),
        "offsets: a misclosure is not finite",
    ),
    "weights of two components": (
        Changed(None, said={"stochastic": StochasticModel.from_sigma(np.ones((4, 2)))}),
        r"offsets: the array of weights has the shape \(4, 2\); expected: \(4, 1\)",
    ),
    "another kind of unknowns": (
        Changed(None, term(lambda t: replace(t, block="object_points"))),
        "of which offsets has a term, 'object_points'. Did you mean 'object_point'",
    ),
    "index -1": (
        Changed(None, term(lambda t: replace(t, index=NO_POINT))),
        "offsets: an index of object_point is outside 0",
    ),
    "index too large": (
        Changed(None, term(lambda t: replace(t, index=t.index + 100_000))),
        "offsets: an index of object_point is outside 0",
    ),
    "nothing": (Changed(None, lambda e: replace(e, terms=())), "depend on no unknown"),
    "a term alone": (
        Changed(None, lambda e: replace(e, terms=e.terms[0])),
        "offsets: `terms` of its equations",
    ),
    "terms that end": (Changed(None, lambda e: replace(e, terms=iter(e.terms))), "is not a tuple of Term"),
    "other points": (
        Changed(None, term(lambda t: replace(t, index=t.index + 1))),
        "offsets: the object points of its terms must be those that it states",
    ),
    "the other point first": (
        Changed(None, lambda e: replace(e, terms=e.terms[::-1])),
        "the terms come in this order",
    ),
    "no point stated": (
        Changed(None, said={"point": NO_POINT}),
        "An observation of offsets has an index of its object point outside",
    ),
    "points in a list": (
        Changed(None, said={"point": [1, 2, 3, 4]}),
        "offsets: point is not an array of integers",
    ),
    "two components": (
        Changed(
            None,
            lambda e: replace(
                e,
                misclosure=np.repeat(e.misclosure, 2, axis=1),
                terms=tuple(replace(t, jacobian=np.repeat(t.jacobian, 2, axis=1)) for t in e.terms),
            ),
            {"components": ("x", "y"), "stochastic": StochasticModel.from_sigma(np.ones((4, 2)))},
        ),
        "Make an observation of every component",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_equations_that_are_not_those_of_the_observations_are_refused(name: str) -> None:
    scene = two_strips()
    changed, message = WRONG[name]
    group = replace(changed, group=offsets(scene, ((3, 17), (21, 22))))
    with np.errstate(all="ignore"), pytest.raises(AdjustmentError, match=message):
        adjust_block(scene.block, with_group(scene, group))


@pytest.mark.parametrize("sigma", [1e-9, SIGMA, 1e6])
@pytest.mark.parametrize("factor", [-1.0, 1.05, 3.0])
def test_derivatives_that_are_not_those_of_the_misclosures_are_refused(factor: float, sigma: float) -> None:
    scene = two_strips()
    group = offsets(scene, ((3, 17), (21, 22)))
    group = replace(group, stochastic=StochasticModel.from_sigma(np.full((4, 1), sigma)))
    wrong = Changed(group, term(lambda t: replace(t, jacobian=factor * t.jacobian)))
    message = "offsets: the derivatives with respect to object_point are not those of the misclosures"
    with pytest.raises(AdjustmentError, match=message):
        adjust_block(scene.block, with_group(scene, wrong))
    system = System.of(scene.block, with_group(scene, Changed(group)))
    assert system.observations.others[-1].linearize(scene.truth).misclosure.shape == (4, 1)


def test_derivatives_of_what_is_far_from_linear_are_not_refused() -> None:
    """Directions at object points to others nearby, in a frame with large coordinates, with any σ."""
    scene = two_strips()
    shift = np.array([4e6, 5e5, 0.0])
    block = replace(
        scene.block,
        object_point=scene.block.object_point + shift,
        projection_centre=scene.block.projection_centre + shift,
    )
    pairs = np.array([[3, 17], [21, 22], [5, 9]])
    for sigma in (1e-12, 1e-6, 1.0, 1e4):
        model = StochasticModel.from_sigma(np.full((3, 1), sigma))
        group = Azimuths(*pairs.T, np.zeros(3, dtype=np.int64), np.zeros(3), model)
        equations = group.linearize(block.approximate_state())
        refuse_wrong_derivatives(block.layout, block.approximate_state(), group, equations)


def test_two_terms_of_object_points_need_the_statement_of_the_second() -> None:
    scene = two_strips()
    joining = offsets(scene, ((3, 17), (21, 22)))

    unstated = Changed(joining)
    del unstated.__dict__["other_point"]
    with pytest.raises(AdjustmentError, match="states the second as `other_point`"):
        adjust_block(scene.block, with_group(scene, unstated))


def test_attributes_that_only_a_call_makes_are_refused_by_every_python() -> None:
    """`isinstance` would see them up to Python 3.11, and no second object point from 3.12 on."""
    scene = two_strips()

    class Forwarding:
        def __getattr__(self, name: str) -> Any:
            return getattr(scene.observations.others[0], name)

    with pytest.raises(
        AdjustmentError, match=r"components, event, .*What its `__getattr__` returns does not"
    ):
        adjust_block(scene.block, with_group(scene, Forwarding()))


def test_what_is_no_group_is_refused_with_what_it_lacks() -> None:
    scene = two_strips()
    with pytest.raises(AdjustmentError, match="A int is no group of observations: it has no components"):
        adjust_block(scene.block, with_group(scene, 3))
