"""Every number of a result, where features meet at random, against dense matrices of numpy alone.

A row of A for every scalar observation that was used, a column for every exposure, system parameter (free or
held) and object point; covariances of whole groups from their definition. What a shortcut knows of one
feature and forgets of another shows here.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import pytest
from scipy import stats

from adjust.adjustment import adjust_block
from adjust.arrays import Bools, Floats, Ints
from adjust.errors import DatumDefectError, DivergenceError
from adjust.geometry import rotation
from adjust.least_squares import Adjusted
from adjust.observations.base import ObservationGroup
from adjust.observations.control_point import ControlPoints
from adjust.observations.direct import DirectObservations
from adjust.observations.joint_prior import JointPrior
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT, State
from adjust.quality.control_checks import ControlCheck
from adjust.quality.detectability import NON_CENTRALITY, UNCONTROLLED
from adjust.quality.model_alternatives import ObservationAlternative, ParameterAlternative, alternative_tests
from adjust.quality.observation_parts import parts_of
from adjust.quality.parameter_influences import parameter_influences
from adjust.quality.rejection import SnoopingRule, snooping_statistics
from adjust.quality.variance_components import PartSums
from adjust.result import AdjustmentResult, ObservationStatus
from adjust.result_columns import sigma_of_images
from adjust.solve.design_matrix import full_covariance
from tests.adjust.random_scenes import Drawn, drawn

# In parts of the σ of a number. Observations of which the block controls next to nothing have no digits, nor
# have predictions that next to nothing determines, and blocks that are all but singular.
TOLERANCE = 2e-5
_TOLD, _DETERMINED, _NOTHING = 1e-4, 500.0, 1e-7
_WEAKEST, _OPEN = 1e-4, 1e-12


class Dense:
    """The equations of a result at its adjusted state, whitened, and what follows from them."""

    def __init__(self, drawn: Drawn, result: AdjustmentResult) -> None:
        self.drawn, self.result, block = drawn, result, result.block
        self.groups = result.system.observations.groups
        self.start: dict[str, int] = {EXTERIOR_ORIENTATION: 0}
        self.width, at = {EXTERIOR_ORIENTATION: 6, OBJECT_POINT: 3}, 6 * len(block.events)
        for item in block.system:
            self.start[item.family.name], self.width[item.family.name] = at, item.values.shape[1]
            at += item.values.size
        self.start[OBJECT_POINT], self.count = at, at + 3 * len(block.points)
        self.free = [
            (item.family.name, int(e), int(k)) for item in block.system for e, k in np.argwhere(item.free)
        ]
        self.border = 6 * len(block.events) + np.arange(len(self.free))
        active = np.flatnonzero(result.active_point)
        at_points = (self.start[OBJECT_POINT] + 3 * active[:, None] + np.arange(3)).ravel()
        self.unknown = np.concatenate(
            [np.arange(6 * len(block.events)), self.columns(self.free), at_points]
        ).astype(np.int64)
        self.points = np.full((len(block.points), 3), -1)
        self.points[active] = (
            len(self.border)
            + self.border.min(initial=6 * len(block.events))
            + np.arange(3 * len(active)).reshape(-1, 3)
        )
        self.used = [np.flatnonzero(group.stochastic.present) for group in self.groups]
        ends = np.cumsum([0, *(len(rows) for rows in self.used)])
        self.rows = [slice(first, last) for first, last in pairwise(ends)]
        self.sigma = np.zeros((ends[-1], ends[-1]))
        for own, used, group in zip(self.rows, self.used, self.groups, strict=True):
            self.sigma[own, own] = full_covariance(group.stochastic)[np.ix_(used, used)]
        self.lower = np.linalg.cholesky(self.sigma)
        self.whitener = np.linalg.inv(self.lower)
        self.plain = np.concatenate(
            [self.rows_of(group)[used] for group, used in zip(self.groups, self.used, strict=True)]
        )
        self.every = self.whitener @ self.plain
        self.a = self.every[:, self.unknown]
        self.l = self.misclosures(result.state)
        known = block.considered
        self.places = () if known is None else known.places
        self.b = self.every[:, self.columns(self.places)]
        self.c = np.zeros((0, 0)) if known is None else known.covariance
        self.q, self.null, self.values = inverse(self.a, self.chosen)
        self.r = np.eye(len(self.l)) - self.a @ self.q @ self.a.T
        self.k = self.q @ self.a.T @ self.b
        moved = self.b - self.a @ self.k
        self.added = moved @ self.c @ moved.T
        self.root = np.sqrt(np.diagonal(self.q))

    def columns(self, places: Iterable[tuple[str, int, int]]) -> Ints:
        return np.array([self.start[f] + e * self.width[f] + k for f, e, k in places], dtype=np.int64)

    def rows_of(self, group: ObservationGroup) -> Floats:
        """Derivatives (n m, columns) of all components of a group."""
        equations = group.linearize(self.result.solution.linearization)
        n, m = equations.misclosure.shape
        rows = np.zeros((n, m, self.count))
        for term in equations.terms:
            for i, entity in enumerate(np.broadcast_to(term.index, n)):
                first = self.start[term.block] + int(entity) * self.width[term.block]
                rows[i, :, first : first + self.width[term.block]] += term.jacobian[i]
        return rows.reshape(n * m, -1)

    def misclosures(self, state: State) -> Floats:
        """Whitened."""
        found = [group.linearize(state).misclosure.ravel() for group in self.groups]
        return np.asarray(
            self.whitener @ np.concatenate([one[used] for one, used in zip(found, self.used, strict=True)])
        )

    @property
    def chosen(self) -> Bools:
        """The unknowns of the inner constraints."""
        how, chosen = self.result.system.inner_constraints, np.zeros(len(self.unknown), dtype=bool)
        if how != "object_points":
            centres = np.arange(6 * len(self.result.block.events)).reshape(-1, 6)[:, :3]
            chosen[centres] = True
        if how != "projection_centres":
            chosen[self.points[self.result.active_point]] = True
        return chosen

    @cached_property
    def outside(self) -> Floats:
        """M = R with the considered parameters observed, as unknowns of a larger block."""
        k = len(self.places)
        own = np.linalg.inv(np.linalg.cholesky(self.c)) if k else np.zeros((0, 0))
        wide = np.block([[self.a, self.b], [np.zeros((k, len(self.unknown))), own]])
        rest = np.eye(len(wide)) - wide @ inverse(wide, None)[0] @ wide.T
        return np.asarray(rest[: len(self.l), : len(self.l)])

    @property
    def covariance(self) -> Floats:
        return np.asarray(self.result.sigma0**2 * self.q + self.k @ self.c @ self.k.T)

    def full(self, number: int, values: Floats) -> Floats:
        """Values of all rows as those (n, m) of a group."""
        shape = self.groups[number].stochastic.present.shape
        found = np.full(shape[0] * shape[1], np.nan)
        found[self.used[number]] = values[self.rows[number]]
        return found.reshape(shape)

    def back(self, matrix: Floats) -> Floats:
        """Wᵀ X W."""
        return np.asarray(self.whitener.T @ matrix @ self.whitener)


def inverse(a: Floats, chosen: Bools | None) -> tuple[Floats, Floats, Floats]:
    """Q, in the datum of the chosen unknowns; the null space; singular values for columns of length 1."""
    length = np.linalg.norm(a, axis=0)
    length = np.where(length > 0.0, length, 1.0)
    _, found, right = np.linalg.svd(a / length)
    values = np.concatenate([found, np.zeros(a.shape[1] - len(found))])
    vectors, told = right.T / length[:, None], values > _NOTHING * values[0]
    q, null = (vectors[:, told] / values[told] ** 2) @ vectors[:, told].T, vectors[:, ~told]
    if chosen is not None and null.shape[1]:
        selected = np.where(chosen[:, None], null, 0.0)
        s = np.eye(len(q)) - null @ np.linalg.solve(selected.T @ null, selected.T)
        q = s @ q @ s.T
    return q, null, values


def assert_same(what: str, found: Floats | float, expected: Floats | float, size: Floats | float) -> None:
    """NaN where the other one is NaN, and equal to parts of a size."""
    ours, theirs = np.asarray(found, dtype=float), np.asarray(expected, dtype=float)
    assert ours.shape == theirs.shape, what
    assert np.array_equal(np.isnan(ours), np.isnan(theirs)), what
    difference = np.nan_to_num(np.abs(ours - theirs) / np.where(np.isnan(theirs), 1.0, size))
    assert difference.max(initial=0.0) < TOLERANCE, f"{what}: {difference.max():.2e}"


def assert_is_the_minimum(dense: Dense) -> None:
    result, n, u = dense.result, len(dense.l), len(dense.unknown)
    # Of a product of the Jacobian with a small random movement of everything, also of what is held.
    layout, random = result.layout, np.random.default_rng(1)
    moves = random.normal(size=len(dense.unknown)) * np.minimum(dense.root, 1e-3)
    of_points = np.zeros((len(result.block.points), 3))
    of_points[result.active_point] = moves[dense.points[result.active_point]]
    of_exposures = moves[: 6 * layout.events].reshape(-1, 6)
    state = result.solution.linearization
    ends = [
        dense.misclosures(layout.update(state, t * of_exposures, t * moves[dense.border], t * of_points))
        for t in (-1.0, 1.0)
    ]
    expected = dense.a @ moves
    difference = 0.5 * (ends[0] - ends[1]) - expected
    assert np.abs(difference).max() < 1e-4 * np.abs(expected).max()
    step = dense.q @ dense.a.T @ dense.l
    assert np.abs(step / dense.root).max(initial=0.0) < 1e-3
    freedom, squares = n - u + dense.null.shape[1], float(dense.l @ dense.l)
    assert result.test.redundancy == freedom
    assert result.solution.defect == dense.null.shape[1]
    assert_same("vᵀPv", result.test.weighted_squares, squares, max(squares, 1.0))
    if freedom:
        limits = np.sqrt(stats.chi2.ppf([0.025, 0.975], freedom) / freedom)
        assert_same("limits", np.array([result.test.lower, result.test.upper]), limits, 1.0)


def assert_covariances(dense: Dense) -> None:
    result, events = dense.result, len(dense.result.block.events)
    active = [name for name, used in zip(result.block.points, result.active_point, strict=True) if used]
    families = tuple(dict.fromkeys(family for family, _, _ in dense.free))
    found = result.covariance(active, result.block.events, families)
    sigma = np.sqrt(np.diagonal(dense.covariance))
    assert_same("joint covariance", found.matrix, dense.covariance, np.outer(sigma, sigma))
    reduced = result.cofactor.reduced
    for i, j, block in zip(reduced.pattern.row, reduced.pattern.column, reduced.blocks, strict=True):
        one, other = 6 * i + np.arange(6), 6 * j + np.arange(6)
        size = np.outer(dense.root[one], dense.root[other])
        assert_same("exposures", block, dense.q[np.ix_(one, other)], size)
    own = dense.root[dense.border]
    assert_same("border", reduced.corner, dense.q[np.ix_(dense.border, dense.border)], np.outer(own, own))
    exposures = np.arange(6 * events)
    mixed, size = dense.q[np.ix_(exposures, dense.border)], np.outer(dense.root[exposures], own)
    assert_same("mixed", reduced.border.reshape(6 * events, -1), mixed, size)
    for own_columns, block in zip(dense.points, result.cofactor.of_points, strict=True):
        if own_columns[0] < 0:
            assert np.isnan(block).all()
            continue
        size = np.outer(dense.root[own_columns], dense.root[own_columns])
        assert_same("points", block, dense.q[np.ix_(own_columns, own_columns)], size)
    at_points = dense.a[:, dense.points[result.active_point].ravel()]
    left = dense.a[:, dense.border]
    own, left = np.sum(left**2, axis=0), left - at_points @ (inverse(at_points, None)[0] @ at_points.T @ left)
    assert_same("only points eliminated", reduced.reduced_diagonal, np.sum(left**2, axis=0), own)
    # Of the pictures of a rig: of all parameters of their head, also those that are considered.
    everything = np.concatenate([dense.unknown, dense.columns(dense.places)])
    gain = np.vstack([-dense.k, np.eye(len(dense.places))])
    whole = gain @ dense.c @ gain.T
    whole[: len(dense.unknown), : len(dense.unknown)] += result.sigma0**2 * dense.q
    of_pictures = _poses(dense)[:, :, everything]
    expected = np.sqrt(np.einsum("nij,jk,nik->ni", of_pictures, whole, of_pictures))
    assert_same("pictures", sigma_of_images(result), expected, expected)


def _poses(dense: Dense) -> Floats:
    """Derivatives (n, 6, columns) of the poses of the pictures, by central differences."""
    state, rows = dense.result.state, np.zeros((len(dense.result.block.images), 6, dense.count))
    sizes = {EXTERIOR_ORIENTATION: (len(state.projection_centre), 6)}
    sizes |= {family: values.shape for family, values in state.system.items()}
    for kind, (entities, components) in sizes.items():
        for entity, component in np.ndindex(entities, components):
            one, other = (_moved(state, kind, entity, component, step).pictures for step in (1e-4, -1e-4))
            column = dense.columns([(kind, entity, component)])[0]
            rows[:, :3, column] = (one.projection_centre - other.projection_centre) / 2e-4
            turned = np.swapaxes(other.local_from_camera, 1, 2) @ one.local_from_camera
            rows[:, 3:, column] = rotation.log(turned) / 2e-4
    return rows


def _moved(state: State, kind: str, entity: int, component: int, step: float) -> State:
    centre, axes = state.projection_centre.copy(), state.local_from_camera.copy()
    if kind != EXTERIOR_ORIENTATION:
        values = state.system[kind].copy()
        values[entity, component] += step
        return replace(state, system={**state.system, kind: values})
    if component < 3:
        centre[entity, component] += step
    else:
        axes[[entity]] = axes[[entity]] @ rotation.exp(step * np.eye(3)[[component - 3]])
    return replace(state, projection_centre=centre, local_from_camera=axes)


def assert_residuals(dense: Dense) -> None:
    result, weight = dense.result, np.diagonal(dense.back(np.eye(len(dense.l))))
    scatter, added = np.diagonal(dense.back(dense.r)), np.diagonal(dense.back(dense.added))
    fitted = np.diagonal(dense.back(dense.a @ dense.q @ dense.a.T))
    numbers = np.diagonal(dense.lower @ dense.r @ dense.whitener)
    pull = -dense.whitener.T @ dense.l
    for k, item in enumerate(result.groups):
        name, sigma = item.group.name, item.sigma
        assert_same(f"r of {name}", item.redundancy, dense.full(k, numbers), 1.0)
        own, ratio = dense.full(k, scatter), dense.full(k, scatter / weight)
        assert_same(f"control of {name}", item.control, own * sigma**2, dense.full(k, weight) * sigma**2)
        with np.errstate(invalid="ignore", divide="ignore"):
            root, told = np.sqrt(dense.full(k, scatter + added)), ratio > _TOLD
            w, detectable = dense.full(k, pull) / root, root / own * NON_CENTRALITY
            external = detectable * np.sqrt(dense.full(k, fitted))
        for what, found, expected, scale in (
            ("w", item.standardized, w, np.maximum(1.0, np.abs(w))),
            ("mdb", item.detectable, detectable, detectable),
            ("external", item.external, external, np.maximum(external, 0.1)),
        ):
            # A difference of r, divided by 2 r, is in all three: below r = 1 % they have fewer digits than r.
            digits = np.minimum(1.0, 100.0 * ratio[told])
            assert_same(f"{what} of {name}", found[told], expected[told], scale[told] / digits)
        is_used = item.status == ObservationStatus.USED
        clear = np.abs(own * sigma**2 - UNCONTROLLED) > 1e-6
        assert np.array_equal(is_used & clear, (own * sigma**2 >= UNCONTROLLED) & clear), name
        squares = float(np.sum(dense.l[dense.rows[k]] ** 2))
        assert_same("vᵀPv of groups", item.weighted_squares, squares, max(squares, 1.0))


def assert_predictions(dense: Dense) -> None:
    result, groups = dense.result, dense.drawn.observations.groups
    number = next((k for k, group in enumerate(groups) if isinstance(group, ControlPoints)), None)
    for check in (result.left_out_singly, result.left_out_by_fold):
        if check is not None and number is not None:
            _assert_predictions(dense, check, number)


def _assert_predictions(dense: Dense, check: ControlCheck, number: int) -> None:
    given, result = dense.drawn.observations.groups[number], dense.result
    model = given.stochastic
    covariance, every = full_covariance(model), dense.rows_of(given)
    misclosure = np.nan_to_num(given.linearize(result.state).misclosure).ravel()
    row_of = np.full(model.present.size, -1)
    row_of[dense.used[number]] = np.arange(len(dense.l))[dense.rows[number]]
    for fold in np.unique(check.fold):
        members = np.flatnonzero(check.fold == fold)
        out = row_of[(3 * members[:, None] + np.arange(3)).ravel()]
        kept = np.setdiff1d(np.arange(len(dense.l)), out)
        q, null, _ = inverse(dense.a[kept], None)
        gain = q @ dense.a[kept].T
        found = []
        for i in members:
            own = 3 * i + np.flatnonzero(model.present[i])
            if not (len(own) and result.active_point[given.point[i]]):
                assert np.isnan(check.difference[i]).all()
                continue
            a, b = every[np.ix_(own, dense.unknown)], every[np.ix_(own, dense.columns(dense.places))]
            cofactor = covariance[np.ix_(own, own)] + a @ q @ a.T
            open_ = a @ (null / np.linalg.norm(null, axis=0)) if null.shape[1] else np.zeros((1, 1))
            sigma = np.sqrt(np.diagonal(cofactor))
            lost = np.abs(open_).max() > 1e-7 or np.any(
                sigma > _DETERMINED * model.sigma[i][model.present[i]]
            )
            errors = b - a @ gain @ dense.b[kept]
            found.append(
                (i, own - 3 * i, lost, a @ (gain @ dense.l[kept]) - misclosure[own], cofactor, errors)
            )
        if any(item[2] for item in found):  # those that are left lose digits with it
            continue
        for i, own, _, difference, cofactor, errors in found:
            sigma = np.sqrt(np.diagonal(cofactor))
            size = np.outer(sigma, sigma)
            # The residual divided by 1 − H, as is its cofactor: it has as many digits of itself as that.
            digits = np.maximum(sigma, np.abs(difference))
            assert_same("prediction", check.difference[i][own], difference, digits)
            assert_same("its cofactor", check.cofactor[i][np.ix_(own, own)], cofactor, size)
            expected = errors @ dense.c @ errors.T
            scale = size + np.sqrt(np.outer(np.diagonal(expected), np.diagonal(expected)))
            assert_same("its errors", check.considered[i][np.ix_(own, own)], expected, scale)


def assert_statistics(dense: Dense) -> None:
    """|w| of the same probability of whole observations, and what variance components are made of."""
    adjusted = Adjusted(dense.result.system, dense.result.solution, ())
    found = snooping_statistics(adjusted, SnoopingRule(3.0, "observations"))
    spread, pull = dense.back(dense.r + dense.added), -dense.whitener.T @ dense.l
    for k, (group, ours) in enumerate(zip(dense.groups, found, strict=True)):
        if isinstance(group, DirectObservations | JointPrior):
            continue
        m = group.stochastic.present.shape[1]
        for i in np.flatnonzero(group.stochastic.present.any(axis=1)):
            own = np.flatnonzero(group.stochastic.present[i])
            rows = dense.rows[k].start + np.searchsorted(dense.used[k], m * i + own)
            back = np.linalg.inv(group.stochastic.whitener[i][np.ix_(own, own)]).T
            values, vectors = np.linalg.eigh(back @ spread[np.ix_(rows, rows)] @ back.T)
            if np.any(np.abs(values - UNCONTROLLED) < 1e-4):
                continue
            along, told = vectors.T @ back @ pull[rows], values >= UNCONTROLLED
            tail = stats.chi2.sf(np.sum(along[told] ** 2 / values[told]), max(told.sum(), 1))
            if tail > 1e-12:
                assert_same("statistic", ours[i], stats.norm.isf(0.5 * tail) if told.any() else 0.0, 1.0)
    parts = parts_of(dense.result.system.observations)
    sums = PartSums.of(adjusted, parts)
    squares = (dense.lower @ dense.outside @ dense.l) * (dense.whitener.T @ dense.outside @ dense.l)
    numbers = np.diagonal(dense.lower @ dense.outside @ dense.whitener)
    for part, of_squares, redundancy in zip(parts, sums.squares, sums.redundancy, strict=True):
        own = np.nansum(dense.full(part.group, squares)[part.place])
        assert_same("squares of parts", of_squares, own, max(abs(own), 1.0))
        share = (dense.full(part.group, numbers) * dense.groups[part.group].stochastic.shares)[part.place]
        assert_same("redundancy of parts", redundancy, np.nansum(share), 1.0)


def assert_alternatives(dense: Dense) -> None:
    """Parameters that are held, or of some events, and observations that are changed; and influences."""
    result, random = dense.result, np.random.default_rng(2)
    alternatives, columns = list[ParameterAlternative | ObservationAlternative](), list[Floats]()
    width = [group.stochastic.present.shape[1] for group in dense.groups]
    event = np.concatenate(
        [g.event[used // m] for g, used, m in zip(dense.groups, dense.used, width, strict=True)]
    )
    for item in result.block.system:
        for (entity, component), is_free in np.ndenumerate(item.free):
            events = random.random(len(result.block.events)) < 0.5 if is_free else None
            alternatives.append(ParameterAlternative(item.family.name, entity, component, events))
            column = dense.plain[:, dense.columns([(item.family.name, entity, component)])[0]]
            columns.append(column if events is None else np.where((event >= 0) & events[event], column, 0.0))
    for k, group in enumerate(dense.groups):
        if [other.name for other in dense.groups].count(group.name) == 1:
            change = random.normal(size=group.stochastic.present.shape)
            alternatives.append(ObservationAlternative(group.name, change))
            columns.append(np.zeros(len(dense.l)))
            columns[-1][dense.rows[k]] = change.ravel()[dense.used[k]]
    c = dense.whitener @ np.array(columns).T
    tests = alternative_tests(result.system, result.solution, alternatives)
    normal, own = c.T @ dense.outside @ c, np.sum(c**2, axis=0)
    told = np.diagonal(normal) > 1e-3 * own
    size = np.sqrt(np.diagonal(normal)[told])
    assert_same("M", tests.normal[np.ix_(told, told)], normal[np.ix_(told, told)], np.outer(size, size))
    assert_same("t", tests.t[told], (c.T @ dense.outside @ dense.l)[told] / size, 1.0)
    sigma, gain = dense.root[dense.border][:, None], (dense.q @ dense.a.T)[dense.border]
    assert_same("effect", tests.effect, gain @ c, sigma * np.sqrt(np.where(own > 0.0, own, 1.0)))
    influences = parameter_influences(result, np.arange(len(dense.free)))
    for item, rows, used in zip(influences, dense.rows[1:], dense.used[1:], strict=True):
        expected = np.zeros((len(dense.free), item.group.stochastic.present.size))
        expected[:, used] = (gain @ dense.whitener)[:, rows]
        size = sigma / np.nan_to_num(item.group.stochastic.sigma, nan=1.0).reshape(1, -1)
        assert_same("influences", item.derivative.reshape(expected.shape), expected, size)


def compared(seed: int) -> bool:
    """Whether the block of a seed is one that can be compared; fails where a number is another one."""
    for all_known in (False, True):
        one = drawn(seed, all_known)
        try:
            result = adjust_block(one.block, one.observations, one.options)
            break
        except (DatumDefectError, DivergenceError):
            continue
    else:
        return False
    dense = Dense(one, result)
    open_ = dense.null.shape[1]
    if dense.values[-1 - open_] < _WEAKEST or np.any(dense.values[len(dense.values) - open_ :] > _OPEN):
        return False
    for part in (
        assert_is_the_minimum,
        assert_covariances,
        assert_residuals,
        assert_predictions,
        assert_statistics,
        assert_alternatives,
    ):
        part(dense)
    return True


# Together they have every feature: rigs with missing pictures and a platform, considered and observed
# parameters of all families, errors correlated over time, free networks whose datum moves parameters.
@pytest.mark.parametrize("seed", [1, 2, 8, 11, 20, 40, 74, 79, 98])
def test_all_numbers_are_those_of_dense_matrices(seed: int) -> None:
    assert compared(seed)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(100, 500, 50))
def test_the_same_of_hundreds_of_blocks(first: int) -> None:
    assert sum(compared(seed) for seed in range(first, first + 50)) > 30
