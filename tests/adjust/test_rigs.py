"""Rigs: heads that take the pictures of an event together, against cameras that stand alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.arrays import Floats, Ints
from adjust.block import Block
from adjust.errors import DatumDefectError, InconsistentBlockError
from adjust.geometry import rotation
from adjust.observations.base import StochasticModel
from adjust.observations.direct import DirectObservations
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.ins_attitude import InsAttitudes
from adjust.options import AdjustmentOptions
from adjust.parameters import (
    BORESIGHT,
    FAMILIES,
    INS_STRIP_BIAS,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    ConsideredParameters,
    ParameterPlace,
    State,
    SystemParameters,
)
from adjust.quality.cofactor import cofactor
from adjust.quality.picture_cofactor import cofactors_between_pictures, picture_cofactors
from adjust.result import AdjustmentResult
from adjust.result_columns import sigma_of_images
from adjust.rig import OF_HEADS, RELATIVE_POSITION, RELATIVE_ROTATION, SYNCHRONISATION_OFFSET, Rig
from adjust.solve.design_matrix import design_matrix, full_cofactor
from adjust.solve.gauss_newton import solution_at
from adjust.solve.system import Observations, System
from tests.adjust.scenes import ALL_FREE, Scene, two_strips, with_cameras_in_order

HEADS_FREE: Mapping[str, object] = {RELATIVE_ROTATION: True, RELATIVE_POSITION: True}


def heads_at_zero(entities: tuple[str, ...]) -> tuple[SystemParameters, ...]:
    """Positions and rotations of heads that sit where their reference head sits, held."""
    families = [FAMILIES[name] for name in OF_HEADS]
    zeros = [np.zeros((len(entities), len(family.components))) for family in families]
    return tuple(
        SystemParameters(family, entities, nothing, nothing != 0.0)
        for family, nothing in zip(families, zeros, strict=True)
    )


def every_image_an_event(scene: Scene) -> Scene:
    """The same block as rigs of one head each."""
    block, rays = scene.block, scene.observations.image_points
    names = tuple(camera.name for camera in block.cameras)
    rig = Rig(
        block.images,
        np.arange(len(block.images)),
        block.camera_of_image,
        np.arange(len(names)),
        np.stack([camera.body_from_camera for camera in block.cameras]),
    )
    return replace(
        scene,
        block=replace(block, rig=rig, system=(*block.system, *heads_at_zero(names))),
        observations=replace(
            scene.observations, image_points=replace(rays, event_of_image=rig.event_of_image)
        ),
    )


def assert_same_results(one: AdjustmentResult, other: AdjustmentResult, tolerance: float) -> None:
    """Unknowns, their cofactors and the redundancy numbers, relative to the size of each."""
    for name in ("projection_centre", "local_from_camera", "object_point"):
        np.testing.assert_allclose(getattr(one.state, name), getattr(other.state, name), rtol=tolerance)
    for ours, theirs in (
        (one.cofactor.reduced.blocks, other.cofactor.reduced.blocks),
        (one.cofactor.reduced.corner, other.cofactor.reduced.corner),
        (one.cofactor.of_points, other.cofactor.of_points),
    ):
        np.testing.assert_allclose(ours, theirs, atol=tolerance * np.nanmax(np.abs(theirs)))
    for group, same in zip(one.groups, other.groups, strict=True):
        np.testing.assert_allclose(group.redundancy, same.redundancy, atol=tolerance)
    assert one.test.sigma0 == pytest.approx(other.test.sigma0, rel=tolerance)


def test_a_rig_of_one_head_is_the_camera_alone() -> None:
    scene = two_strips(cameras=2, flights=2, free=ALL_FREE, noise_seed=21, start_seed=22)
    rig = every_image_an_event(scene)
    alone = adjust_block(scene.block, scene.observations)
    assert_same_results(adjust_block(rig.block, rig.observations), alone, 1e-12)


def with_all_rays_twice(scene: Scene) -> tuple[Scene, Scene]:
    """One head that measures every point twice, and two heads in one place that measure it once each."""
    block, rays = scene.block, scene.observations.image_points
    n, r = len(block.images), len(rays.image)
    twice = np.repeat(np.arange(r), 2)
    again = rays.xy[twice] + np.random.default_rng(5).normal(0.0, 2e-6, (2 * r, 2))
    doubled = replace(
        rays,
        image=rays.image[twice],
        point=rays.point[twice],
        xy=again,
        sigma=rays.sigma[twice],
        active=rays.active[twice],
    )
    (camera,) = block.cameras
    cameras = (camera, replace(camera, name="again"))
    names = tuple(one.name for one in cameras)
    rig = Rig(
        tuple(f"event {k}" for k in range(n)),
        np.repeat(np.arange(n), 2),
        np.tile([0, 1], n),
        np.zeros(2, dtype=np.int64),
        np.stack([one.body_from_camera for one in cameras]),
    )
    system = tuple(
        replace(
            one,
            entities=names,
            values=np.repeat(one.values, 2, axis=0),
            free=np.concatenate([one.free, np.zeros_like(one.free)]),
        )
        if one.family.entity_kind == "camera"
        else one
        for one in block.system
    )
    two = replace(
        block,
        images=tuple(f"{image} {name}" for image in block.images for name in names),
        cameras=cameras,
        camera_of_image=rig.camera_of_image,
        flight_of_image=np.repeat(block.flight_of_image, 2),
        system=system + heads_at_zero(names),
        rig=rig,
    )
    of_heads = replace(
        doubled,
        image=2 * doubled.image + np.tile([0, 1], r),
        camera_of_image=rig.camera_of_image,
        event_of_image=rig.event_of_image,
    )
    return tuple(  # type: ignore[return-value]
        replace(scene, block=which, observations=replace(scene.observations, image_points=points))
        for which, points in ((block, doubled), (two, of_heads))
    )


def test_two_heads_in_one_place_are_one_head_that_measures_twice() -> None:
    one, two = with_all_rays_twice(two_strips(free={BORESIGHT: True}, noise_seed=21, start_seed=22))
    results = [adjust_block(scene.block, scene.observations) for scene in (two, one)]
    assert_same_results(*results, 1e-10)


def with_other_order_of_heads(scene: Scene, order: Ints) -> Scene:
    """The same block with its cameras in another order: new camera k is the old one order[k]."""
    block, rays = scene.block, scene.observations.image_points
    rig, new = block.rig, np.argsort(order)
    assert rig is not None
    # The pictures of an event, too, in another order.
    place = np.lexsort((new[rig.camera_of_image], rig.event_of_image))
    to = np.argsort(place)
    camera_of_image = new[rig.camera_of_image[place]]
    other = Rig(
        rig.events,
        rig.event_of_image[place],
        camera_of_image,
        new[rig.reference[order]],
        rig.body_from_camera[order],
        rig.motion,
    )
    system = with_cameras_in_order(block.system, order)
    rows = np.lexsort((to[rays.image], rays.point))
    moved = replace(
        rays.only(rows),
        image=to[rays.image[rows]],
        camera_of_image=camera_of_image,
        event_of_image=other.event_of_image,
    )
    groups = tuple(
        replace(group, camera=new[group.camera]) if isinstance(group, GnssPositions | InsAttitudes) else group
        for group in scene.observations.others
    )
    permuted = replace(
        block,
        images=tuple(block.images[k] for k in place),
        cameras=tuple(block.cameras[k] for k in order),
        camera_of_image=camera_of_image,
        flight_of_image=block.flight_of_image[place],
        system=system,
        rig=other,
    )
    return replace(scene, block=permuted, observations=Observations(moved, groups))


def test_the_order_of_the_heads_changes_nothing() -> None:
    scene = two_strips(
        heads=3,
        free={BORESIGHT: True, RELATIVE_ROTATION: True, INTERIOR_ORIENTATION: True},
        noise_seed=21,
        start_seed=22,
    )
    order = np.array([2, 0, 1])
    permuted = with_other_order_of_heads(scene, order)
    given, other = (adjust_block(one.block, one.observations) for one in (scene, permuted))
    for name in ("projection_centre", "local_from_camera", "object_point"):
        ours, theirs = getattr(other.state, name), getattr(given.state, name)
        np.testing.assert_allclose(ours, theirs, atol=1e-9 * np.abs(theirs).max())
    for family, values in given.state.system.items():
        expected = values[order] if FAMILIES[family].entity_kind == "camera" else values
        np.testing.assert_allclose(other.state.system[family], expected, atol=1e-10)
    scale = np.abs(given.cofactor.reduced.blocks).max(axis=0)
    difference = other.cofactor.reduced.blocks - given.cofactor.reduced.blocks
    assert np.all(np.abs(difference) < 1e-9 * scale)


def test_poses_of_pictures_have_the_derivatives_of_central_differences() -> None:
    scene = two_strips(cameras=2, heads=3, synchronised=False, noise_seed=1)
    state = scene.truth
    of_event, of_head = state.pictures.jacobians()
    assert state.rig is not None
    event, camera = state.rig.event_of_image, state.rig.camera_of_image

    def difference(after: State, before: State, step: float) -> Floats:
        ahead, behind = after.pictures, before.pictures
        turned = np.swapaxes(behind.local_from_camera, 1, 2) @ ahead.local_from_camera
        moved = ahead.projection_centre - behind.projection_centre
        return np.concatenate([moved, rotation.log(turned)], axis=1) / (2.0 * step)

    step = 1e-4
    for k in range(6):
        unit = np.eye(6)[k] * step
        n = len(state.projection_centre)
        both = []
        for sign in (1.0, -1.0):
            turn = rotation.exp(np.tile(sign * unit[3:], (n, 1)))
            centre = state.projection_centre + sign * unit[:3]
            moved = replace(state, projection_centre=centre, local_from_camera=state.local_from_camera @ turn)
            both.append(moved)
        np.testing.assert_allclose(difference(*both, step), of_event[:, :, k], atol=1e-8)
    components = [(family, k) for family in OF_HEADS for k in range(len(FAMILIES[family].components))]
    for column, (family, k) in enumerate(components):
        both = []
        for sign in (1.0, -1.0):
            values = state.system[family].copy()
            values[:, k] += sign * step
            both.append(replace(state, system={**state.system, family: values}))
        size = max(1.0, np.abs(of_head[:, :, column]).max())
        np.testing.assert_allclose(difference(*both, step), of_head[:, :, column], atol=1e-8 * size)
    assert len(event) == len(camera) == len(of_event)


def defect_of(scene: Scene) -> int:
    """Directions that no observation notices, from the singular values of the full design matrix."""
    system = System.of(scene.block, scene.observations)
    matrix = design_matrix(system, scene.block.approximate_state()).matrix.toarray()
    length = np.linalg.norm(matrix, axis=0)
    sizes = np.linalg.svd(matrix / np.where(length > 0.0, length, 1.0), compute_uv=False)
    return int(np.sum(sizes < 1e-9 * sizes[0]))


@pytest.mark.parametrize(
    ("gnss", "ins", "free", "defect"),
    [
        # The body is the inertial unit.
        (True, True, {BORESIGHT: True, RELATIVE_ROTATION: True}, 0),
        # Without attitudes it is the reference head.
        (True, False, {RELATIVE_ROTATION: True}, 0),
        # Turning about the known lever arm moves no antenna.
        (True, False, {BORESIGHT: True, **HEADS_FREE}, 1),
        # Nothing knows the body.
        (False, False, {BORESIGHT: True, **HEADS_FREE}, 3),
        (False, False, {BORESIGHT: True, LEVER_ARM: True, **HEADS_FREE}, 6),
        # With the reference head held there is a place that the lever arm counts from.
        (True, True, {BORESIGHT: True, LEVER_ARM: True, **HEADS_FREE}, 0),
        (True, False, {BORESIGHT: True, LEVER_ARM: True, **HEADS_FREE}, 3),
    ],
)
def test_defects_are_those_of_the_gauge(
    gnss: bool, ins: bool, free: Mapping[str, object], defect: int
) -> None:
    scene = two_strips(heads=3, control=("full",) * 4, gnss=gnss, ins=ins, free=free, noise_seed=3)
    assert defect_of(scene) == defect
    if defect:
        with pytest.raises(DatumDefectError) as error:
            adjust_block(scene.block, scene.observations)
        assert error.value.defect == defect


@pytest.mark.parametrize("family", OF_HEADS)
def test_a_reference_head_cannot_be_free(family: str) -> None:
    """Known positions of the heads would hide the rotation defect behind pivots that look sound."""
    scene = two_strips(heads=2)
    system = tuple(
        replace(one, free=np.ones_like(one.free)) if one.family.name == family else one
        for one in scene.block.system
    )
    with pytest.raises(InconsistentBlockError, match=f"{family} of a reference head"):
        replace(scene.block, system=system)


def _other_rig(block: Block, **changes: Ints) -> Block:
    assert block.rig is not None
    return replace(block, rig=replace(block.rig, **changes))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"event_of_image": np.repeat(np.arange(9), [2] * 8 + [4])}, "every event an image"),
        (
            {"event_of_image": np.repeat(np.arange(10), 2)[[0, 2, 1, *range(3, 20)]]},
            "two images of one head",
        ),
        ({"camera_of_image": np.zeros(20, dtype=np.int64)}, "not the cameras of the block"),
        ({"reference": np.array([0, 1])}, "of different rigs"),
        ({"reference": np.array([0])}, "not the cameras of the block"),
    ],
)
def test_a_rig_that_contradicts_itself_is_refused(changes: dict[str, Ints], message: str) -> None:
    with pytest.raises(InconsistentBlockError, match=message):
        _other_rig(two_strips(heads=2).block, **changes)


def test_image_points_must_know_the_events() -> None:
    scene = two_strips(heads=2)
    rays = replace(scene.observations.image_points, event_of_image=None)
    with pytest.raises(InconsistentBlockError, match="do not contain the event"):
        System.of(scene.block, replace(scene.observations, image_points=rays))


def test_a_point_that_several_heads_see_at_one_event_only_takes_no_part() -> None:
    scene = two_strips(heads=3, noise_seed=3)
    rays = scene.observations.image_points
    events = np.zeros((len(scene.block.points), 10), dtype=bool)
    events[rays.point, rays.event] = True
    control = scene.observations.others[0].point
    several = np.setdiff1d(np.flatnonzero(np.bincount(rays.point) > events.sum(axis=1)), control)
    chosen = several[0]
    seen_twice = next(
        event for event in range(10) if np.sum((rays.point == chosen) & (rays.event == event)) > 1
    )
    left = rays.without((rays.point == chosen) & (rays.event != seen_twice))
    system = System.of(scene.block, replace(scene.observations, image_points=left))
    assert not system.active_point[chosen]
    assert system.active_point.sum() == len(scene.block.points) - 1


def test_cofactors_of_pictures_are_those_of_the_full_inverse() -> None:
    """Six unknowns of the event and seven of the head, some of them held."""
    free = {
        RELATIVE_ROTATION: True,
        RELATIVE_POSITION: [[True, False, True]],
        SYNCHRONISATION_OFFSET: True,
        BORESIGHT: True,
    }
    scene = two_strips(
        heads=3, free=free, priors={RELATIVE_POSITION: 1e-3}, synchronised=False, noise_seed=21
    )
    system, state = System.of(scene.block, scene.observations), scene.block.approximate_state()
    solution = solution_at(system, state)
    quality = cofactor(system, solution)
    found = picture_cofactors(state, system.layout, quality, 1.0)
    design = design_matrix(system, state)
    full = full_cofactor(design)
    rig, (of_event, of_head) = scene.block.rig, state.pictures.jacobians()
    assert rig is not None
    own = np.concatenate([system.layout.columns[family] for family in OF_HEADS], axis=1)
    rows = []
    for event, camera, e, h in zip(rig.event_of_image, rig.camera_of_image, of_event, of_head, strict=True):
        row = np.zeros((6, len(full)))
        row[:, design.exposure_columns[event]] = e
        free_columns = own[camera] >= 0
        row[:, design.border_columns[own[camera][free_columns]]] = h[:, free_columns]
        rows.append(row)
    expected = np.concatenate(rows) @ full @ np.concatenate(rows).T
    root = np.sqrt(np.diagonal(expected))
    scaled = (expected / np.outer(root, root)).reshape(len(rows), 6, len(rows), 6)
    root = root.reshape(-1, 6)
    every = np.arange(len(rows))
    ours = found / (root[:, :, None] * root[:, None, :])
    np.testing.assert_allclose(ours, scaled[every, :, every], atol=1e-9)
    one, other = np.array([0, 1, 4, 7, 3]), np.array([1, 0, 2, 3, 8])
    between = cofactors_between_pictures(state, system.layout, quality, 1.0, one, other)
    ours = between / (root[one][:, :, None] * root[other][:, None, :])
    np.testing.assert_allclose(ours, scaled[one, :, other], atol=1e-9)


@pytest.mark.parametrize(
    ("place", "sigma"), [((RELATIVE_POSITION, 1, 1), 0.05), ((RELATIVE_ROTATION, 1, 0), 1e-3)], ids=str
)
def test_the_error_of_a_considered_mounting_moves_the_pictures_of_the_head(
    place: tuple[str, int, int], sigma: float
) -> None:
    """Their poses are compared with those of adjustments with other mountings."""
    family, head, component = place
    scene = two_strips(heads=2, noise_seed=3)
    block = scene.block
    considered = ConsideredParameters((ParameterPlace(*place),), np.array([[sigma**2]]))
    known, held = (
        adjust_block(replace(block, considered=one), scene.observations) for one in (considered, None)
    )
    poses = []
    for step in (sigma, -sigma):
        values = {item.family.name: item.values.copy() for item in block.system}
        values[family][head, component] += step
        system = tuple(replace(item, values=values[item.family.name]) for item in block.system)
        poses.append(adjust_block(replace(block, system=system), scene.observations).state.pictures)
    one, other = poses
    turned = rotation.log(np.swapaxes(other.local_from_camera, 1, 2) @ one.local_from_camera)
    moved = np.hstack([one.projection_centre - other.projection_centre, turned]) / 2.0
    added = sigma_of_images(known) ** 2 - sigma_of_images(held) ** 2
    own = block.camera_of_image == head
    assert (np.abs(moved[own]).max(axis=0) > 0.5 * np.abs(moved[~own]).max(axis=0)).all()
    np.testing.assert_allclose(added / (moved**2).max(axis=0), moved**2 / (moved**2).max(axis=0), atol=1e-3)


@pytest.mark.parametrize(("free", "defect"), [({}, 6), ({RELATIVE_POSITION: True}, 7)])
def test_known_positions_of_heads_are_the_scale_of_a_free_network(
    free: Mapping[str, object], defect: int
) -> None:
    """Tens of centimetres: a weak scale, but one that approximate values must not give a second time."""
    scene = two_strips(heads=3, control=(), gnss=False, ins=False, free=free, noise_seed=3)
    assert defect_of(scene) == defect
    options = AdjustmentOptions(critical_value=None, free_network="object_points")
    result = adjust_block(scene.block, scene.observations, options)
    assert result.free_network is not None
    assert result.free_network.defect == defect
    total = sum(group.redundancy_sum for group in result.groups)
    assert total == pytest.approx(result.test.redundancy, abs=1e-6)


def without_pictures_of_the_reference(scene: Scene) -> Scene:
    """The same block, of a platform that takes no pictures."""
    block, rays = scene.block, scene.observations.image_points
    assert block.rig is not None
    kept = block.camera_of_image != 0
    number = np.cumsum(kept) - 1
    rig = replace(
        block.rig, event_of_image=block.event_of_image[kept], camera_of_image=block.camera_of_image[kept]
    )
    left = rays.only(np.flatnonzero(kept[rays.image]))
    left = replace(
        left,
        image=number[left.image],
        camera_of_image=rig.camera_of_image,
        event_of_image=rig.event_of_image,
    )
    of_platform = replace(
        block,
        images=tuple(np.array(block.images)[kept]),
        camera_of_image=rig.camera_of_image,
        flight_of_image=block.flight_of_image[kept],
        rig=rig,
    )
    return replace(scene, block=of_platform, observations=replace(scene.observations, image_points=left))


def observed_rotations(scene: Scene, axes: Sequence[str]) -> Scene:
    """The same scene with priors of 1 mrad of some rotations: "1 xy" are roll and pitch of head 1."""
    sigma = np.full((len(scene.block.cameras), 3), np.nan)
    for of_head in axes:
        sigma[int(of_head[0]), ["xyz".index(axis) for axis in of_head[2:]]] = 1e-3
    rows = np.flatnonzero(np.isfinite(sigma).any(axis=1))
    given = scene.truth.system[RELATIVE_ROTATION][rows]
    prior = DirectObservations(
        FAMILIES[RELATIVE_ROTATION], rows, given, StochasticModel.from_sigma(sigma[rows])
    )
    others = (*scene.observations.others, *((prior,) if len(rows) else ()))
    return replace(scene, observations=replace(scene.observations, others=others))


ALL_TURN = {BORESIGHT: True, RELATIVE_ROTATION: True}
HEADS_TURN = {RELATIVE_ROTATION: True}


@pytest.mark.parametrize(
    ("ins", "free", "observed", "defect", "sentence"),
    [
        (True, ALL_TURN, (), 3, "are one and the same"),
        (False, HEADS_TURN, (), 3, "nothing observes its attitude"),
        # One angle of one head leaves two rotations, roll and pitch of all heads leave the yaw.
        (True, ALL_TURN, ("1 x",), 2, "are one and the same"),
        (True, ALL_TURN, ("1 z",), 2, "are one and the same"),
        (True, ALL_TURN, ("1 xy", "2 xy"), 1, "are one and the same"),
        (False, HEADS_TURN, ("1 xy", "2 xy"), 1, "nothing observes its attitude"),
        (True, ALL_TURN, ("1 xyz",), 0, ""),
        (True, ALL_TURN, ("1 x", "2 yz"), 0, ""),
        (False, HEADS_TURN, ("1 x", "2 yz"), 0, ""),
        # With the yaw of the boresight held, that of the heads is one of them alone.
        (True, {BORESIGHT: (True, True, False), **HEADS_TURN}, ("1 xy",), 0, ""),
        (True, HEADS_TURN, (), 0, ""),
        (True, {BORESIGHT: True}, (), 0, ""),
        # Free biases of all strips know no more of the attitude than no INS.
        (True, {INS_STRIP_BIAS: True, **HEADS_TURN}, (), 3, "its INS strip biases and a common rotation"),
        (True, {INS_STRIP_BIAS: (False, False, True), **HEADS_TURN}, (), 1, "its INS strip biases"),
        (True, {INS_STRIP_BIAS: True, **HEADS_TURN}, ("1 xyz",), 0, ""),
        (True, {INS_STRIP_BIAS: [[True], [False]], **HEADS_TURN}, (), 0, ""),
        (True, {INS_STRIP_BIAS: [[True], [False]], **ALL_TURN}, (), 3, "its boresight and a common"),
    ],
)
def test_a_platform_without_pictures_does_not_turn_against_all_its_heads(
    ins: bool, free: Mapping[str, object], observed: Sequence[str], defect: int, sentence: str
) -> None:
    """The known positions of the heads determine it to a degree: the adjustment did not converge."""
    scene = observed_rotations(
        without_pictures_of_the_reference(
            two_strips(heads=3, control=("full",) * 4, ins=ins, free=free, noise_seed=3, start_seed=4)
        ),
        observed,
    )
    if not defect:
        result = adjust_block(scene.block, scene.observations)
        corner = np.diagonal(result.cofactor.reduced.corner)
        assert np.sqrt(corner).max() < 2e-3
        return
    with pytest.raises(DatumDefectError, match=sentence) as error:
        adjust_block(scene.block, scene.observations)
    assert error.value.defect == defect
    named = error.value.parameters
    assert "relative_rotation_yaw of forward_2" in named
    own = "ins_strip_bias_yaw of strip_0" if "biases" in sentence else "boresight_yaw of forward"
    assert (own in named) is ins
    rolls = [item[0] for item in observed if "x" in item]
    assert ("boresight_roll of forward" in named) is (ins and BORESIGHT in free and not rolls)
    assert not any(f"relative_rotation_roll of forward_{head}" in named for head in rolls)
