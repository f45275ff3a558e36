"""Considered parameters against full matrices, in which nothing is eliminated."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy import stats

from adjust.adjustment import adjust_block
from adjust.arrays import Floats
from adjust.block import Block
from adjust.errors import InconsistentBlockError
from adjust.least_squares import Adjusted, Adjuster
from adjust.model_tests import examined_model
from adjust.observations.base import StochasticModel
from adjust.observations.joint_prior import JointPrior
from adjust.options import AdjustmentOptions
from adjust.parameters import (
    ADDITIONAL_PARAMETERS,
    BORESIGHT,
    GNSS_SHIFT,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    ConsideredParameters,
    ParameterPlace,
)
from adjust.quality.considered import contradiction_of_prior, with_considered
from adjust.quality.considered_errors import ConsideredErrors
from adjust.quality.control_checks import k_fold, leave_one_out
from adjust.quality.correlation_time import along_derivative
from adjust.quality.detectability import NON_CENTRALITY, UNCONTROLLED
from adjust.quality.joint_cofactor import joint_cofactors
from adjust.quality.model_alternatives import ParameterAlternative
from adjust.quality.observation_parts import Division, Part, correlations_of, parts_of
from adjust.quality.rejection import SnoopingRule, snooping_statistics
from adjust.quality.robust import scales_of, studentized
from adjust.quality.trace_matrix import trace_matrix
from adjust.quality.variance_components import PartSums
from adjust.result import ObservationStatus
from adjust.solve.design_matrix import (
    DesignMatrix,
    design_matrix,
    full_cofactor,
    redundancy_numbers,
    whitening_matrix,
)
from adjust.solve.system import System
from tests.adjust.scenes import DEGREE, Scene, two_strips

PLACES = (
    *(ParameterPlace(INTERIOR_ORIENTATION, 0, component) for component in range(3)),
    *(ParameterPlace(BORESIGHT, 0, component) for component in range(3)),
    ParameterPlace(LEVER_ARM, 0, 0),
    ParameterPlace(ADDITIONAL_PARAMETERS, 0, 2),
)
SIGMAS = np.array([20e-6, 5e-6, 5e-6, 0.003 * DEGREE, 0.003 * DEGREE, 0.008 * DEGREE, 0.02, 1.0])


def known(places: tuple[ParameterPlace, ...] = PLACES) -> ConsideredParameters:
    """Standard deviations and correlations of some size."""
    k = len(SIGMAS)
    random = np.random.default_rng(5).normal(size=(k, k))
    correlation = random @ random.T + k * np.eye(k)
    scale = SIGMAS / np.sqrt(np.diagonal(correlation))
    chosen = [PLACES.index(place) for place in places]
    return ConsideredParameters(places, (correlation * np.outer(scale, scale))[np.ix_(chosen, chosen)])


def with_free(block: Block, places: tuple[ParameterPlace, ...]) -> Block:
    """The same block with some parameters free."""
    system = []
    for parameters in block.system:
        free = parameters.free.copy()
        for place in places:
            if place.family == parameters.family.name:
                free[place.entity, place.component] = True
        system.append(replace(parameters, free=free))
    return replace(block, system=tuple(system), considered=None)


def assert_same(found: Floats, expected: Floats, part: float = 1e-9) -> None:
    """Two covariance or normal matrices, element by element, in parts of the diagonal."""
    size = np.sqrt(np.diagonal(expected))
    np.testing.assert_allclose(
        found / np.outer(size, size), expected / np.outer(size, size), atol=part, rtol=0.0
    )


@dataclass(frozen=True, eq=False)
class Dense:
    """An adjustment, and the same in full matrices.

    Attributes
    ----------
    a, l : whitened design matrix of the unknowns and misclosures.  b : columns of the considered parameters.
    q : cofactors of the unknowns.  c : covariance of the considered parameters.
    """

    adjusted: Adjusted
    design: DesignMatrix
    a: Floats
    b: Floats
    l: Floats  # noqa: E741
    q: Floats
    c: Floats

    @property
    def errors(self) -> ConsideredErrors:
        errors = self.adjusted.quality.considered
        assert errors is not None
        return errors

    @property
    def k(self) -> Floats:
        """K (u, k)."""
        return self.q @ self.a.T @ self.b

    @property
    def moved(self) -> Floats:
        """B̃ (rows, k)."""
        return self.b - self.a @ self.k

    @property
    def normal(self) -> Floats:
        """S̃ (k, k)."""
        return self.b.T @ self.moved

    @property
    def covariance(self) -> Floats:
        """Of the unknowns, for σ0 = 1."""
        return self.q + self.k @ self.c @ self.k.T


def dense(scene: Scene, given: ConsideredParameters) -> Dense:
    block = replace(scene.block, considered=given)
    system = System.of(block, scene.observations)
    adjusted = Adjuster(AdjustmentOptions()).adjust(system, block.approximate_state())
    design = design_matrix(system, adjusted.solution.linearization)
    q = full_cofactor(design)
    wide = System.of(with_free(block, given.places), scene.observations)
    columns = design_matrix(wide, adjusted.solution.linearization)
    layout = wide.layout
    own = [layout.columns[family][entity, component] for family, entity, component in given.places]
    b = columns.matrix.toarray()[:, columns.border_columns[own]]
    return Dense(adjusted, design, design.matrix.toarray(), b, design.misclosure, q, given.covariance)


FREE = {GNSS_SHIFT: True}
PRIORS = {GNSS_SHIFT: 0.1}
CASES = {
    "five control points": {"free": FREE, "priors": PRIORS},
    "no control": {"free": FREE, "priors": PRIORS, "control": ()},
    "errors correlated over time": {
        "free": FREE, "priors": PRIORS, "gnss_correlation_s": 8.0, "ins_correlation_s": 20.0,
    },
    "nothing else free": {"free": {}},
}  # fmt: skip


@pytest.fixture(scope="module", params=CASES)
def case(request: pytest.FixtureRequest) -> Dense:
    scene = two_strips(additional=True, noise_seed=3, start_seed=4, **CASES[request.param])
    return dense(scene, known())


def test_covariances_of_unknowns_are_those_of_full_matrices(case: Dense) -> None:
    sigma0 = 1.3
    expected = sigma0**2 * case.q + case.k @ case.c @ case.k.T
    found = with_considered(case.adjusted.quality, sigma0)
    pattern, columns = found.reduced.pattern, case.design.exposure_columns
    size = np.sqrt(np.diagonal(expected))
    for row, column, block in zip(pattern.row, pattern.column, found.reduced.blocks, strict=True):
        scale = np.outer(size[columns[row]], size[columns[column]])
        difference = (sigma0**2 * block - expected[np.ix_(columns[row], columns[column])]) / scale
        assert np.abs(difference).max() < 1e-9
    border = case.design.border_columns
    assert_same(sigma0**2 * found.reduced.corner, expected[np.ix_(border, border)])
    mixed = sigma0**2 * found.reduced.border - expected[columns[:, :, None], border]
    assert np.all(np.abs(mixed) <= 1e-9 * size[columns][:, :, None] * size[border])
    for points, own in zip(found.of_points, case.design.point_columns, strict=True):
        if own[0] >= 0:
            assert_same(sigma0**2 * points, expected[np.ix_(own, own)])


def test_the_values_and_redundancy_numbers_are_those_with_the_parameters_held(case: Dense) -> None:
    system = replace(case.adjusted.system, block=replace(case.adjusted.system.block, considered=None))
    held = Adjuster(AdjustmentOptions()).adjust(system, system.block.approximate_state())
    np.testing.assert_array_equal(held.state.object_point, case.adjusted.state.object_point)
    numbers = redundancy_numbers(case.adjusted.system, case.design, case.q)
    for one, other, full in zip(held.residuals, case.adjusted.residuals, numbers, strict=True):
        np.testing.assert_array_equal(one.redundancy, other.redundancy)
        np.testing.assert_allclose(other.redundancy, full, atol=1e-9)


def test_variance_components_are_those_of_full_covariances(case: Dense) -> None:
    """With V = 1 + B C Bᵀ and R = V⁻¹ − V⁻¹A (AᵀV⁻¹A)⁻¹ AᵀV⁻¹, Ω_g is that of R l, and r_g a trace of R."""
    inverse = np.linalg.inv(np.eye(len(case.l)) + case.b @ case.c @ case.b.T)
    of_unknowns = inverse @ case.a
    full = inverse - of_unknowns @ np.linalg.solve(case.a.T @ of_unknowns, of_unknowns.T)
    squares, trace = (full @ case.l) ** 2, np.diagonal(full)
    observations = case.adjusted.observations
    files = np.arange(len(observations.image_points.image), dtype=np.int64) % 2
    for divisions in ((), (Division("image_points", ("A", "B"), files),)):
        parts = parts_of(observations, divisions)
        sums = PartSums.of(case.adjusted, parts)
        for number, group in enumerate(observations.groups):
            own = [k for k, part in enumerate(parts) if part.group == number]
            rows = slice(*case.design.row_start[number : number + 2])
            used = group.stochastic.present.ravel()
            assert sums.squares[own].sum() == pytest.approx(squares[rows][used].sum(), rel=1e-6)
            assert sums.redundancy[own].sum() == pytest.approx(trace[rows][used].sum(), abs=1e-8)


@pytest.mark.parametrize("divided", [False, True])
def test_probed_traces_are_those_of_full_covariances(case: Dense, divided: bool) -> None:
    """What observing the parameters takes of S_gh = tr(R_gh R_hg): a tenth of that of some parts."""
    observations = case.adjusted.observations
    files = np.arange(len(observations.image_points.image), dtype=np.int64) % 2
    parts = parts_of(observations, (Division("image_points", ("A", "B"), files),) if divided else ())
    parts += correlations_of(observations)
    inverse = np.linalg.inv(np.eye(len(case.l)) + case.b @ case.c @ case.b.T)
    of_unknowns = inverse @ case.a
    observed = inverse - of_unknowns @ np.linalg.solve(case.a.T @ of_unknowns, of_unknowns.T)
    held = np.eye(len(case.l)) - case.a @ case.q @ case.a.T
    exact, probed = [], []
    for full, errors in ((held, None), (observed, case.errors)):
        traces, redundancy = traces_of(case, parts, full)
        exact.append(traces)
        # With so little redundancy, the other groups are probed as often as possible.
        of_parts = np.where([part.group == 0 for part in parts], redundancy, 1.0)
        probed.append(trace_matrix(case.adjusted.system, case.adjusted.solution, parts, of_parts, errors))
    told = np.flatnonzero(np.diagonal(exact[0]) > 1e-6)
    size = np.sqrt(np.outer(np.diagonal(exact[0]), np.diagonal(exact[0])))
    change, found = (((other - one) / size)[np.ix_(told, told)] for one, other in (exact, probed))
    assert np.diagonal(change).min() < -0.1
    np.testing.assert_allclose(found, change, atol=0.05)


def traces_of(case: Dense, parts: tuple[Part, ...], full: Floats) -> tuple[Floats, Floats]:
    """tr(R K_g R K_h) and tr(R K_g) of the parts, with K one on their rows, for correlations of its own."""
    places, products = [], []
    for part in parts:
        model = case.adjusted.observations.groups[part.group].stochastic
        mask = np.zeros(model.present.shape, dtype=bool)
        mask[part.place] = model.present[part.place]
        own = np.flatnonzero(mask.ravel())
        changed = np.eye(mask.size)
        if part.is_correlation:
            changed = along_derivative(model, changed.reshape(len(mask), -1)).reshape(changed.shape)
        places.append(case.design.row_start[part.group] + own)
        products.append(full[:, places[-1]] @ changed[np.ix_(own, own)])
    pairs = list(zip(products, places, strict=True))
    traces = np.array([[np.sum(one[q] * other[p].T) for other, q in pairs] for one, p in pairs])
    return traces, np.array([np.trace(one[p]) for one, p in pairs])


def test_standardized_residuals_have_the_variance_of_held_and_considered_together(case: Dense) -> None:
    """(P v)_i over the root of (P Q_vv P)_ii with the errors of the parameters in Q_vv."""
    spread = np.eye(len(case.l)) - case.a @ case.q @ case.a.T
    both = spread + case.moved @ case.c @ case.moved.T
    v = -spread @ case.l
    groups = case.adjusted.observations.groups
    grown = 0.0
    for number, (group, found) in enumerate(zip(groups, case.adjusted.residuals, strict=True)):
        if group.stochastic.over_time is not None:
            continue
        rows = slice(*case.design.row_start[number : number + 2])
        whitener = group.stochastic.whitener
        n, m = group.stochastic.present.shape
        weight = np.zeros((n * m, n * m))
        for i in range(n):
            weight[m * i : m * i + m, m * i : m * i + m] = whitener[i].T
        pulled = (weight @ v[rows]).reshape(n, m)
        scatter, alone = (
            np.diagonal(weight @ matrix[rows, rows] @ weight.T).reshape(n, m) for matrix in (both, spread)
        )
        kept = np.isfinite(found.standardized)
        np.testing.assert_allclose(
            found.standardized[kept], pulled[kept] / np.sqrt(scatter[kept]), rtol=1e-5, atol=1e-6
        )
        expected = 4.132 * np.sqrt(scatter[kept]) / alone[kept]
        np.testing.assert_allclose(found.detectable[kept], expected, rtol=1e-7)
        grown = max(grown, float((scatter[kept] / alone[kept]).max(initial=0.0)))
    assert grown > 1.2
    pulls = snooping_statistics(case.adjusted, SnoopingRule(4.13, "observations"))
    assert all(np.isfinite(item).all() for item in pulls)


def test_errors_correlated_over_time_have_the_pull_of_full_matrices() -> None:
    """The pull T u of an observation: the rows of W⁻ᵀ (I − H) … in full, with P of the whole group."""
    case = dense(
        two_strips(
            additional=True, noise_seed=3, start_seed=4, gnss_correlation_s=8.0, **CASES["no control"]
        ),
        known(),
    )
    groups = case.adjusted.observations.groups
    number = next(k for k, group in enumerate(groups) if group.name == "gnss_positions")
    group, rows = groups[number], slice(*case.design.row_start[number : number + 2])
    whitener = whitening_matrix(group.stochastic).toarray()
    spread = np.eye(len(case.l)) - case.a @ case.q @ case.a.T
    both = spread + case.moved @ case.c @ case.moved.T
    scatter = np.diagonal(whitener.T @ both[rows, rows] @ whitener)
    w = (whitener.T @ (-spread @ case.l)[rows]) / np.sqrt(scatter)
    np.testing.assert_allclose(case.adjusted.residuals[number].standardized.ravel(), w, rtol=1e-5, atol=1e-6)


def test_the_contradiction_is_that_of_full_matrices(case: Dense) -> None:
    score = case.moved.T @ case.l
    sigma = np.sqrt(np.diagonal(case.c))
    for members in (range(len(PLACES)), (0, 2), (3,)):
        for sigma0 in (1.0, 0.7):
            chosen = list(members)
            normal = case.normal * np.outer(sigma, sigma)
            spread = (sigma0**2 * case.normal + case.normal @ case.c @ case.normal) * np.outer(sigma, sigma)
            part = (score * sigma)[chosen]
            values, vectors = np.linalg.eigh(normal[np.ix_(chosen, chosen)])
            told = vectors[:, values > 1e-9 * values.max()]
            inner = told.T @ spread[np.ix_(chosen, chosen)] @ told
            expected = (told.T @ part) @ np.linalg.solve(inner, told.T @ part)
            found = case.errors.contradiction(chosen, sigma0)
            assert found.freedom == told.shape[1]
            assert found.statistic == pytest.approx(expected, rel=1e-7)


def test_what_the_block_says_nothing_about_has_no_freedom() -> None:
    """Without INS that is the boresight; beside a free shift of one direction it is the lever arm."""
    places = PLACES[:2] + PLACES[3:6] + PLACES[6:7]
    scene = two_strips(
        additional=True, noise_seed=3, start_seed=4, ins=False, free={GNSS_SHIFT: True}, headings_deg=(90.0,),
        tilt_deg=0.0,
    )  # fmt: skip
    case = dense(scene, known(places))
    assert np.linalg.matrix_rank(case.errors.information) < len(places)
    assert case.errors.contradiction((2, 3, 4)).freedom == 0
    assert case.errors.contradiction((2, 3, 4)).probability == 1.0
    assert 2 <= case.errors.contradiction(range(len(places))).freedom <= 3
    found = with_considered(case.adjusted.quality, 1.0)
    own = case.design.point_columns[7]
    assert_same(found.of_points[7], case.covariance[np.ix_(own, own)])


def test_joint_covariances_of_points_have_the_errors_of_both(case: Dense) -> None:
    points = np.flatnonzero(case.adjusted.system.active_point)[[2, 9, 20]]
    joint = joint_cofactors(case.adjusted.system, case.adjusted.solution, points)
    errors = case.errors.of_unknowns.of_points[points]
    own = case.design.point_columns[points].ravel()
    found = joint + np.einsum("iak,jbk->iajb", errors, errors)
    assert_same(found.reshape(9, 9), case.covariance[np.ix_(own, own)])


def test_control_left_out_is_predicted_with_the_errors_of_the_parameters() -> None:
    """Prediction without the point, by an adjustment without it in full matrices."""
    case = dense(
        two_strips(additional=True, noise_seed=3, start_seed=4, **CASES["five control points"]), known()
    )
    groups = case.adjusted.observations.groups
    number = next(k for k, group in enumerate(groups) if group.name == "control_points")
    group = groups[number]
    nothing = np.zeros(len(group.point), dtype=bool)
    singly, by_fold = leave_one_out(case.adjusted, group, nothing), k_fold(case.adjusted, group, nothing, 2)
    start = int(case.design.row_start[number])
    for check in (singly, by_fold):
        for fold in np.unique(check.fold):
            rows = np.flatnonzero(check.fold == fold)
            out = (start + 3 * rows[:, None] + np.arange(3)).ravel()
            kept = np.setdiff1d(np.arange(len(case.l)), out)
            a, b = case.a[kept], case.b[kept]
            q = np.linalg.inv(a.T @ a)
            gain = q @ a.T @ b
            moved = case.b[out] - case.a[out] @ gain
            expected = moved @ case.c @ moved.T
            for place, row in enumerate(rows):
                own = slice(3 * place, 3 * place + 3)
                back = group.stochastic.unwhitener[row]
                full = back @ expected[own, own] @ back.T
                present = group.stochastic.present[row]
                np.testing.assert_allclose(
                    check.considered[row][np.ix_(present, present)],
                    full[np.ix_(present, present)], rtol=1e-5, atol=1e-12,
                )  # fmt: skip


def test_observed_parameters_have_the_covariance_and_the_test_of_full_matrices(case: Dense) -> None:
    """Unknowns with (C⁻¹ + S̃)⁻¹, and the same T as with the parameters considered, where all is linear."""
    given = known()
    system = case.adjusted.system
    block = with_free(system.block, given.places)
    of_family = {item.family.name: item.values for item in block.system}
    values = np.array([[of_family[family][entity, part] for family, entity, part in given.places]])
    model = StochasticModel.from_covariance(given.covariance[None], np.ones((1, len(PLACES)), dtype=bool))
    prior = JointPrior("camera", ("p",) * len(PLACES), ("m",) * len(PLACES), given.places, values, model)
    others = (*case.adjusted.observations.others, prior)
    wide = System.of(block, replace(case.adjusted.observations, others=others))
    adjusted = Adjuster(AdjustmentOptions()).adjust(wide, case.adjusted.state)
    design = design_matrix(wide, adjusted.solution.linearization)
    rows = design.matrix.toarray()[slice(*design.row_start[-2:])]
    own = design.border_columns[[wide.layout.columns[f][e, k] for f, e, k in given.places]]
    assert_same(rows[:, own].T @ rows[:, own], np.linalg.inv(case.c))
    q, border = full_cofactor(design), design.border_columns
    assert_same(adjusted.quality.reduced.corner, q[np.ix_(border, border)])
    # S̃ is that of nearly the same state.
    z = q[np.ix_(own, own)]
    assert_same(z, np.linalg.inv(np.linalg.inv(case.c) + case.normal), 1e-3)
    numbers = adjusted.residuals[-1].redundancy
    told = len(PLACES) - np.trace(np.linalg.solve(case.c, z))
    assert numbers.sum() == pytest.approx(told, rel=1e-7)
    test = contradiction_of_prior(prior, adjusted.state, wide.layout, adjusted.quality)
    considered = case.errors.contradiction(range(len(PLACES)))
    assert test.freedom <= considered.freedom
    assert test.statistic == pytest.approx(considered.statistic, rel=2e-3, abs=1e-3)
    # Whatever σ0 says of the block: it does not scale what is known of the parameters.
    test = contradiction_of_prior(prior, adjusted.state, wide.layout, adjusted.quality, 3.0)
    considered = case.errors.contradiction(range(len(PLACES)), 3.0)
    assert test.statistic == pytest.approx(considered.statistic, rel=2e-3, abs=1e-3)


def test_a_prior_is_tested_with_the_errors_of_what_is_considered_besides(case: Dense) -> None:
    """Lever arm and additional parameter considered, the others observed: the T of all matrices in full."""
    observed, held = PLACES[:6], PLACES[6:]
    scene, given = case.adjusted, known(observed)
    uncertain = ConsideredParameters(held, 100.0 * known(held).covariance)
    block = replace(with_free(scene.system.block, observed), considered=uncertain)
    of_family = {item.family.name: item.values for item in block.system}
    values = np.array([[of_family[family][entity, part] for family, entity, part in observed]])
    model = StochasticModel.from_covariance(given.covariance[None], np.ones((1, 6), dtype=bool))
    prior = JointPrior("camera", ("p",) * 6, ("m",) * 6, observed, values, model)
    wide = System.of(block, replace(scene.observations, others=(*scene.observations.others, prior)))
    adjusted = Adjuster(AdjustmentOptions()).adjust(wide, scene.state)
    design = design_matrix(wide, adjusted.solution.linearization)
    both = System.of(with_free(block, held), wide.observations)
    columns = design_matrix(both, adjusted.solution.linearization)
    own = columns.border_columns[[both.layout.columns[f][e, k] for f, e, k in held]]
    a, b = design.matrix.toarray(), columns.matrix.toarray()[:, own]
    outside = np.eye(len(a)) - a @ full_cofactor(design) @ a.T
    rows = slice(*design.row_start[-2:])
    moved = (outside @ b)[rows]
    residual = -(outside @ design.misclosure)[rows]
    spread = outside[rows, rows] + moved @ uncertain.covariance @ moved.T
    expected = residual @ np.linalg.solve(spread, residual)
    test = contradiction_of_prior(prior, adjusted.state, wide.layout, adjusted.quality)
    assert test.statistic == pytest.approx(expected, rel=1e-4)
    alone = residual @ np.linalg.solve(outside[rows, rows], residual)
    assert expected < 0.95 * alone
    # σ0 is one of the block; the covariance of the prior is as given.
    variance = np.full(len(a), 0.7**2)
    variance[rows] = 1.0
    spread = (outside[rows] * variance) @ outside[rows].T + moved @ uncertain.covariance @ moved.T
    smaller = contradiction_of_prior(prior, adjusted.state, wide.layout, adjusted.quality, 0.7)
    assert smaller.statistic == pytest.approx(residual @ np.linalg.solve(spread, residual), rel=1e-4)


def test_prior_is_no_observation_that_could_be_rejected() -> None:
    scene = two_strips(noise_seed=3, control=(), priors={GNSS_SHIFT: 0.1}, free=FREE)
    places = PLACES[:6]
    block = with_free(scene.block, places)
    given = known(places)
    values = np.array([[0.101, 0.0, 0.0, 0.01, 0.0, 0.0]])
    model = StochasticModel.from_covariance(given.covariance[None], np.ones((1, 6), dtype=bool))
    prior = JointPrior("camera", ("p",) * 6, ("m",) * 6, places, values, model)
    observations = replace(scene.observations, others=(*scene.observations.others, prior))
    for test in ("components", "observations"):
        options = AdjustmentOptions(critical_value=6.0, test=test)
        result = adjust_block(block, observations, options)
        assert result.groups[-1].rejected == 0
        assert np.abs(result.groups[-1].standardized).max() > 6.0


def test_alternatives_are_tested_with_what_errors_of_the_parameters_explain(case: Dense) -> None:
    """Score and information with the parameters as unknowns that are observed with their covariance."""
    result = adjust_block(case.adjusted.system.block, case.adjusted.observations)
    alternatives = [ParameterAlternative(INTERIOR_ORIENTATION, 0, 0), ParameterAlternative(LEVER_ARM, 0, 2)]
    tests = examined_model(case.adjusted.system.block, result, alternatives, AdjustmentOptions()).tests
    wide = System.of(
        with_free(case.adjusted.system.block, (ParameterPlace(LEVER_ARM, 0, 2),)), case.adjusted.observations
    )
    columns = design_matrix(wide, case.adjusted.solution.linearization)
    place = columns.border_columns[wide.layout.columns[LEVER_ARM][0, 2]]
    c = np.column_stack([case.b[:, 0], columns.matrix.toarray()[:, place]])
    outside = np.eye(len(case.l)) - case.a @ case.q @ case.a.T
    spread = np.linalg.pinv(outside + case.moved @ case.c @ case.moved.T, rcond=1e-10, hermitian=True)
    residual = outside @ case.l
    moved = outside @ c
    told = tests.distinguishable
    np.testing.assert_allclose(
        np.diagonal(tests.normal)[told], np.diagonal(moved.T @ spread @ moved)[told], rtol=1e-4
    )
    np.testing.assert_allclose(tests.score[told], (moved.T @ spread @ residual)[told], rtol=1e-2, atol=1e-3)


def test_external_reliability_is_the_largest_effect_of_an_undetected_error(case: Dense) -> None:
    """∇₀ e_i moves the unknowns by Q Aᵀ P e_i ∇₀, which is largest, in σ, along itself."""
    block, observations = case.adjusted.system.block, case.adjusted.observations
    result = adjust_block(block, observations)
    hat = case.a @ case.q @ case.a.T
    larger = 0.0
    for number, group in enumerate(result.groups):
        rows = slice(*case.design.row_start[number : number + 2])
        whitener = whitening_matrix(group.group.stochastic).toarray()
        fitted = np.diagonal(whitener.T @ hat[rows, rows] @ whitener).reshape(group.detectable.shape)
        used = group.status == ObservationStatus.USED
        expected = (group.detectable * np.sqrt(fitted))[used]
        np.testing.assert_allclose(group.external[used], expected, rtol=1e-3)
        weight = np.diagonal(whitener.T @ whitener).reshape(group.detectable.shape)
        of_baarda = np.sqrt(group.detectable**2 * weight - NON_CENTRALITY**2)[used]
        larger = max(larger, float((of_baarda / expected).max(initial=0.0)))
    assert larger > 1.05, "errors of the calibration take part in the size, not in the effect of an error"


def test_a_free_network_has_the_errors_in_its_datum() -> None:
    scene = two_strips(noise_seed=3, start_seed=4, control=(), gnss=False, ins=False)
    given = known(PLACES[:3])
    block = replace(scene.block, considered=given)
    result = adjust_block(block, scene.observations, AdjustmentOptions(free_network="object_points"))
    found = with_considered(result.cofactor, 1.0)
    grown = np.einsum("mii->m", found.of_points - result.cofactor.of_points)
    errors = result.cofactor.considered
    assert errors is not None
    assert grown.min() >= 0.0
    # The mean of all points is held by the constraints, and errors of the camera do not move it.
    np.testing.assert_allclose(errors.of_unknowns.of_points.sum(axis=0), 0.0, atol=1e-9)
    assert np.abs(errors.of_unknowns.of_points).max() > 1e-4


def test_a_free_parameter_cannot_be_considered() -> None:
    scene = two_strips(free={INTERIOR_ORIENTATION: True})
    with pytest.raises(InconsistentBlockError, match="free and considered"):
        replace(scene.block, considered=known(PLACES[:1]))


def test_the_root_of_a_singular_covariance_gives_it_back() -> None:
    vector = SIGMAS[:3, None] * np.array([[1.0], [-0.5], [2.0]])
    given = ConsideredParameters(PLACES[:3], vector @ vector.T)
    np.testing.assert_allclose(given.root @ given.root.T, given.covariance, rtol=1e-9)


def test_the_statistic_has_the_distribution_it_is_compared_with() -> None:
    """Linear theory: T of score vectors drawn with the covariance S̃ + S̃ C S̃."""
    case = dense(two_strips(noise_seed=3, control=()), known(PLACES[:6]))
    errors = case.errors
    sigma = np.sqrt(np.diagonal(case.c))
    spread = (case.normal + case.normal @ case.c @ case.normal) * np.outer(sigma, sigma)
    values, vectors = np.linalg.eigh(spread)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    random = np.random.default_rng(8)
    drawn = [
        replace(errors, score=(root @ random.normal(size=len(sigma))) / sigma).contradiction(range(6))
        for _ in range(2000)
    ]
    freedom = drawn[0].freedom
    low, high = stats.chi2.ppf([5e-4, 1.0 - 5e-4], 2000 * freedom) / 2000
    assert low < np.mean([item.statistic for item in drawn]) < high
    assert 0.035 < np.mean([item.probability < 0.05 for item in drawn]) < 0.065


def test_statistics_of_whole_observations_have_the_covariance_of_held_and_considered_together() -> None:
    """T = uᵀ C⁻¹ u, as the |w| of the same probability."""
    scene = two_strips(additional=True, noise_seed=3, start_seed=4, **CASES["five control points"])
    case = dense(scene, known())
    remainder = np.eye(len(case.l)) - case.a @ case.q @ case.a.T
    both = remainder + case.moved @ case.c @ case.moved.T
    residual, groups = -remainder @ case.l, case.adjusted.observations.groups
    found = snooping_statistics(case.adjusted, SnoopingRule(3.29, "observations"))
    compared = set()
    for group, first, ours in zip(groups, case.design.row_start, found, strict=False):
        n, m = group.stochastic.present.shape
        rows = first + np.arange(n * m).reshape(n, m)
        cofactor = both[rows[:, :, None], rows[:, None, :]]
        told = group.stochastic.present.all(axis=1) & (np.linalg.eigvalsh(cofactor)[:, 0] >= UNCONTROLLED)
        if group.name in ("image_points", "control_points", "gnss_positions", "ins_attitudes"):
            weighted = np.linalg.solve(cofactor[told], residual[rows[told]][:, :, None])[:, :, 0]
            tail = stats.chi2.sf(np.sum(residual[rows[told]] * weighted, axis=1), m)
            np.testing.assert_allclose(ours[told], stats.norm.isf(0.5 * tail), rtol=1e-4, atol=1e-6)
            compared.add(group.name)
    assert len(compared) == 4


def test_robust_estimation_begins_with_the_statistics_of_the_ordinary_adjustment() -> None:
    scene = two_strips(noise_seed=3, additional=True)
    block = replace(scene.block, considered=known())
    system = System.of(block, scene.observations)
    adjusted = Adjuster(AdjustmentOptions()).adjust(system, block.approximate_state())
    scales = scales_of(adjusted.observations, adjusted.residuals)
    found = studentized(adjusted.observations, adjusted.state, scales)
    for own, expected in zip(found, snooping_statistics(adjusted, SnoopingRule(3.29)), strict=True):
        np.testing.assert_allclose(own, expected, atol=1e-9)
