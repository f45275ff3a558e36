"""The trust map of rigs: against dense matrices, and cameras that stand alone."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.arrays import Floats, Ints
from adjust.parameters import BORESIGHT, EXTERIOR_ORIENTATION, INTERIOR_ORIENTATION, OBJECT_POINT
from adjust.result import AdjustmentResult, ObservationStatus
from adjust.rig import RELATIVE_ROTATION, SYNCHRONISATION_OFFSET
from adjust.simulate.block import SimulatedBlock
from adjust.solve.design_matrix import design_matrix, full_cofactor, full_normals
from adjust.trust_map.accuracy import (
    CellAccuracy,
    JointSolution,
    NewMeasurement,
    cell_accuracy,
    joint_solution,
    new_rays,
)
from adjust.trust_map.block_errors import block_errors
from adjust.trust_map.cells import GroundCells, Sight, sight_of
from adjust.trust_map.ray_errors import images_around
from tests.adjust.rig_flights import flown, penta
from tests.adjust.scenes import two_strips
from tests.adjust.test_rigs import every_image_an_event
from tests.adjust.trust_map.grids import cells_over

MEASURED = NewMeasurement(1.5e-6, 1.2)
FREE = (BORESIGHT, RELATIVE_ROTATION, SYNCHRONISATION_OFFSET, INTERIOR_ORIENTATION)


class Mapped:
    """A penta camera's adjusted flight, cells on the ground, and their accuracy."""

    def __init__(self) -> None:
        self.simulated: SimulatedBlock = flown(penta(lines=3, exposures=5, points=120, late=2e-3))
        self.block = self.simulated.block(FREE)
        self.observations = self.simulated.observations(self.block)
        self.result: AdjustmentResult = adjust_block(self.block, self.observations)
        self.cells: GroundCells = cells_over(self.simulated.true_state().object_point, 9, 7)
        self.sight: Sight = sight_of(self.block, self.result.state, self.cells.x_in_local)
        self.solution: JointSolution = joint_solution(self.result, self.sight)
        self.accuracy: CellAccuracy = cell_accuracy(self.solution, self.cells, self.sight, MEASURED)
        normal, _ = full_normals(design_matrix(self.result.system, self.result.state))
        self.unknowns = 6 * len(self.block.events) + self.result.system.layout.border
        self.covariance = MEASURED.sigma0**2 * np.linalg.inv(normal)[: self.unknowns, : self.unknowns]

    def images_of(self, cell: int) -> Ints:
        return self.sight.image[self.sight.start[cell] : self.sight.start[cell + 1]]

    def moved(self, cell: int, images: Ints) -> tuple[Floats, Floats]:
        """Covariance (3, 3) by the image coordinates alone, and F (3, u)."""
        state = replace(self.result.state, object_point=self.cells.x_in_local[[cell]])
        none = np.zeros(len(images), dtype=np.int64)
        rays = new_rays(self.observations.image_points, state, images, none, MEASURED.sigma)
        of_point = np.zeros((len(images), 2, 3))
        of_rest = np.zeros((len(images), 2, self.unknowns))
        for term in rays.linearize(state).terms:
            if term.block == OBJECT_POINT:
                of_point = term.jacobian / MEASURED.sigma
                continue
            for k, (entity, jacobian) in enumerate(zip(term.index, term.jacobian, strict=True)):
                if term.block == EXTERIOR_ORIENTATION:
                    of_rest[k][:, 6 * entity : 6 * entity + 6] += jacobian / MEASURED.sigma
                    continue
                for component, column in enumerate(self.block.layout.columns[term.block][entity]):
                    if column >= 0:
                        own = 6 * len(self.block.events) + column
                        of_rest[k][:, own] += jacobian[:, component] / MEASURED.sigma
        a = of_point.reshape(-1, 3)
        inverse = np.linalg.inv(a.T @ a)
        return inverse, inverse @ a.T @ of_rest.reshape(-1, self.unknowns)

    def sigma_of(self, cell: int, images: Ints) -> Floats:
        own, moved = self.moved(cell, images)
        return np.sqrt(np.diagonal(own + moved @ self.covariance @ moved.T))


@pytest.fixture(scope="module")
def mapped() -> Mapped:
    return Mapped()


def test_all_rays_have_the_joint_covariance_of_events_and_heads(mapped: Mapped) -> None:
    chosen = np.flatnonzero(mapped.sight.rays >= 3)
    heads = {len(np.unique(mapped.block.camera_of_image[mapped.images_of(cell)])) for cell in chosen}
    assert len(chosen) > 20
    assert {3, 4} <= heads
    for cell in chosen:
        expected = mapped.sigma_of(cell, mapped.images_of(cell))
        np.testing.assert_allclose(mapped.accuracy.sigma[cell], expected, rtol=1e-6)


def test_the_best_pair_is_of_two_pictures_of_any_heads(mapped: Mapped) -> None:
    for cell in np.flatnonzero(mapped.sight.rays >= 3)[::4]:
        pairs = [mapped.sigma_of(cell, np.array(pair)) for pair in combinations(mapped.images_of(cell), 2)]
        best = min(pairs, key=lambda sigma: float(sigma[2]))
        np.testing.assert_allclose(mapped.accuracy.sigma_of_pair[cell], best, rtol=1e-6)


def test_differences_of_neighbours_are_those_of_their_common_pictures(mapped: Mapped) -> None:
    compared = 0
    for cell in np.flatnonzero(mapped.cells.neighbour >= 0):
        beside = int(mapped.cells.neighbour[cell])
        common = np.intersect1d(mapped.images_of(cell), mapped.images_of(beside))
        if len(common) < 3:
            continue
        (one, f_one), (other, f_other) = (mapped.moved(place, common) for place in (cell, beside))
        f = f_one - f_other
        expected = np.sqrt(np.diagonal(one + other + f @ mapped.covariance @ f.T))
        np.testing.assert_allclose(mapped.accuracy.sigma_relative[cell], expected, rtol=1e-6)
        compared += 1
    assert compared > 10


def test_undetected_errors_move_points_by_their_part_in_the_adjustment(mapped: Mapped) -> None:
    """∇X = F Q Aᵀ P e ∇ of every observation, with all matrices in full."""
    chosen = np.flatnonzero(mapped.sight.rays >= 4)[::2]
    found = block_errors(mapped.solution, mapped.result, mapped.cells, mapped.sight, chosen)
    design = design_matrix(mapped.result.system, mapped.result.state)
    cofactors = full_cofactor(design)[:, : mapped.unknowns]
    events = mapped.sight.only(chosen).of_events(mapped.block.event_of_image)
    around = images_around(events, mapped.solution.pattern)
    groups = mapped.result.system.observations.groups
    for k, cell in enumerate(chosen):
        _, moved = mapped.moved(int(cell), mapped.images_of(int(cell)))
        gains = design.matrix @ (cofactors @ moved.T)
        largest = []
        for number, (group, tested) in enumerate(zip(groups, mapped.result.groups, strict=True)):
            rows = slice(design.row_start[number], design.row_start[number + 1])
            own = gains[rows].reshape(-1, len(group.components), 3)
            own = np.swapaxes(group.stochastic.whitener, 1, 2) @ own
            used = tested.status == ObservationStatus.USED
            if number == 0:
                used = used & np.isin(group.event, around.only(np.array([k])).image)[:, None]
            effect = np.abs(own) * np.where(used, np.nan_to_num(tested.detectable), 0.0)[:, :, None]
            largest.append(effect.max(axis=(0, 1)))
        np.testing.assert_allclose(found.of_rays[k], largest[0], rtol=1e-5)
        np.testing.assert_allclose(found.of_orientation[k], np.max(largest[1:], axis=0), rtol=1e-5)
    assert len(chosen) > 5


def test_one_head_alone_has_the_trust_map_of_the_single_camera() -> None:
    scene = two_strips(cameras=2, flights=2, free={INTERIOR_ORIENTATION: True}, control=("full",) * 3)
    maps = []
    for one in (scene, every_image_an_event(scene)):
        result = adjust_block(one.block, one.observations)
        cells = cells_over(scene.truth.object_point, 7, 6)
        sight = sight_of(one.block, result.state, cells.x_in_local)
        solution = joint_solution(result, sight)
        accuracy = cell_accuracy(solution, cells, sight, MEASURED)
        errors = block_errors(solution, result, cells, sight, np.flatnonzero(sight.rays >= 3)[::3])
        maps.append((accuracy, errors))
    (alone, errors), (rig, same) = maps
    for name in ("sigma", "sigma_of_pair", "sigma_relative", "external", "uncontrolled", "rays"):
        np.testing.assert_allclose(getattr(rig, name), getattr(alone, name), rtol=1e-9, err_msg=name)
    np.testing.assert_allclose(same.of_orientation, errors.of_orientation, rtol=1e-9)
    np.testing.assert_allclose(same.of_rays, errors.of_rays, rtol=1e-9)
    assert np.isfinite(alone.sigma).any()
