"""What every set of additional parameters has to keep; a contract raises AssertionError where it is broken.

A new set inherits all of them by its line in the register.
"""

from __future__ import annotations

import re
import typing
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat, ParameterSet, Status, Tiles
from adjust.camera.additional.correction import ideal_from_measured, measured_from_ideal
from adjust.camera.additional.effect import sigma_of_effect
from adjust.camera.additional.register import AdditionalParameters
from adjust.camera.additional.selection import SelectedTerms
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.observations.image_point import ImagePoints
from adjust.parameters import (
    ADDITIONAL_PARAMETERS,
    EXTERIOR_ORIENTATION,
    INTERIOR_ORIENTATION,
    OBJECT_POINT,
    State,
)

Contract = Callable[[ParameterSet, ImageFormat], None]

MICROMETRE = 1e-6
_UNIT = re.compile(r"1|(1/)?(µm|mm|m)[²³⁴-⁹]?")
_TERM = re.compile(r"\w+")  # no sign that the text of a selection uses
_NAME = re.compile(r"\w[\w-]*")

_UCE = ImageFormat(34.008e-3, 52.026e-3, focal_length=0.08)
_DMC_TILES = Tiles((-16e-3, 15e-3), (-28e-3, 27e-3))
#: Images that sets are tested over, in calibration axes.
FORMATS = {
    "UCE": _UCE,
    "UCE, blended outer8": replace(_UCE, tiles=Tiles((-11e-3, 11e-3), (-17e-3, 17e-3), 2e-3, "outer8")),
    "DMC": ImageFormat(46.08e-3, 82.944e-3, _DMC_TILES, 0.12),
    "DMC, rotation8": ImageFormat(46.08e-3, 82.944e-3, replace(_DMC_TILES, perspective="rotation8"), 0.12),
    "UltraCam Eagle M3": ImageFormat(34.008e-3, 52.92e-3, focal_length=0.1005),
}

# A smaller singular value of the normalised columns counts as a defect. The worst of the sound sets, three
# powers of r, have 1e-2; a defect has 1e-16.
_SMALLEST_SINGULAR_VALUE = 1e-6


def names_of(parameter_set: ParameterSet) -> tuple[str, ...]:
    return tuple(term.name for term in parameter_set.terms)


def independent_names(parameter_set: ParameterSet) -> tuple[str, ...]:
    """All terms without those that are combinations of others."""
    combined = {combination.term for combination in parameter_set.combinations}
    return tuple(name for name in names_of(parameter_set) if name not in combined)


def grid(image_format: ImageFormat, across: int = 81) -> Floats:
    """Points (n, 2) over the format, edges and axes included."""
    u, v = np.meshgrid(np.linspace(-1.0, 1.0, across), np.linspace(-1.0, 1.0, across + 10))
    return np.stack([u.ravel() * image_format.half_x, v.ravel() * image_format.half_y], axis=1)


def anywhere(image_format: ImageFormat, count: int, seed: int = 5) -> Floats:
    """Points (count, 2) drawn over the format."""
    drawn = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 2))
    return np.asarray(drawn * [image_format.half_x, image_format.half_y])


def all_of(parameter_set: ParameterSet, xy: Floats, image_format: ImageFormat) -> Floats:
    return parameter_set.basis(xy, image_format, names_of(parameter_set))


def _assert_equal_but_for_rounding(basis: Floats, expected: Floats) -> None:
    """Against the largest effect of each term: sums of other lengths round differently."""
    largest = np.abs(expected).max(axis=(0, 1), initial=0.0)
    assert np.all(np.abs(basis - expected) <= 1e-13 * largest)


def says_what_its_terms_are(parameter_set: ParameterSet, image_format: ImageFormat) -> None:
    assert _NAME.fullmatch(re.sub(r"\(\d+\)$", "", parameter_set.name))
    assert parameter_set.title.strip()
    assert parameter_set.source.strip()
    assert parameter_set.formulas.strip()
    names = names_of(parameter_set)
    assert len(set(names)) == len(names) > 0, "names of terms repeat"
    assert set(parameter_set.terms_in(image_format)) == set(names), "variants of terms that do not exist"
    for term in parameter_set.terms_in(image_format).values():
        assert _TERM.fullmatch(term.name), f"'{term.name}' cannot stand in a selection"
        assert term.meaning.strip(), f"{term.name} has no meaning"
        assert _UNIT.fullmatch(term.unit), f"{term.name} has the unit '{term.unit}'"
        assert term.status in typing.get_args(Status), f"{term.name} has the status '{term.status}'"


def has_a_column_for_each_name(parameter_set: ParameterSet, image_format: ImageFormat) -> None:
    """In the order of the names, whichever they are, for any number of points."""
    names = names_of(parameter_set)
    for count in (0, 1, 7):
        basis = all_of(parameter_set, anywhere(image_format, count), image_format)
        assert basis.shape == (count, 2, len(names))
        assert basis.dtype == np.float64
    xy = anywhere(image_format, 50)
    everything = all_of(parameter_set, xy, image_format)
    backwards = np.arange(len(names))[::-1]
    drawn = np.random.default_rng(1).permutation(len(names))[: max(1, len(names) // 2)]
    for order in (backwards, drawn):
        some = parameter_set.basis(xy, image_format, tuple(names[index] for index in order))
        _assert_equal_but_for_rounding(some, everything[:, :, order])


def takes_every_point_by_itself(parameter_set: ParameterSet, image_format: ImageFormat) -> None:
    xy = anywhere(image_format, 60)
    together = all_of(parameter_set, xy, image_format)
    again = all_of(parameter_set, xy[::-1][:20].copy(), image_format)
    _assert_equal_but_for_rounding(again, together[::-1][:20])


def is_finite_everywhere(parameter_set: ParameterSet, image_format: ImageFormat) -> None:
    """At the origin, on the axes and seams, in the corners and a little beyond the edges."""
    tiles = image_format.tiles
    x = np.concatenate([np.linspace(-1.05, 1.05, 41) * image_format.half_x, tiles.seams_x if tiles else ()])
    y = np.concatenate([np.linspace(-1.05, 1.05, 41) * image_format.half_y, tiles.seams_y if tiles else ()])
    xy = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    assert np.any(np.all(xy == 0.0, axis=1))
    assert np.isfinite(all_of(parameter_set, xy, image_format)).all()


def has_full_rank(parameter_set: ParameterSet, image_format: ImageFormat) -> None:
    """All terms are linearly independent over the format, but for the combinations that it declares."""
    names = independent_names(parameter_set)
    columns = parameter_set.basis(grid(image_format), image_format, names).reshape(-1, len(names))
    length = np.linalg.norm(columns, axis=0)
    assert np.all(length > 0.0), f"no effect: {[names[index] for index in np.flatnonzero(length == 0.0)]}"
    singular = np.linalg.svd(columns / length, compute_uv=False)
    assert singular[-1] > _SMALLEST_SINGULAR_VALUE * singular[0], (
        f"smallest singular value {singular[-1]:.1e}"
    )


def declares_true_combinations(parameter_set: ParameterSet, image_format: ImageFormat) -> None:
    xy = grid(image_format, 40)
    for combination in parameter_set.combinations:
        others = parameter_set.basis(xy, image_format, combination.of).reshape(-1, len(combination.of))
        term = parameter_set.basis(xy, image_format, (combination.term,)).ravel()
        scale = np.linalg.norm(others, axis=0)
        remainder = term - (others / scale) @ np.linalg.lstsq(others / scale, term, rcond=None)[0]
        share = np.linalg.norm(remainder) / np.linalg.norm(term)
        assert share < 1e-10, f"{combination.term} is no combination of {combination.of}"


def is_smooth_but_for_seams(parameter_set: ParameterSet, image_format: ImageFormat) -> None:
    """Central differences with two steps agree to the size of the third derivative.

    Steps of 10 and 20 µm are 1e-3 of the length over which the finest function bends (tenth degree: 5 mm), so
    the differences agree to 1e-5 of the largest slope at least. A point within a step of a seam (some 1e-3 of
    the points) may differ.
    """
    xy = anywhere(image_format, 400)
    for axis in np.eye(2):
        slopes = []
        for step in (10 * MICROMETRE, 20 * MICROMETRE):
            ahead = all_of(parameter_set, xy + step * axis, image_format)
            slopes.append((ahead - all_of(parameter_set, xy - step * axis, image_format)) / (2.0 * step))
        largest = np.quantile(np.abs(slopes[0]), 0.99, axis=(0, 1)) + np.abs(slopes[0]).mean(axis=(0, 1))
        differs = np.abs(slopes[1] - slopes[0]) > 1e-4 * largest + 1e-12
        assert np.mean(differs.any(axis=(1, 2))) < 0.02


def leads_from_measured_to_ideal_and_back(parameter_set: ParameterSet, image_format: ImageFormat) -> None:
    """With effects of 5 µm each; at a seam a point may have no measured one, or two."""
    parameters = AdditionalParameters(
        (SelectedTerms(parameter_set, independent_names(parameter_set)),), image_format
    )
    signs = np.random.default_rng(3).choice([-1.0, 1.0], len(parameters.names))
    values = signs * sigma_of_effect(parameters, 5 * MICROMETRE)
    measured = anywhere(image_format, 500)
    ideal = ideal_from_measured(parameters, values, measured)
    assert np.abs(ideal - measured).max() > 2.5 * MICROMETRE
    back, found = measured_from_ideal(parameters, values, ideal)
    assert found.mean() > 0.99
    np.testing.assert_allclose(
        ideal_from_measured(parameters, values, back[found]), ideal[found], rtol=0.0, atol=1e-14
    )
    same = np.abs(back - measured).max(axis=1) < 1e-12
    assert same.mean() > 0.99


def enters_the_image_points_with_exact_derivatives(
    parameter_set: ParameterSet, image_format: ImageFormat
) -> None:
    """By its values, c, x0, y0, the projection centre and an object point; with effects of 5 µm each.

    At points that stay in one tile: there the correction of every set is smooth.
    """
    names = independent_names(parameter_set)
    parameters = AdditionalParameters((SelectedTerms(parameter_set, names),), image_format)
    values = sigma_of_effect(parameters, 5 * MICROMETRE)[None, :]
    c = image_format.needed_focal_length
    xy = anywhere(image_format, 40)
    count, images = len(xy), np.zeros(1, dtype=np.int64)
    points = np.column_stack([xy * 10_000.0, np.full(count, -10_000.0 * c)])
    rays = ImagePoints(
        np.zeros(count, dtype=np.int64),
        np.arange(count),
        images,
        xy,
        np.ones((count, 2)),
        np.ones(count, dtype=bool),
        SelfCalibration.of(parameters.names, (parameters,), images),
    )
    system = {INTERIOR_ORIENTATION: np.array([[c, 0.0, 0.0]]), ADDITIONAL_PARAMETERS: values}
    state = State(np.zeros((1, 3)), np.eye(3)[None], points, system)
    terms = {term.block: term.jacobian for term in rays.linearize(state).terms}

    def numeric(ahead: State, behind: State, step: float) -> Floats:
        return (rays.misclosure(behind) - rays.misclosure(ahead)) / (2.0 * step)

    def of_system(family: str, component: int, step: float) -> Floats:
        change = np.zeros_like(system[family])
        change[0, component] = step
        return numeric(
            *(
                replace(state, system={**system, family: system[family] + sign * change})
                for sign in (1.0, -1.0)
            ),
            step,
        )

    for component in range(3):
        found = of_system(INTERIOR_ORIENTATION, component, 1e-8)
        _assert_nearly_all_equal(found, terms[INTERIOR_ORIENTATION][:, :, component])
        step = 1e-3 * np.eye(3)[component]
        found = numeric(
            replace(state, projection_centre=step[None]), replace(state, projection_centre=-step[None]), 1e-3
        )
        _assert_nearly_all_equal(found, terms[EXTERIOR_ORIENTATION][:, :, component])
        _assert_nearly_all_equal(-found, terms[OBJECT_POINT][:, :, component])
    for k, value in enumerate(values[0]):
        found = of_system(ADDITIONAL_PARAMETERS, k, 0.1 * value)
        _assert_nearly_all_equal(found, terms[ADDITIONAL_PARAMETERS][:, :, k])


def _assert_nearly_all_equal(found: Floats, expected: Floats) -> None:
    """But for a point that a step takes over a seam."""
    differs = np.abs(found - expected).max(axis=1) > 1e-5 * np.abs(expected).max()
    assert differs.sum() <= 1


CONTRACTS: tuple[Contract, ...] = (
    says_what_its_terms_are,
    has_a_column_for_each_name,
    takes_every_point_by_itself,
    is_finite_everywhere,
    has_full_rank,
    declares_true_combinations,
    is_smooth_but_for_seams,
    leads_from_measured_to_ideal_and_back,
    enters_the_image_points_with_exact_derivatives,
)
