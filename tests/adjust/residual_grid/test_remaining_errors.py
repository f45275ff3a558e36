"""What corrections by mean residuals leave in unknowns: dense matrices, and simulated errors of a camera."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pytest
from scipy import linalg

from adjust.adjustment import adjust_block
from adjust.arrays import Floats, Ints
from adjust.observations.control_point import ControlPoints
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT, INTERIOR_ORIENTATION
from adjust.quality.control_checks import ControlCheck
from adjust.quality.unknown_errors import CorrectionErrors
from adjust.residual_grid import mean_response as mean_response_module
from adjust.residual_grid import remaining_errors as remaining_errors_module
from adjust.residual_grid.controlled_residuals import controlled
from adjust.residual_grid.expected_field import ExpectedField, Places, expected_field
from adjust.residual_grid.format_cells import FormatCells, Interpolation
from adjust.residual_grid.image_correction import CorrectionField, corrected
from adjust.residual_grid.image_sets import GridRule
from adjust.residual_grid.iteration import iterate_grid
from adjust.residual_grid.remaining_errors import remaining_errors, with_correction_errors
from adjust.residual_grid.residual_grid import LEAST_IN_CELL
from adjust.residual_grid.smoothing import Smoothing
from adjust.result import AdjustmentResult, ObservationStatus
from adjust.result_columns import sigma_of_points
from adjust.simulate.image_errors import ImageErrorSpecification
from adjust.solve.design_matrix import design_matrix, full_cofactor
from tests.adjust.calibration.camera_errors import (
    NOTHING,
    RADIAL_AND_TILES,
    SEAMS,
    CameraTest,
    cells,
    high_block,
)
from tests.adjust.scenes import two_strips

#: Interior orientation free, and held.
FREE = {INTERIOR_ORIENTATION: True, BORESIGHT: True}
HELD = {BORESIGHT: True}
#: All images are one set, or those of every camera, or every second one.
SetsBy = Literal["all", "camera", "half"]
ONCE = GridRule(most_iterations=1, smoothing=Smoothing(), cross_validate=False)


@dataclass(frozen=True, eq=False)
class Corrected:
    """A block adjusted with corrections of sets of images."""

    result: AdjustmentResult
    fields: tuple[CorrectionField | None, ...]
    set_of_image: Ints
    interpolation: Interpolation = "bilinear"

    @classmethod
    def once(
        cls,
        plan: Mapping[str, object],
        by: SetsBy = "all",
        interpolation: Interpolation = "bilinear",
    ) -> Corrected:
        """Once by plain means of 3 × 3 sub-areas; radial errors of 8 µm at 50 mm, σ uneven and too small,
        every 40th image point rejected.
        """
        scene = two_strips(
            **{"noise_seed": 3, "distances": 2, "points_along": 20, "points_across": 10, **plan}
        )
        block, rays = scene.block, scene.observations.image_points
        outwards = 8e-6 * rays.xy * np.sum(rays.xy**2, axis=1, keepdims=True) / 0.05**3
        uneven = np.random.default_rng(6).uniform(0.4, 0.6, (len(rays.image), 1)) * [1.0, 1.5]
        active = np.arange(len(rays.image)) % 40 > 0
        measured = replace(rays, xy=rays.xy + outwards, sigma=rays.sigma * uneven, active=active)
        observations = replace(scene.observations, image_points=measured)
        first = adjust_block(block, observations)
        image = np.arange(len(block.images))
        sets = {"all": 0 * image, "camera": block.camera_of_image, "half": image % 2}[by]
        grids = [
            FormatCells.of(block.cameras[k % len(block.cameras)].half_format, 3) for k in np.unique(sets)
        ]
        found = iterate_grid(block, first, grids, sets, replace(ONCE, interpolation=interpolation))
        points = corrected(measured, found.fields, sets, interpolation)
        result = adjust_block(block, replace(observations, image_points=points))
        return cls(result, found.fields, sets, interpolation)

    @classmethod
    def of_test(cls, test: CameraTest, division: FormatCells) -> Corrected:
        """Corrected three times, smoothed."""
        rule = GridRule(most_iterations=3, cross_validate=False)
        found = iterate_grid(test.block, test.result, (division,), test.block.camera_of_image, rule)
        points = corrected(
            test.observations.image_points, found.fields, test.block.camera_of_image, "bilinear"
        )
        result = adjust_block(test.block, replace(test.observations, image_points=points))
        return cls.of_one_set(result, found.fields[0])

    @classmethod
    def of_one_set(cls, result: AdjustmentResult, field: CorrectionField | None) -> Corrected:
        assert field is not None
        return cls(result, (field,), np.zeros_like(result.block.camera_of_image))

    def errors(self) -> CorrectionErrors | None:
        return remaining_errors(self.result, self.fields, self.set_of_image, self.interpolation)

    def with_errors(self) -> AdjustmentResult:
        return with_correction_errors(self.result, self.errors())


@pytest.fixture(scope="module")
def once() -> Corrected:
    return Corrected.once({"free": FREE})


class Dense:
    """The formulas of the module, with every matrix in full; set by set x of all finer cells, then y."""

    def __init__(self, corrected: Corrected, parts: Sequence[int | None]) -> None:
        result = corrected.result
        design = design_matrix(result.system, result.solution.linearization)
        self.cofactor, self.border = full_cofactor(design), design.border_columns
        self.exposures, self.points = design.exposure_columns, design.point_columns
        rays, chosen = result.observations.image_points, controlled(result.groups[0])
        n, of_ray = len(rays.image), corrected.set_of_image[rays.image]
        a = design.matrix[: 2 * n].toarray()
        fields, means = list[Floats](), list[Floats]()
        self.places, self.weight, corrections, turned = list[Places](), list[Floats](), list[Floats](), []
        turning = a[:, self.exposures].sum(axis=1)[:, 3:]
        for number, (field, divided) in enumerate(zip(corrected.fields, parts, strict=True)):
            if field is None:
                continue
            cells, of_set = field.cells.finer(divided or 1), of_ray == number
            cell = np.where(of_set, cells.cell_of(rays.xy), cells.count)
            count = np.stack([np.bincount(cell, own, cells.count)[: cells.count] for own in chosen.T], axis=1)
            known = count >= (1 if divided is not None else LEAST_IN_CELL)
            for coordinate, place in np.argwhere(known.T):
                unit = np.where(known, 0.0, np.nan)
                unit[place, coordinate] = 1.0
                between = cells.interpolate(unit, rays.xy, corrected.interpolation)
                fields.append((between * of_set[:, None]).ravel())
                mean = np.zeros((n, 2))
                mean[:, coordinate] = (cell == place) & chosen[:, coordinate]
                means.append(mean.ravel() / mean.sum())
            self.places.append(Places(cells, known.T))
            self.weight.append(count.T[known.T])
            at_middles = field.cells.interpolate(field.value, cells.middles, corrected.interpolation)
            corrections.append(at_middles.T[known.T])
            turned.append(turning * np.repeat(of_set, 2)[:, None])
        self.of_rays, mean_of = np.array(fields).T, np.array(means)
        inverse, sigma = rays.inverse_sigma.ravel(), rays.sigma.ravel()
        left = mean_of @ result.groups[0].residual.ravel()
        whitened, mean_of = self.of_rays * inverse[:, None], mean_of * sigma
        self.effect = self.cofactor @ (a.T @ whitened)
        of_unknowns = mean_of @ a
        response = mean_of @ whitened - of_unknowns @ self.effect
        noise = result.sigma0**2 * (mean_of @ mean_of.T - of_unknowns @ self.cofactor @ of_unknowns.T)
        (of_interior,) = (
            term.jacobian
            for term in rays.linearize(result.solution.linearization).terms
            if term.block == INTERIOR_ORIENTATION
        )
        camera, held = result.block.camera_of_image[rays.image], [np.zeros((2 * n, 0))]
        if result.block.rig is None:
            held += [
                np.where((camera == own)[:, None, None], of_interior, 0.0).reshape(2 * n, 3)
                * inverse[:, None]
                for own in np.unique(camera)
            ]
        else:
            turned = (
                [turning] if np.isin(of_ray, [k for k, f in enumerate(corrected.fields) if f]).all() else []
            )
        weight, correction = np.concatenate(self.weight), np.concatenate(corrections)
        root = np.sqrt(weight)[:, None]
        # Combinations of what free parameters make that the means hardly show.
        free = linalg.orth(root * (mean_of @ np.column_stack([a[:, self.border], *turned]))) / root
        shown = free.T @ (root**2 * (response @ free))
        part, combination = np.linalg.eigh((shown + shown.T) / 2.0)
        imitable = np.column_stack([free @ combination[:, part < 0.1], mean_of @ np.column_stack(held)])
        self.contained = np.eye(len(weight)) - imitable @ np.linalg.pinv(root * imitable, rcond=1e-8) * root.T
        self.expected: ExpectedField = expected_field(
            self.places, left + response @ correction, response, noise, self.contained
        )
        wrong = self.contained @ correction - self.expected.value
        self.errors = np.column_stack([self.expected.root, wrong])

    def of_everything(self) -> Floats:
        """Errors (u + 2 n, k) of all unknowns and of the corrections at the image points."""
        return np.vstack([self.effect, self.of_rays]) @ self.errors

    def found(self, errors: CorrectionErrors, result: AdjustmentResult) -> Floats:
        """The same of the module."""
        found = np.zeros((len(self.cofactor), errors.of_unknowns.count))
        found[self.exposures] = errors.of_unknowns.of_exposures
        found[self.border] = errors.of_unknowns.of_border
        used = self.points[:, 0] >= 0
        found[self.points[used]] = errors.of_unknowns.of_points[used]
        rays = result.observations.image_points
        return np.vstack([found, errors.at(rays.image, rays.xy).reshape(-1, found.shape[1])])

    def assert_alike(self, found: Floats, *expected: Floats) -> None:
        """Whether errors have the covariances of others, of which there are several independent ones."""
        image = np.full(len(self.of_rays), 1e-6)
        size = np.concatenate([np.sqrt(np.diagonal(self.cofactor)), image])[:, None]
        scaled, *others = (item / size for item in (found, *expected))
        added = sum(item @ item.T for item in others)
        of_unknowns = slice(0, len(self.cofactor))
        largest = np.max(added[of_unknowns, of_unknowns])
        difference = scaled @ scaled.T - added
        assert np.abs(difference, out=difference).max() < 1e-5 * largest


@pytest.mark.parametrize(
    ("plan", "by", "interpolation"),
    [
        ({"free": FREE}, "all", "bilinear"),
        ({"free": HELD}, "half", "cell"),
        ({"free": HELD, "heads": 2}, "all", "bilinear"),
        ({"free": HELD, "heads": 2}, "camera", "cell"),
        ({"free": HELD, "cameras": 2}, "camera", "bilinear"),
    ],
)
def test_errors_of_everything_are_those_of_full_matrices(
    plan: dict[str, object],
    by: SetsBy,
    interpolation: Interpolation,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    once = Corrected.once(plan, by, interpolation)
    monkeypatch.setattr(remaining_errors_module, "_NEGLECTED", -1.0)
    errors = once.with_errors().cofactor.corrections
    assert errors is not None
    dense, first = Dense(once, errors.parts), 0
    assert dense.expected.evidence > 12.0
    dense.assert_alike(dense.found(errors, once.result), dense.of_everything())
    for places, sigma in zip(dense.places, errors.sigma, strict=True):
        part = slice(first, first := first + places.count)
        assert sigma == pytest.approx(dense.expected.sigma_of(part), rel=1e-4)
    # Held parameters have none.
    for name, columns in once.result.layout.columns.items():
        assert np.all(errors.of_families[name][columns < 0] == 0.0)
        free = errors.of_families[name][columns >= 0]
        np.testing.assert_array_equal(free, errors.of_unknowns.of_border[columns[columns >= 0]])


@pytest.mark.parametrize("heads_or_cameras", ["heads", "cameras"])
def test_errors_of_sets_that_are_too_many_together_are_independent(
    heads_or_cameras: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    once = Corrected.once({"free": HELD, heads_or_cameras: 2}, "camera")
    monkeypatch.setattr(remaining_errors_module, "_NEGLECTED", -1.0)
    monkeypatch.setattr(remaining_errors_module, "MOST_CELLS", 9)
    monkeypatch.setattr(mean_response_module, "MOST_TOGETHER", 17)
    errors = once.errors()
    assert errors is not None
    first, second = (
        Dense(replace(once, fields=fields), errors.parts)
        for fields in ((once.fields[0], None), (None, once.fields[1]))
    )
    first.assert_alike(first.found(errors, once.result), first.of_everything(), second.of_everything())
    assert errors.sigma == pytest.approx([first.expected.sigma, second.expected.sigma], rel=1e-4)


def test_what_is_left_out_is_a_small_part_of_every_variance() -> None:
    # The largest ratios to σ0² N⁻¹ of variances that independent combinations of errors add.
    once = Corrected.once({"free": HELD, "heads": 2})
    errors = once.errors()
    assert errors is not None
    dense, sigma0 = Dense(once, errors.parts), once.result.sigma0
    added = dense.effect @ dense.errors
    ratio = np.linalg.eigvalsh(added.T @ np.linalg.solve(dense.cofactor, added)) / sigma0**2
    more, kept, fewer = (np.count_nonzero(ratio > least) for least in (0.005 / sigma0, 0.005, 0.01))
    assert fewer < kept < more
    assert errors.of_unknowns.count == kept


def test_parameters_are_those_of_the_corrections(once: Corrected) -> None:
    # A shift of all image points is as much a principal point: in the parameters and nowhere else.
    dense = Dense(once, (3,))
    (places,), (weight,) = dense.places, dense.weight
    cells, known = places.cells, places.known
    for coordinate in (0, 1):
        shift = np.repeat([[coordinate == 0], [coordinate == 1]], cells.count, axis=1)[known]
        np.testing.assert_allclose(dense.contained @ shift, 0.0, atol=1e-6)
    errors = once.with_errors().cofactor.corrections
    assert errors is not None
    rays = once.result.observations.image_points
    at_middles = errors.at(np.zeros(cells.count, dtype=np.int64), cells.middles)
    for own, values in zip(known, np.moveaxis(at_middles, 1, 0), strict=True):
        part, weight = weight[: own.sum()], weight[own.sum() :]
        np.testing.assert_allclose(part @ values[own] / part.sum(), 0.0, atol=1e-3 * np.abs(at_middles).max())
    assert errors.at(rays.image, rays.xy).shape == (len(rays.image), 2, errors.of_unknowns.count)


def test_every_sigma_grows_and_that_of_predicted_control_points_too(once: Corrected) -> None:
    result = once.with_errors()
    before, after = once.result.left_out_singly, result.left_out_singly
    assert isinstance(before, ControlCheck)
    assert isinstance(after, ControlCheck)
    np.testing.assert_array_equal(before.difference, after.difference)
    grown = np.diagonal(after.considered - before.considered, axis1=1, axis2=2)
    assert np.all(grown[np.isfinite(before.difference)] > 0.0)
    used = result.active_point
    assert np.all(sigma_of_points(result)[used] > sigma_of_points(once.result)[used])


def test_predictions_of_rejected_control_points_and_of_folds_get_errors_and_stay_what_they_are() -> None:
    scene = two_strips(free=HELD, noise_seed=5, points_along=20, points_across=10)
    control, *others = scene.observations.others
    assert isinstance(control, ControlPoints)
    given = control.given.copy()
    given[2, 0] += 2.0  # known in plan only
    observations = replace(scene.observations, others=(replace(control, given=given), *others))
    options = AdjustmentOptions(critical_value=4.13, control_folds=3)
    result = adjust_block(scene.block, observations, options)
    assert (result.groups[1].status[2] == ObservationStatus.REJECTED).tolist() == [True, True, False]
    cells = FormatCells.of(scene.block.cameras[0].half_format, 3)
    random = 3e-6 * np.random.default_rng(1).normal(size=(cells.count, 2))
    found = Corrected.of_one_set(result, CorrectionField(cells, random)).with_errors()
    for before, after in (
        (result.left_out_singly, found.left_out_singly),
        (result.left_out_by_fold, found.left_out_by_fold),
    ):
        assert isinstance(before, ControlCheck)
        assert isinstance(after, ControlCheck)
        np.testing.assert_array_equal(after.fold, before.fold)
        np.testing.assert_array_equal(after.difference, before.difference)
        np.testing.assert_allclose(after.cofactor, before.cofactor, rtol=1e-9)
        grown = np.diagonal(after.considered - before.considered, axis1=1, axis2=2)
        assert np.all(grown[np.isfinite(before.difference)] > 0.0)


def test_nothing_corrected_is_nothing_left_and_too_many_cells_are_not_computed(once: Corrected) -> None:
    every_image = np.zeros_like(once.result.block.camera_of_image)
    assert remaining_errors(once.result, (None,), every_image, "bilinear") is None
    assert with_correction_errors(once.result, None) is once.result
    many = FormatCells.of(once.result.block.cameras[0].half_format, 37)
    field = CorrectionField(many, np.zeros((many.count, 2)))
    assert remaining_errors(once.result, (field,), every_image, "bilinear") is None


def height_errors(test: CameraTest, division: FormatCells) -> tuple[float, float]:
    """RMS of errors of heights over their σ, without and with what corrections leave."""
    corrected_test = Corrected.of_test(test, division)
    used = corrected_test.result.active_point
    truth = test.simulated.truth.state.object_point
    error = (corrected_test.result.state.object_point - truth)[used, 2]
    without, having = (
        float(np.sqrt(np.mean((error / sigma_of_points(result)[used, 2]) ** 2)))
        for result in (corrected_test.result, corrected_test.with_errors())
    )
    return without, having


@pytest.mark.slow
@pytest.mark.parametrize(
    ("errors", "division", "most"),
    [
        (RADIAL_AND_TILES, cells(15), 1.4),
        # Too coarse for these errors: where they vary within the sub-areas was not looked at, 3.4 and 4.5.
        (RADIAL_AND_TILES, cells(9, SEAMS), 1.4),
        (RADIAL_AND_TILES, cells(5), 1.4),
        # Hardly a mean shows them: 4.6.
        (ImageErrorSpecification(radial=2.5e-6), cells(9), 1.6),
    ],
)
def test_heights_of_a_block_that_bends_after_the_camera_have_their_sigma(
    errors: ImageErrorSpecification, division: FormatCells, most: float
) -> None:
    # Nine control points and no GNSS: most of the radial errors of 2.5 µm went into the heights.
    without, having = height_errors(high_block(errors), division)
    assert without > 5.0
    assert 0.7 < having < most


def test_where_all_that_is_left_is_small_the_largest_part_stays(
    once: Corrected, monkeypatch: pytest.MonkeyPatch
) -> None:
    full = once.errors()
    monkeypatch.setattr(remaining_errors_module, "_NEGLECTED", 1e9)
    largest = once.errors()
    assert full is not None
    assert largest is not None
    assert largest.of_unknowns.count == 1 < full.of_unknowns.count
    assert largest.sigma == full.sigma
    rays = once.result.observations.image_points
    assert largest.at(rays.image, rays.xy).shape == (len(rays.image), 2, 1)


def test_a_good_camera_costs_nothing() -> None:
    test = high_block(NOTHING)
    found = replace(ONCE, smoothing=Smoothing("counts"))
    fields = iterate_grid(test.block, test.result, (cells(9),), test.block.camera_of_image, found).fields
    points = corrected(test.observations.image_points, fields, test.block.camera_of_image, "bilinear")
    result = adjust_block(
        test.block, replace(test.observations, image_points=points), AdjustmentOptions(threads=1)
    )
    used, item = result.active_point, Corrected.of_one_set(result, fields[0])
    grown = sigma_of_points(item.with_errors())[used] / sigma_of_points(result)[used]
    assert grown.mean() < 1.05
    assert grown.max() < 1.25


@pytest.mark.slow
def test_where_nothing_was_corrected_what_means_indicate_is_left_all_the_same() -> None:
    # Cross-validation refuses a correction; the heights have errors of 5.7 times the σ of noise alone.
    test = high_block(ImageErrorSpecification(radial=2.5e-6))
    nothing = CorrectionField.zero(cells(9))
    result = Corrected.of_one_set(test.result, nothing).with_errors()
    used = result.active_point
    error = (result.state.object_point - test.simulated.truth.state.object_point)[used, 2]
    without, having = (
        float(np.sqrt(np.mean((error / sigma_of_points(own)[used, 2]) ** 2))) for own in (test.result, result)
    )
    assert without > 5.0
    assert 0.7 < having < 1.6
    # Of noise alone nothing is left.
    good = Corrected.of_one_set(high_block(NOTHING).result, nothing)
    grown = sigma_of_points(good.with_errors())[used, 2] / sigma_of_points(good.result)[used, 2]
    assert grown.max() < 1.15


def without_corrections(result: AdjustmentResult, number: int, by: SetsBy) -> Corrected:
    """Corrections of zero in so many sub-areas along a side, of all images or of every camera."""
    count = 1 if by == "all" else len(result.block.cameras)
    grids = [FormatCells.of(camera.half_format, number) for camera in result.block.cameras[:count]]
    fields = tuple(CorrectionField(cells, np.zeros((cells.count, 2))) for cells in grids)
    sets = result.block.camera_of_image if by == "camera" else np.zeros_like(result.block.camera_of_image)
    return Corrected(result, fields, sets)


def test_sub_areas_are_divided_as_far_as_residuals_of_their_set_and_time_allow(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    result = Corrected.once({"free": HELD, "heads": 2}).result

    def parts(number: int, by: SetsBy) -> tuple[int | None, ...]:
        errors = without_corrections(result, number, by).errors()
        assert errors is not None
        return tuple(errors.parts)

    chosen = controlled(result.groups[0])
    of_first = (result.block.camera_of_image[result.observations.image_points.image] == 0)[:, None]
    first, both = (int(own.sum(axis=0).max()) // LEAST_IN_CELL for own in (chosen & of_first, chosen))
    assert 3**2 * 5**2 <= both < 3**2 * 7**2
    assert parts(3, "all") == (5,)
    # An even number has no part at the middle.
    assert 6**2 * 2**2 <= both < 6**2 * 3**2 <= 2 * both
    assert parts(6, "all") == (1,)
    assert 3**2 * 3**2 <= first < 4**2 * 3**2 <= both
    assert parts(3, "camera") == (3, 3)
    assert parts(4, "camera")[0] == 1
    monkeypatch.setattr(remaining_errors_module, "MOST_TOGETHER", 2 * 3**2 * 3**2 - 1)
    assert parts(3, "camera") == (1, 1)
    assert parts(3, "all") == (5,)
