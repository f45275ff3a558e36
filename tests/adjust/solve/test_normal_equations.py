"""What the normal equations refuse, and who takes part in them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.errors import DatumDefectError, InconsistentBlockError
from adjust.observations.base import Linearization, Term
from adjust.parameters import LEVER_ARM, State
from adjust.solve.covisibility import covisibility
from adjust.solve.normal_equations import reduced_normals
from adjust.solve.system import System
from tests.adjust.scenes import Scene, two_strips


def without_rays_of(scene: Scene, point: int) -> Scene:
    rays = scene.observations.image_points
    left = rays.without(rays.point == point)
    return replace(scene, observations=replace(scene.observations, image_points=left))


@pytest.mark.parametrize("kind", ["full", "plan", "height"])
def test_what_remains_after_rejection_is_what_would_have_been_without_it(kind: str) -> None:
    scene = two_strips(noise_seed=1)
    point = int(scene.observations.others[0].point[scene.plan.control.index(kind)])
    fewer = without_rays_of(scene, point)
    fresh = System.of(fewer.block, fewer.observations)
    remaining = System.of(scene.block, scene.observations).remaining(fewer.observations)
    assert remaining.redundancy == fresh.redundancy
    assert remaining.active_point[point] == (kind == "full")
    state = scene.block.approximate_state()
    assert reduced_normals(remaining, state).weighted_squares == pytest.approx(
        reduced_normals(fresh, state).weighted_squares
    )


def test_redundancy_of_a_survey_without_rays_is_zero() -> None:
    scene = two_strips(noise_seed=1)
    row = scene.plan.control.index("full")
    fewer = without_rays_of(scene, int(scene.observations.others[0].point[row]))
    control = adjust_block(fewer.block, fewer.observations).groups[1]
    np.testing.assert_allclose(control.redundancy[row], 0.0, atol=1e-9)
    assert np.isnan(control.standardized[row]).all()
    np.testing.assert_allclose(control.residual[row], 0.0, atol=1e-6)


def test_two_rays_from_one_place_do_not_determine_a_point() -> None:
    scene = two_strips(noise_seed=1)
    rays = scene.observations.image_points
    counts = np.bincount(rays.point)
    point = int(np.flatnonzero(counts == 2)[-1])
    first, second = np.flatnonzero(rays.point == point)
    centre = scene.block.projection_centre.copy()
    centre[rays.image[second]] = centre[rays.image[first]]
    block = replace(scene.block, projection_centre=centre)
    with pytest.raises(DatumDefectError, match="its rays do not intersect") as caught:
        reduced_normals(System.of(block, scene.observations), block.approximate_state())
    assert caught.value.parameters[0].startswith("object point point_")


def test_rejected_rays_may_belong_to_a_camera_that_looks_away() -> None:
    scene = two_strips(noise_seed=1)
    rays, turned = scene.observations.image_points, scene.block.local_from_camera.copy()
    turned[3] = turned[3] @ np.diag([1.0, -1.0, -1.0])
    away = replace(scene.block, local_from_camera=turned)
    left = replace(scene.observations, image_points=rays.without(rays.image == 3))
    found, expected = (
        reduced_normals(System.of(block, left), block.approximate_state()) for block in (away, scene.block)
    )
    others = np.arange(10) != 3
    np.testing.assert_array_equal(found.rhs_exposure[others], expected.rhs_exposure[others])


@dataclass(frozen=True, eq=False)
class Connecting:
    """An observation type that would connect object points with system parameters."""

    group: Any

    def __post_init__(self) -> None:
        its = {name: getattr(self.group, name) for name in dir(self.group) if name[0] != "_"}
        self.__dict__.update({name: value for name, value in its.items() if name not in vars(Connecting)})

    def without(self, rejected: Any) -> Any:
        return replace(self, group=self.group.without(rejected))

    def linearize(self, state: State) -> Linearization:
        found = self.group.linearize(state)
        term = Term(
            LEVER_ARM, np.zeros(len(self.group.point), dtype=int), np.ones((len(self.group.point), 3, 3))
        )
        misclosure = found.misclosure - state.system[LEVER_ARM][0].sum()
        return replace(found, misclosure=misclosure, terms=(*found.terms, term))


def test_only_image_points_may_connect_object_points_with_other_unknowns() -> None:
    scene = two_strips(free={LEVER_ARM: True})
    control, *others = scene.observations.others
    observations = replace(scene.observations, others=(Connecting(control), *others))
    said = "control_points: its equations connect object points with lever_arm. Only image points may connect"
    with pytest.raises(InconsistentBlockError, match=said):
        System.of(scene.block, observations)


@pytest.mark.parametrize(("field", "value"), [("image", 10), ("image", -1), ("point", 100_000)])
def test_an_image_point_of_something_that_is_not_there_is_refused(field: str, value: int) -> None:
    scene = two_strips()
    rays = scene.observations.image_points
    index = getattr(rays, field).copy()
    index[-1] = value
    observations = replace(scene.observations, image_points=replace(rays, **{field: index}))
    with pytest.raises(InconsistentBlockError, match="image_points has an index"):
        System.of(scene.block, observations)


def test_a_position_of_an_image_that_is_not_there_is_refused() -> None:
    scene = two_strips()
    control, gnss, *others = scene.observations.others
    wrong: Any = gnss
    wrong = replace(wrong, event=wrong.event + 1)
    observations = replace(scene.observations, others=(control, wrong, *others))
    with pytest.raises(
        InconsistentBlockError, match=r"gnss_positions has an index of its image outside 0 … 9"
    ):
        System.of(scene.block, observations)


def test_image_points_must_know_the_camera_of_every_image() -> None:
    scene = two_strips()
    rays = replace(scene.observations.image_points, camera_of_image=np.zeros(9, dtype=int))
    with pytest.raises(InconsistentBlockError, match="camera of every image"):
        System.of(scene.block, replace(scene.observations, image_points=rays))


def test_the_pattern_has_every_pair_of_images_with_a_common_point_and_no_other() -> None:
    scene = two_strips(strips=3, images_per_strip=6, points_along=20, points_across=12)
    rays, n = scene.observations.image_points, len(scene.block.images)
    sees = np.zeros((n, len(scene.block.points)), dtype=bool)
    sees[rays.image, rays.point] = True
    common = (sees.astype(int) @ sees.T.astype(int)) > 0
    expected = {(i, j) for i, j in np.argwhere(common).tolist() if i <= j} | {(i, i) for i in range(n)}
    found = covisibility(rays, n, len(scene.block.points))
    pairs = list(zip(found.row.tolist(), found.column.tolist(), strict=True))
    assert pairs == sorted(expected)
    np.testing.assert_array_equal(found.column[found.diagonal], np.arange(n))
