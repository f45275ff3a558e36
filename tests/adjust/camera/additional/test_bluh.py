"""The general, quarter and corner terms of BLUH against their published and closed values."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.camera.additional import bluh
from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.bluh_general import normalised_millimetre
from adjust.camera.additional.effect import effects
from adjust.camera.additional.register import additional_parameters

MICROMETRE, MILLIMETRE = 1e-6, 1e-3


def camera_format(columns: int, rows: int, pixel_um: float) -> ImageFormat:
    """With columns along flight."""
    return ImageFormat(0.5 * columns * pixel_um * MICROMETRE, 0.5 * rows * pixel_um * MICROMETRE)


DMC = camera_format(7680, 13824, 12.0)
UCX = camera_format(9420, 14430, 7.2)
UCE = camera_format(13080, 20010, 5.2)
DMC_II_230 = camera_format(14144, 15556, 5.6)
DMC_II_250 = camera_format(14656, 17216, 5.6)


def correction(number: int, xy_mm: list[list[float]], image_format: ImageFormat = UCE) -> Floats:
    """Δ (n, 2) of a term, normalised millimetres, at normalised points."""
    unit = normalised_millimetre(image_format)
    return bluh.SET.basis(np.array(xy_mm) * unit, image_format, (str(number),))[:, :, 0] / unit


@pytest.mark.parametrize(
    ("image_format", "half_diagonal_mm", "factor"),
    [
        (DMC, 94.885, 1.7137),
        (DMC_II_230, 58.869, 2.7621),
        (DMC_II_250, 63.307, 2.5685),
        (UCX, 62.037, 2.6210),
        (UCE, 62.155, 2.6160),
    ],
)
def test_the_corner_of_every_format_lies_at_162_6(
    image_format: ImageFormat, half_diagonal_mm: float, factor: float
) -> None:
    assert np.hypot(image_format.half_x, image_format.half_y) / MILLIMETRE == pytest.approx(
        half_diagonal_mm, abs=6e-4
    )
    assert MILLIMETRE / normalised_millimetre(image_format) == pytest.approx(factor, abs=6e-5)


def test_values_of_the_general_terms_that_displace_by_at_most_one_micrometre() -> None:
    largest = effects(additional_parameters("bluh12", UCE)).largest
    expected = [
        *(1.61e-5, 1.61e-5, 1.92e-5, 1.76e-5, 2.94e-5, 1.92e-5),
        *(1.81e-7, 1.18e-7, 1.60e-9, 1.62e-5, 1.81e-5, 1.77e-5),
    ]
    np.testing.assert_allclose(MICROMETRE / largest, expected, rtol=5e-3)


def test_general_terms_are_the_published_table_with_the_sign_of_a_correction() -> None:
    """With the direction b itself; the table gives x' = x − P · column."""
    xy = np.random.default_rng(1).uniform(-110.0, 110.0, (40, 2))
    x, y = xy.T
    r, b = np.hypot(x, y), np.arctan2(y, x)
    along = np.array([x, y])
    table = {
        1: np.array([y, x]),
        2: np.array([x, -y]),
        3: along * np.cos(2 * b),
        4: along * np.sin(2 * b),
        5: along * np.cos(b),
        6: along * np.sin(b),
        7: np.array([-y * r * np.cos(b), x * r * np.cos(b)]),
        8: np.array([-y * r * np.sin(b), x * r * np.sin(b)]),
        9: along * (r**2 - 16384.0),
        10: along * np.sin(r * 0.049087),
        11: along * np.sin(r * 0.098174),
        12: along * np.sin(4 * b),
    }
    for number, column in table.items():
        # The constants of 10 and 11 are printed with five digits: 155² · 8e-7.
        tolerance = 2e-2 if number in (10, 11) else 1e-9 * np.abs(column).max()
        np.testing.assert_allclose(
            correction(number, xy.tolist()), -column.T, atol=tolerance, err_msg=str(number)
        )


@pytest.mark.parametrize(
    ("number", "radii"), [(9, (128.0,)), (10, (64.0, 128.0)), (11, (32.0, 64.0, 96.0, 128.0, 160.0))]
)
def test_radial_terms_vanish_where_they_should_and_only_there(number: int, radii: tuple[float, ...]) -> None:
    direction = np.array([np.cos(0.7), np.sin(0.7)])
    r = np.linspace(1.0, 162.0, 1611)
    radial = correction(number, (r[:, None] * direction).tolist()) @ direction
    np.testing.assert_allclose(
        correction(number, [(radius * direction).tolist() for radius in radii]), 0.0, atol=1e-9
    )
    changes = r[np.flatnonzero(np.diff(np.sign(radial)))]
    np.testing.assert_array_equal(np.unique(np.round(changes)), radii)


def test_general_terms_are_zero_in_the_principal_point() -> None:
    basis = additional_parameters("bluh12", UCE).basis(np.zeros((1, 2)))
    np.testing.assert_array_equal(basis, 0.0)


def test_a_scale_of_the_format_changes_nothing_in_normalised_coordinates() -> None:
    smaller = ImageFormat(0.5 * UCE.half_x, 0.5 * UCE.half_y)
    for number in (1, 5, 8, 9, 11, 12, 37, 80):
        np.testing.assert_allclose(
            correction(number, [[30.0, -70.0]], smaller), correction(number, [[30.0, -70.0]]), rtol=1e-12
        )


QUARTERS = {34: (1, 1), 36: (1, -1), 38: (-1, -1), 40: (-1, 1)}


@pytest.mark.parametrize(("number", "signs"), QUARTERS.items())
def test_a_quarter_term_is_xy_in_its_quarter_and_zero_outside(number: int, signs: tuple[int, int]) -> None:
    drawn = np.random.default_rng(4).uniform(1.0, 80.0, (30, 2))
    for quarter in QUARTERS.values():
        xy = drawn * quarter
        expected = -np.prod(xy, axis=1) if quarter == signs else np.zeros(30)
        for odd in (0, 1):
            found = correction(number + odd, xy.tolist(), DMC)
            np.testing.assert_allclose(found[:, odd], expected, rtol=1e-12)
            np.testing.assert_array_equal(found[:, 1 - odd], 0.0)


@pytest.mark.parametrize("axis", [0, 1])
def test_quarter_terms_are_continuous_across_the_axes(axis: int) -> None:
    along = np.linspace(-0.9, 0.9, 50) * (DMC.half_y, DMC.half_x)[axis]
    on_axis = np.zeros((50, 2))
    on_axis[:, 1 - axis] = along
    step = np.eye(2)[axis] * 1e-9
    names = tuple(str(number) for number in range(34, 42))
    ahead, behind = (bluh.SET.basis(on_axis + sign * step, DMC, names) for sign in (1.0, -1.0))
    np.testing.assert_array_equal(bluh.SET.basis(on_axis, DMC, names), 0.0)
    # |xy| of 1 nm by 80 mm is 1.4e-4 in normalised mm² at the most.
    assert np.abs(ahead - behind).max() < 1e-3 * normalised_millimetre(DMC)


def test_common_perspective_of_the_heads_is_the_mirrored_sum_of_the_quarter_terms() -> None:
    xy = np.random.default_rng(8).uniform(-1.0, 1.0, (50, 2)) * [DMC.half_x, DMC.half_y]
    names = tuple(str(number) for number in range(34, 42))
    mirrored = bluh.SET.basis(xy, DMC, names) @ [1.0, 1.0, -1.0, -1.0, -1.0, -1.0, 1.0, 1.0]
    signs_y = bluh.SET.basis(xy, DMC, names) @ [0.0, 1.0, 0.0, 1.0, 0.0, -1.0, 0.0, -1.0]
    common = bluh.SET.basis(xy, DMC, ("79",))[:, :, 0]
    np.testing.assert_allclose(common[:, 0], mirrored[:, 0], rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(common[:, 1], signs_y[:, 1], rtol=1e-12, atol=1e-18)


def test_head_terms_are_about_the_centres_of_the_heads() -> None:
    """±22.54 mm, ±38.9 mm in the virtual image of the DMC."""
    centre = np.array([[22.54, 38.9], [22.54, -38.9], [-22.54, -38.9], [-22.54, 38.9]]) * MILLIMETRE
    for name in ("31", "32", "33", "80"):
        np.testing.assert_allclose(bluh.SET.basis(centre, DMC, (name,)), 0.0, atol=1e-12)
    moved = bluh.SET.basis(centre, DMC, ("29", "30"))
    unit = normalised_millimetre(DMC)
    np.testing.assert_allclose(moved[:, 0, 0], -unit * np.sign(centre[:, 0]))
    np.testing.assert_allclose(moved[:, 1, 1], -unit * np.sign(centre[:, 1]))


@pytest.mark.parametrize("signs", QUARTERS.values())
def test_heads_are_scaled_turned_and_stretched_about_their_centres(signs: tuple[int, int]) -> None:
    """In neighbouring heads the rotation has opposite signs, scale and affinity have the same."""
    centre = np.array(signs) * [22.54, 38.9] * MILLIMETRE
    from_centre = u, v = np.array([3.0, -7.0]) * MILLIMETRE
    basis = bluh.SET.basis((centre + from_centre)[None], DMC, ("31", "32", "33"))[0]
    mirrored = signs[0] * signs[1]
    expected = np.array([[-u, -v], [mirrored * v, -mirrored * u], [-u, v]])
    np.testing.assert_allclose(basis.T, expected, rtol=1e-12)


def test_the_radial_term_of_the_heads_vanishes_at_half_their_largest_radius() -> None:
    # The corner of the format is farthest from the centre of the head: 23.54 mm, 44.044 mm.
    corner = np.array([46.08 - 22.54, 82.944 - 38.9]) * MILLIMETRE
    centre = np.array([22.54, 38.9]) * MILLIMETRE
    zero, inside, outside = (centre + part * corner for part in (0.5, 0.4, 0.6))
    basis = bluh.SET.basis(np.array([zero, inside, outside]), DMC, ("80",))[:, :, 0]
    np.testing.assert_allclose(basis[0], 0.0, atol=1e-12)
    assert basis[1] @ corner > 0.0 > basis[2] @ corner


@pytest.mark.parametrize(
    ("number", "signs", "axis"),
    [
        (81, (1, 1), 0),
        (82, (1, 1), 1),
        (83, (1, -1), 0),
        (84, (1, -1), 1),
        (85, (-1, -1), 0),
        (86, (-1, -1), 1),
        (87, (-1, 1), 0),
        (88, (-1, 1), 1),
    ],
)
def test_a_corner_term_is_the_displacement_of_its_corner_outwards(
    number: int, signs: tuple[int, int], axis: int
) -> None:
    corner = np.array(signs) * [UCE.half_x, UCE.half_y]
    xy = np.array(
        [corner, 0.5 * corner, corner * [1, 0], corner * [0, 1], corner * [-1, 1], corner * [1, -1]]
    )
    image_error = -bluh.SET.basis(xy, UCE, (str(number),))[:, :, 0]
    expected = np.array([1.0, 0.25**2, 0.0, 0.0, 0.0, 0.0]) * MILLIMETRE * signs[axis]
    np.testing.assert_allclose(image_error[:, axis], expected, atol=1e-18)
    np.testing.assert_array_equal(image_error[:, 1 - axis], 0.0)


def exterior_orientation_columns(xy: Floats, focal_length: float) -> Floats:
    """Effect (2 n, 6) of the exterior orientation of a vertical image over flat ground."""
    x, y = xy.T / focal_length
    one, nothing = np.ones_like(x), np.zeros_like(x)
    vectors = (
        *((one, nothing), (nothing, one), (x, y), (-y, x)),
        *((1.0 + x * x, x * y), (x * y, 1.0 + y * y)),
    )
    return np.stack([np.stack(vector, axis=1) for vector in vectors], axis=2).reshape(-1, 6)


def uniform_points(image_format: ImageFormat) -> Floats:
    u, v = np.meshgrid(np.linspace(-1.0, 1.0, 60), np.linspace(-1.0, 1.0, 60))
    return np.stack([u.ravel() * image_format.half_x, v.ravel() * image_format.half_y], axis=1)


def test_general_tile_and_corner_terms_are_independent_of_each_other_and_of_the_exterior_orientation() -> (
    None
):
    xy = uniform_points(UCE)
    parameters = additional_parameters("bluh12+uc+corner", UCE)
    columns = np.hstack([parameters.basis(xy).reshape(-1, 52), exterior_orientation_columns(xy, 0.08)])
    singular = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), compute_uv=False)
    assert np.sum(singular > 1e-10 * singular[0]) == 58
    assert singular[0] / singular[-1] == pytest.approx(270.0, abs=1.0)


@pytest.mark.parametrize(("number", "share"), [(5, 0.94), (6, 0.97), (8, 0.59)])
def test_the_exterior_orientation_of_one_image_absorbs_most_of_some_terms(number: int, share: float) -> None:
    xy = uniform_points(UCE)
    column = bluh.SET.basis(xy, UCE, (str(number),)).ravel()
    orientation = exterior_orientation_columns(xy, 0.08)
    remainder = column - orientation @ np.linalg.lstsq(orientation, column, rcond=None)[0]
    assert 1.0 - np.sum(remainder**2) / np.sum(column**2) == pytest.approx(share, abs=0.01)


def test_no_two_general_terms_are_highly_correlated_over_a_uniform_grid() -> None:
    columns = additional_parameters("bluh12", UCE).basis(uniform_points(UCE)).reshape(-1, 12)
    columns /= np.linalg.norm(columns, axis=0)
    cofactor = np.linalg.inv(columns.T @ columns)
    correlation = cofactor / np.sqrt(np.outer(np.diag(cofactor), np.diag(cofactor)))
    assert np.abs(correlation - np.eye(12)).max() < 0.8


def test_what_is_published_and_what_is_reconstructed_is_said() -> None:
    published = {term.name for term in bluh.SET.terms if term.status == "published"}
    assert published == {str(number) for number in (*range(1, 13), *range(34, 42))}
    numbers = [int(term.name) for term in bluh.SET.terms]
    assert numbers == [*range(1, 13), *range(29, 74), *range(79, 89)]
