from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.rotation import exp
from adjust.simulate.block import simulate_block
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.terrain import TerrainShape
from adjust.simulate.trajectory import FlightVariation
from adjust.simulate.truth import BlockSpecification, block_truth
from adjust.simulate.visibility import ImageGeometry, visible_rays
from tests.adjust.simulate.specifications import CAMERA, small_specification

STEADY = FlightVariation((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)


def _every_ray(images: ImageGeometry, x_in_local: Floats) -> set[tuple[int, int]]:
    """The same by trying every point in every image."""
    found = set()
    for i, (centre, rotation) in enumerate(
        zip(images.projection_centre, images.local_from_camera, strict=True)
    ):
        for j, point in enumerate(x_in_local):
            p = rotation.T @ (point - centre)
            focal, x0, y0 = images.interior[i]
            x, y = x0 - focal * p[0] / p[2], y0 - focal * p[1] / p[2]
            if p[2] < 0.0 and abs(x) < images.half_format[i, 0] and abs(y) < images.half_format[i, 1]:
                found.add((i, j))
    return found


def test_exactly_the_points_inside_the_formats_are_seen() -> None:
    random = np.random.default_rng(8)
    n = 12
    images = ImageGeometry(
        np.column_stack([random.uniform(-800, 800, (n, 2)), random.uniform(900, 1100, n)]),
        exp(random.normal(0.0, 0.15, (n, 3))) @ exp(random.uniform(-3, 3, (n, 1)) * [0.0, 0.0, 1.0]),
        np.tile([0.08, 1e-3, -2e-3], (n, 1)),
        np.tile([0.027, 0.036], (n, 1)),
    )
    height = np.append(random.uniform(-100, 150, 600), random.uniform(1200, 2300, 200))
    # The last ones are above the cameras, behind their images.
    points = np.column_stack([random.uniform(-1500, 1500, (800, 2)), height])
    image, point = visible_rays(images, points)
    expected = _every_ray(images, points)
    assert len(expected) > 300
    assert set(zip(image.tolist(), point.tolist(), strict=True)) == expected
    assert len(image) == len(expected)


def test_sixty_per_cent_overlaps_show_every_inner_point_four_to_nine_times() -> None:
    specification = small_specification(
        flight=small_specification().flight[:1], terrain=TerrainShape(), variation=STEADY
    )
    group = specification.flight[0]
    lines = BlockSpecification(
        cameras=(CAMERA,),
        flight=(type(group)("A", "1", 0, 0.0, 1000.0, (12,) * 8, group.base, group.spacing),),
        points=PointSpecification(count=3000, margin=0.0),
        noise=specification.noise,
        variation=STEADY,
    )
    truth = block_truth(lines)
    rays = np.bincount(truth.point, minlength=len(truth.points))
    # Inside the first and last full overlap both ways.
    inner = np.abs(truth.state.object_point[:, :2]) < [2.5 * group.spacing, 4.0 * group.base]
    seen = rays[inner.all(axis=1)]
    assert seen.min() == 4
    assert seen.max() == 9
    # The format covers 2.5 bases and 2.5 line spacings.
    assert abs(seen.mean() - 6.25) < 0.15


def test_a_margin_keeps_the_borders_of_the_images_free() -> None:
    specification = small_specification(points=PointSpecification(count=400, margin=0.2))
    block = simulate_block(specification)
    part = np.abs(block.truth.xy) / CAMERA.half_format
    assert 0.75 < part.max() < 0.8 + 1e-6
