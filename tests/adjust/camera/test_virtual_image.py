"""Virtual images of four heads: composition, its derivatives, and what ground at another height does."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.register import additional_parameters
from adjust.camera.virtual_image import composed, composition_errors, covering_head, in_heads
from tests.adjust.platform_scenes import HALF_VIRTUAL, dmc_heads, virtual_grid

EACH = np.arange(4)
MICROMETRE = 1e-6
# Virtual quarter of each head: it looks across to the other side of the platform.
SIDE = np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]])


def test_every_head_looks_across_to_the_other_side() -> None:
    axes = composed(dmc_heads(), EACH, np.zeros((4, 2)), 1e9).xy * 1e3
    np.testing.assert_allclose(axes, [[-22.5, 38.9], [22.6, 38.9], [22.5, -39.0], [-22.6, -38.8]], atol=0.06)


def test_four_heads_fill_the_virtual_image_and_overlap_by_an_eighth() -> None:
    heads, grid = dmc_heads(), virtual_grid(161, 241)
    assert np.all(covering_head(heads, grid, 1000.0) >= 0)
    inside = [
        (np.abs(in_heads(heads, np.full(len(grid), head), grid, 1000.0)) <= heads.half_format[head]).all(
            axis=1
        )
        for head in EACH
    ]
    assert np.mean(np.sum(inside, axis=0) >= 2) == pytest.approx(0.122, abs=0.01)


def test_composition_is_collinearity_by_way_of_a_plane() -> None:
    heads, random = dmc_heads(), np.random.default_rng(4)
    ground = np.column_stack([random.uniform(-200.0, 200.0, (40, 2)), np.full(40, -1000.0)])
    head = random.integers(0, 4, 40)
    p = np.einsum("nji,nj->ni", heads.platform_from_head[head], ground - heads.position[head])
    xy = -0.120 * p[:, :2] / p[:, 2:]
    virtual = 0.120 * ground[:, :2] / 1000.0
    np.testing.assert_allclose(composed(heads, head, xy, 1000.0).xy, virtual, atol=1e-16)
    np.testing.assert_allclose(in_heads(heads, head, virtual, 1000.0), xy, atol=1e-16)


def test_derivatives_are_those_of_central_differences() -> None:
    heads, step = dmc_heads(), 1e-6
    xy = np.random.default_rng(5).uniform(-0.02, 0.02, (4, 2))
    found = composed(heads, EACH, xy, 800.0)

    def difference(ahead: Floats, behind: Floats) -> Floats:
        return (ahead - behind) / (2.0 * step)

    for axis in range(3):
        small = np.zeros((4, 3))
        small[:, axis] = step
        ahead, behind = (composed(heads.turned(sign * small), EACH, xy, 800.0).xy for sign in (1.0, -1.0))
        np.testing.assert_allclose(difference(ahead, behind), found.of_rotation[:, :, axis], atol=1e-10)
    for axis in range(2):
        moved = step * np.eye(2)[axis]
        ahead, behind = (composed(heads, EACH, xy + sign * moved, 800.0).xy for sign in (1.0, -1.0))
        np.testing.assert_allclose(difference(ahead, behind), found.of_point[:, :, axis], atol=1e-10)
    longer = np.full(4, step)
    ahead, behind = (composed(heads.longer(sign * longer), EACH, xy, 800.0).xy for sign in (1.0, -1.0))
    np.testing.assert_allclose(difference(ahead, behind), found.of_focal_length, atol=1e-10)


@pytest.mark.parametrize(
    ("height", "along", "across"),
    [(500.0, 7.7, 9.5), (800.0, 1.9, 2.4), (2000.0, 3.8, 4.7), (4000.0, 5.8, 7.1)],
)
def test_another_flying_height_opens_the_seams(height: float, along: float, across: float) -> None:
    """Composed for 1,000 m: f t (1/h − 1/Z) of each head, apart below it and towards each other above."""
    heads, grid = dmc_heads(), virtual_grid()
    error, head = composition_errors(heads, heads, grid, 1000.0, height)
    sign = 1.0 if height < 1000.0 else -1.0
    expected = sign * SIDE[head] * np.array([along, across]) * MICROMETRE
    np.testing.assert_allclose(error, expected, atol=0.06 * MICROMETRE)
    mended, _ = composition_errors(heads, heads, grid, height, height)
    np.testing.assert_allclose(mended, 0.0, atol=1e-15)


def explained(error: Floats, grid: Floats, names: str) -> float:
    """Part of the squares of a field that additional parameters follow."""
    image = ImageFormat(HALF_VIRTUAL[0], HALF_VIRTUAL[1], None, 0.120)
    basis = additional_parameters(names, image).basis(grid).reshape(-1, len(names.split("+")))
    basis = basis / np.linalg.norm(basis, axis=0)
    left = error.ravel() - basis @ np.linalg.lstsq(basis, error.ravel(), rcond=None)[0]
    return 1.0 - float(left @ left) / float(error.ravel() @ error.ravel())


SETS = "+".join(f"bluh:{number}" for number in (29, 30, 31, 32, 33, 79, 80))


@pytest.mark.parametrize(
    ("axis", "sign"),
    [(0, SIDE[:, 1]), (1, SIDE[:, 0]), (2, SIDE[:, 0] * SIDE[:, 1])],
    ids=["roll", "pitch", "yaw"],
)
def test_mirrored_rotations_of_the_heads_look_like_the_parameters_of_the_platform(
    axis: int, sign: Floats
) -> None:
    """4 mdeg; what is not mirrored has nothing of them."""
    heads, grid = dmc_heads(), virtual_grid()
    small = np.zeros((4, 3))
    small[:, axis] = np.deg2rad(4e-3) * sign
    error, _ = composition_errors(heads.turned(small), heads, grid, 1000.0, 1000.0)
    assert explained(error, grid, SETS) > 0.995
    small[:, axis] *= SIDE[:, 0] if axis != 1 else SIDE[:, 1]
    error, _ = composition_errors(heads.turned(small), heads, grid, 1000.0, 1000.0)
    assert explained(error, grid, SETS) < 0.01


def test_height_and_focal_length_look_like_heads_apart_and_their_scale() -> None:
    heads, grid = dmc_heads(), virtual_grid()
    error, _ = composition_errors(heads, heads, grid, 1000.0, 800.0)
    assert explained(error, grid, "bluh:29+bluh:30") > 0.995
    error, _ = composition_errors(heads.longer(np.full(4, 2e-6)), heads, grid, 1000.0, 1000.0)
    assert explained(error, grid, "bluh:31") > 0.985
