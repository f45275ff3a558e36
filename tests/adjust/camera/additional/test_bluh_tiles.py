"""The terms of the tiles of an UltraCam image, and where the tiles meet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.camera.additional import bluh
from adjust.camera.additional.base import ImageFormat, Perspective, Tiles
from adjust.camera.additional.bluh_general import normalised_millimetre
from adjust.camera.additional.bluh_tiles import tiles_of
from adjust.camera.additional.register import additional_parameters
from adjust.errors import AdditionalParametersError

UCE = ImageFormat(34.008e-3, 52.026e-3)
SEAMS_X, SEAMS_Y = (-11.004e-3, 11.004e-3), (-17.013e-3, 17.013e-3)
OUTER = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))


def tile_of(xy: Floats, seams_x: tuple[float, float], seams_y: tuple[float, float]) -> Floats:
    """Place (n, 2) of the tile of each point, −1, 0 or 1 in each direction."""
    return np.stack([np.searchsorted(seams_x, xy[:, 0]) - 1, np.searchsorted(seams_y, xy[:, 1]) - 1], axis=1)


def middle(place: tuple[int, int]) -> Floats:
    """Middle of a tile of the UCE: half way from seam to seam, or from seam to edge."""
    return np.array(place) * [(11.004e-3 + UCE.half_x) / 2, (17.013e-3 + UCE.half_y) / 2]


def anywhere(count: int = 600) -> Floats:
    return np.random.default_rng(9).uniform(-1.0, 1.0, (count, 2)) * [UCE.half_x, UCE.half_y]


def column(number: int, xy: Floats, image_format: ImageFormat = UCE) -> Floats:
    return bluh.SET.basis(xy, image_format, (str(number),))[:, :, 0]


@pytest.mark.parametrize(
    ("sides_mm", "seams_mm"),
    [
        # By their own CCDs of 2672 × 4008 and 3328 × 4992 pixels, UCD and UCX have 10.863, 16.857 and 10.966,
        # 16.988: less than two pixels beside these.
        ((67.5, 103.5), (10.875, 16.875)),
        ((67.824, 103.896), (10.956, 16.974)),
        ((68.016, 104.052), (11.004, 17.013)),
        ((68.016, 105.84), (11.004, 17.46)),
    ],
)
def test_seams_lie_in_the_middle_of_the_overlap_of_the_ccds(
    sides_mm: tuple[float, float], seams_mm: tuple[float, float]
) -> None:
    tiles = tiles_of(ImageFormat(*(0.5e-3 * side for side in sides_mm)))
    np.testing.assert_allclose(tiles.seams_x, np.array([-1.0, 1.0]) * seams_mm[0] * 1e-3, atol=1e-6)
    np.testing.assert_allclose(tiles.seams_y, np.array([-1.0, 1.0]) * seams_mm[1] * 1e-3, atol=1e-6)
    # CCDs of 24 mm and 36 mm, the outer ones at the edge: the seam is as far inside either of two neighbours.
    for side, ccd, seam in zip(sides_mm, (24.0, 36.0), seams_mm, strict=True):
        assert ccd / 2 - seam == pytest.approx(seam - (side / 2 - ccd), abs=2e-3)


@pytest.mark.parametrize("index", range(8))
def test_a_tile_has_its_own_scale_and_shifts_and_none_of_the_others(index: int) -> None:
    xy, unit = anywhere(), normalised_millimetre(UCE)
    inside = np.all(tile_of(xy, SEAMS_X, SEAMS_Y) == OUTER[index], axis=1)
    assert 20 < inside.sum() < 200
    expected = np.where(inside[:, None], 1.0, 0.0)
    np.testing.assert_allclose(
        column(42 + index, xy), -(xy - middle(OUTER[index])) * expected, atol=1e-17, rtol=1e-12
    )
    np.testing.assert_allclose(column(50 + index, xy), -unit * expected * [1.0, 0.0])
    np.testing.assert_allclose(column(58 + index, xy), -unit * expected * [0.0, 1.0])


@pytest.mark.parametrize("k", range(4))
def test_a_tile_of_the_master_cone_has_two_terms_of_perspective(k: int) -> None:
    xy, unit = anywhere(), normalised_millimetre(UCE)
    corner = ((-1, -1), (-1, 1), (1, -1), (1, 1))[k]
    inside = np.all(tile_of(xy, SEAMS_X, SEAMS_Y) == corner, axis=1)
    u, v = np.where(inside[:, None], xy - middle(corner), 0.0).T / unit
    for number, expected in ((66 + 2 * k, (u * u, u * v)), (67 + 2 * k, (u * v, v * v))):
        np.testing.assert_allclose(column(number, xy), -unit * np.stack(expected, axis=1), atol=1e-15)


@pytest.mark.parametrize("index", range(8))
def test_other_forms_of_perspective_are_chosen_by_the_tiles(index: int) -> None:
    xy, unit = anywhere(), normalised_millimetre(UCE)
    inside = np.all(tile_of(xy, SEAMS_X, SEAMS_Y) == OUTER[index], axis=1)
    u, v = np.where(inside[:, None], xy - middle(OUTER[index]), 0.0).T / unit
    forms: dict[Perspective, tuple[Floats, Floats]] = {"outer8": (-u * v, -u * v), "rotation8": (v, -u)}
    for perspective, expected in forms.items():
        turned = replace(UCE, tiles=Tiles(SEAMS_X, SEAMS_Y, perspective=perspective))
        np.testing.assert_allclose(
            column(66 + index, xy, turned), unit * np.stack(expected, axis=1), atol=1e-15
        )


def test_units_and_meanings_follow_the_form_of_perspective() -> None:
    def terms(perspective: Perspective) -> list[tuple[str, str]]:
        image_format = replace(UCE, tiles=Tiles(SEAMS_X, SEAMS_Y, perspective=perspective))
        chosen = additional_parameters("bluh:66,73", image_format)
        return [(term.meaning, term.unit) for _, term in chosen.terms]

    assert terms("master4") == [
        ("perspective in x, rear right tile", "1/mm"),
        ("perspective in y, front left tile", "1/mm"),
    ]
    assert terms("outer8")[0] == ("perspective, rear right tile", "1/mm")
    assert terms("rotation8")[1] == ("rotation, front left tile", "1")


def test_nothing_of_the_tiles_moves_the_central_one() -> None:
    xy = anywhere()
    central = np.all(tile_of(xy, SEAMS_X, SEAMS_Y) == 0, axis=1)
    basis = additional_parameters("uc", UCE).basis(xy)
    assert np.all(basis[central] == 0.0)
    assert np.all(np.any(basis[~central] != 0.0, axis=(1, 2)))


def test_a_point_on_a_seam_belongs_to_the_tile_nearer_the_centre() -> None:
    tiles = tiles_of(UCE)
    xy = np.array([[x, y] for x in tiles.seams_x for y in tiles.seams_y])
    np.testing.assert_array_equal(additional_parameters("uc", UCE).basis(xy), 0.0)


def test_seams_of_the_format_replace_the_default() -> None:
    tiles = Tiles((-5e-3, 20e-3), (-30e-3, 10e-3))
    xy = anywhere()
    front_left = np.all(tile_of(xy, (-5e-3, 20e-3), (-30e-3, 10e-3)) == (1, 1), axis=1)
    moved = column(57, xy, replace(UCE, tiles=tiles))[:, 0] != 0.0
    np.testing.assert_array_equal(moved, front_left)


def test_a_blend_mixes_neighbours_linearly_over_its_width() -> None:
    width = 2e-3
    blended = replace(UCE, tiles=Tiles(SEAMS_X, SEAMS_Y, width))
    unit = normalised_millimetre(UCE)
    for part, share in ((-0.6, 0.0), (-0.5, 0.0), (-0.25, 0.25), (0.0, 0.5), (0.25, 0.75), (0.5, 1.0)):
        xy = np.array([[SEAMS_X[1] + part * width, 1e-3]])
        # 56: shift in x of the front tile
        np.testing.assert_allclose(column(56, xy, blended)[0, 0], -unit * share, atol=1e-15)


def test_shares_of_all_tiles_sum_to_one_wherever_they_are_blended() -> None:
    blended = replace(UCE, tiles=Tiles(SEAMS_X, SEAMS_Y, 2e-3))
    names = tuple(str(number) for number in range(50, 58))
    shares = bluh.SET.basis(anywhere(), blended, names)[:, 0].sum(axis=1) / -normalised_millimetre(UCE)
    half = 1e-3
    central = np.all(np.abs(anywhere()) < np.array([SEAMS_X[1], SEAMS_Y[1]]) - half, axis=1)
    outside = np.any(np.abs(anywhere()) > np.array([SEAMS_X[1], SEAMS_Y[1]]) + half, axis=1)
    np.testing.assert_allclose(shares[central], 0.0, atol=1e-15)
    np.testing.assert_allclose(shares[outside], 1.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("image_format", "message"),
    [
        (
            ImageFormat(52.026e-3, 34.008e-3),
            r"do not make up an image of 104.052 mm along × 68.016 mm across",
        ),
        (ImageFormat(46.08e-3, 82.944e-3), "do not make up an image"),
        (ImageFormat(11e-3, 17e-3), "do not make up an image"),
        (replace(UCE, tiles=Tiles((0.0,), SEAMS_Y)), r"two ascending seams across x .* have \[0.0\] mm"),
        (replace(UCE, tiles=Tiles(SEAMS_X, (17e-3, -17e-3))), "two ascending seams across y"),
        (replace(UCE, tiles=Tiles((-11e-3, 36e-3), SEAMS_Y)), r"inside the image, ±34.008 mm"),
    ],
)
def test_tiles_that_do_not_fit_the_image_are_refused_when_selected(
    image_format: ImageFormat, message: str
) -> None:
    with pytest.raises(AdditionalParametersError, match=message):
        additional_parameters("uc", image_format)
    # Other terms do not ask for tiles.
    assert additional_parameters("bluh12+corner", image_format).names
