"""Arrays of a caller: taken in any order and by name, and refused in words where they do not fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from adjust import (
    FAMILIES,
    AdjustmentOptions,
    Block,
    ControlPoints,
    DatumDefectError,
    DirectObservations,
    Distances,
    GnssPositions,
    ImagePoints,
    InconsistentBlockError,
    InsAttitudes,
    Observations,
    StochasticModel,
    SystemParameters,
    UnknownNameError,
    adjust_block,
)
from adjust.observations.base import ObservationGroup
from tests.adjust.scenes import Scene, two_strips

SCENE = two_strips(noise_seed=1)
BLOCK, RAYS = SCENE.block, SCENE.observations.image_points


def group_of(kind: type[Any]) -> Any:
    return next(item for item in SCENE.observations.others if isinstance(item, kind))


CONTROL, GNSS, INS = group_of(ControlPoints), group_of(GnssPositions), group_of(InsAttitudes)


def adjusted(
    block: Block = BLOCK, rays: ImagePoints = RAYS, *others: ObservationGroup, **options: Any
) -> object:
    groups = others or SCENE.observations.others
    return adjust_block(block, Observations(rays, groups), AdjustmentOptions(**options))


def test_rows_in_any_order_by_name_are_the_observations_of_the_block() -> None:
    # Of an object point, rays stay in the order in which they come.
    order = np.argsort(np.random.default_rng(2).permutation(len(BLOCK.points))[RAYS.point], kind="stable")
    images = [BLOCK.images[k] for k in RAYS.image[order]]
    points = [BLOCK.points[k] for k in RAYS.point[order]]
    rays = ImagePoints.measured(BLOCK, images, points, RAYS.xy[order], RAYS.sigma[order])
    gnss = GnssPositions.measured(BLOCK, BLOCK.images, GNSS.observed, (0.1, 0.1, 0.2))
    ins = InsAttitudes.measured(BLOCK, np.arange(len(BLOCK.images)), INS.observed, 1e-4)
    for made, known, names in (
        (rays, RAYS, ("image", "point", "camera_of_image", "xy", "sigma", "active")),
        (gnss, GNSS, ("event", "camera", "flight", "observed", "local_from_enu", "body_from_camera")),
        (ins, INS, ("event", "camera", "observed", "body_from_camera")),
    ):
        for name in names:
            np.testing.assert_allclose(getattr(made, name), getattr(known, name), atol=1e-7)
    np.testing.assert_array_equal(gnss.stochastic.sigma[-1], (0.1, 0.1, 0.2))


def test_attitudes_of_cameras_are_not_taken_for_those_of_bodies() -> None:
    with pytest.raises(InconsistentBlockError, match=r"turned by 180° \(median\).*body_from_camera\.T"):
        InsAttitudes.measured(BLOCK, BLOCK.images, BLOCK.local_from_camera, 1e-4)
    body = BLOCK.local_from_camera @ np.swapaxes(BLOCK.body_from_camera, 1, 2)
    assert len(InsAttitudes.measured(BLOCK, BLOCK.images, body, 1e-4).event) == len(BLOCK.images)


def test_points_known_in_plan_or_height_only_say_nothing_of_the_rest() -> None:
    points, true = np.array([3, 4, 5]), BLOCK.object_point[[3, 4, 5]]
    given = true + 5.0 * BLOCK.frame.local_from_enu(true)[:, :, 2]
    given[2, :2] += 0.1
    sigma = np.array([[0.01, 0.01, np.nan], [0.01, 0.01, 0.02], [np.nan, np.nan, 0.02]])
    control = ControlPoints.surveyed(BLOCK, points, given, sigma)
    np.testing.assert_array_equal(control.stochastic.present, np.isfinite(sigma))
    found = control.linearize(BLOCK.approximate_state()).misclosure
    np.testing.assert_allclose(found[:2], [[0.0, 0.0, 0.0], [0.0, 0.0, 5.0]], atol=1e-9)
    np.testing.assert_allclose(found[2], [0.0, 0.0, 5.0], atol=1e-4)


def test_distances_and_known_parameters_are_given_by_name() -> None:
    points, others = [BLOCK.points[0], BLOCK.points[7]], [BLOCK.points[3], BLOCK.points[3]]
    distances = Distances.measured(BLOCK, points, others, [210.0, 95.5], sigma=[0.01, 0.02])
    np.testing.assert_array_equal(distances.point, [0, 7])
    np.testing.assert_array_equal(distances.other_point, [3, 3])
    np.testing.assert_array_equal(distances.given, [210.0, 95.5])
    np.testing.assert_array_equal(distances.stochastic.sigma, [[0.01], [0.02]])
    camera = BLOCK.cameras[0].name
    known = DirectObservations.known(BLOCK, "boresight", [camera], [[1e-3, 0.0, 0.0]], (1e-4, 1e-4, np.nan))
    assert known.family is FAMILIES["boresight"]
    np.testing.assert_array_equal(known.entity, [0])
    np.testing.assert_array_equal(known.given, [[1e-3, 0.0, 0.0]])
    np.testing.assert_array_equal(known.stochastic.sigma, [[1e-4, 1e-4, np.nan]])
    shift = DirectObservations.known(BLOCK, "gnss_shift", BLOCK.flights, np.zeros((1, 3)), 0.05)
    np.testing.assert_array_equal(shift.stochastic.sigma, [[0.05, 0.05, 0.05]])


def test_small_integers_and_numbers_of_32_bits_are_what_they_stand_for() -> None:
    small = replace(
        RAYS,
        image=RAYS.image.astype(np.uint8),
        point=RAYS.point.astype(np.int16),
        active=np.ones(len(RAYS.xy)),
    )
    assert (small.image.dtype, small.point.dtype, small.active.dtype) == (np.int64, np.int64, np.bool_)
    np.testing.assert_array_equal(small.inverse_sigma, RAYS.inverse_sigma)
    # Differences of unsigned integers are never negative.
    with pytest.raises(InconsistentBlockError, match="sorted by object point"):
        replace(RAYS, point=RAYS.point[::-1].astype(np.uint16))


BLOCKS: dict[str, tuple[Callable[[], object], str]] = {
    "camera": (
        lambda: replace(BLOCK, camera_of_image=BLOCK.camera_of_image + 1),
        "camera_of_image has an index",
    ),
    "flight": (
        lambda: replace(BLOCK, flight_of_image=BLOCK.flight_of_image - 9),
        "flight_of_image has an index",
    ),
    "no integers": (lambda: replace(BLOCK, camera_of_image=0.5 * BLOCK.camera_of_image), "must be integers"),
    "images of one name": (lambda: replace(BLOCK, images=("a",) * len(BLOCK.images)), "have the name 'a'"),
    "cameras of one name": (lambda: replace(BLOCK, cameras=BLOCK.cameras * 2), "Two of the cameras"),
    "stretched": (
        lambda: replace(BLOCK, local_from_camera=1.001 * BLOCK.local_from_camera),
        "not a rotation",
    ),
    "mirrored": (lambda: replace(BLOCK, local_from_camera=-BLOCK.local_from_camera), "not a rotation"),
}


@pytest.mark.parametrize(("make", "says"), BLOCKS.values(), ids=BLOCKS)
def test_a_block_that_does_not_fit_is_refused(make: Callable[[], object], says: str) -> None:
    with pytest.raises(InconsistentBlockError, match=says):
        make()


def without_value(group: Any, **values: Any) -> Any:
    """The group with its first value replaced."""
    ((name, value),) = values.items()
    changed = getattr(group, name).copy()
    changed[0] = value
    return replace(group, **{name: changed})


GROUPS: dict[str, tuple[Callable[[], object], str]] = {
    "σ for each observation": (lambda: replace(RAYS, sigma=RAYS.sigma[:, 0]), "sigma has the shape"),
    "too few coordinates": (lambda: replace(RAYS, xy=RAYS.xy[1:]), "has the shape"),
    "no integers": (lambda: replace(RAYS, image=RAYS.image + 0.0), "image must be integers, not float64"),
    "control": (lambda: replace(CONTROL, given=CONTROL.given[1:]), "control_points: given has the shape"),
    "control without place": (lambda: without_value(CONTROL, given=np.nan), "no finite value"),
    "control without height": (lambda: without_value(CONTROL, given_height=np.inf), "no finite value"),
    "positions": (lambda: replace(GNSS, observed=GNSS.observed[:1]), "gnss_positions: observed has"),
    "position": (
        lambda: without_value(GNSS, observed=np.nan),
        "Observation 0 of gnss_positions has a weight",
    ),
    "one mounting": (lambda: replace(GNSS, body_from_camera=np.eye(3)), "body_from_camera has the shape"),
    "attitude": (lambda: replace(INS, observed=2.0 * INS.observed), "no rotation matrix"),
    "one σ": (lambda: StochasticModel.from_sigma(np.full(3, 0.02)), "expected: observations, components"),
    "distance": (
        lambda: Distances(
            np.array([0]), np.array([1]), np.array([np.nan]), StochasticModel.from_sigma(np.ones((1, 1)))
        ),
        "Observation 0 of distances",
    ),
    "σ of three": (
        lambda: ImagePoints.measured(BLOCK, [0], [0], [[0.0, 0.0]], [1.0, 1.0, 1.0]),
        r"one, or \(1, 2\)",
    ),
    "images of other rows": (
        lambda: ImagePoints.measured(BLOCK, [0, 1], [0], [[0.0, 0.0]], 1.0),
        "array of images",
    ),
    "distances of other rows": (
        lambda: Distances.measured(BLOCK, [0, 1], [2], [1.0], 0.1),
        r"array of other ends has the shape \(1,\)",
    ),
    "distance of three": (lambda: Distances.measured(BLOCK, [0], [1], [[1.0]], 0.1), "array of distances"),
    "a value of three": (
        lambda: DirectObservations.known(BLOCK, "boresight", [0], [1e-3], 1e-4),
        "array of boresight",
    ),
    "one group": (lambda: Observations(RAYS, CONTROL), "a tuple of groups"),
    "one name for two points": (
        lambda: ImagePoints.measured(
            replace(BLOCK, points=("twice", "twice", *BLOCK.points[2:])), [0], ["twice"], [[0.0, 0.0]], 1e-6
        ),
        "Two of the object points have the name 'twice'",
    ),
}


@pytest.mark.parametrize(("make", "says"), GROUPS.values(), ids=GROUPS)
def test_observations_that_do_not_fit_are_refused(make: Callable[[], object], says: str) -> None:
    with pytest.raises(InconsistentBlockError, match=says):
        make()


def camera(**changes: Any) -> Block:
    """The block with another first camera."""
    return replace(BLOCK, cameras=(replace(BLOCK.cameras[0], **changes), *BLOCK.cameras[1:]))


ADJUSTMENTS: dict[str, tuple[Callable[[], object], str]] = {
    "pixels": (lambda: adjusted(rays=replace(RAYS, xy=RAYS.xy / 6e-6)), "image coordinates are in metres"),
    "millimetres": (
        lambda: adjusted(rays=replace(RAYS, xy=1e3 * RAYS.xy)),
        "image coordinates are in metres",
    ),
    "another camera": (
        lambda: adjusted(BLOCK, replace(RAYS, camera_of_image=RAYS.camera_of_image[1:])),
        "the same camera",
    ),
    "camera": (
        lambda: adjusted(BLOCK, RAYS, CONTROL, replace(GNSS, camera=GNSS.camera + 7)),
        "index of its camera",
    ),
    "flight": (
        lambda: adjusted(BLOCK, RAYS, CONTROL, replace(GNSS, flight=GNSS.flight + 7)),
        "index of its flight",
    ),
    "σ in pixels": (
        lambda: adjusted(rays=replace(RAYS, sigma=np.full_like(RAYS.xy, 0.25))),
        "standard deviations of all image coordinates are at least 0.25",
    ),
    "focal length in millimetres": (
        lambda: adjusted(camera(focal_length=1e3 * BLOCK.cameras[0].focal_length)),
        "focal length and pixel size are in metres",
    ),
    "pixels in micrometres": (
        lambda: adjusted(camera(pixel_size=1e6 * BLOCK.cameras[0].pixel_size)),
        "focal length and pixel size are in metres",
    ),
    "critical value": (lambda: adjusted(critical_value=-1.0), "critical_value = -1.0 is impossible"),
    "threads": (lambda: adjusted(threads=0), "threads = 0 is impossible"),
}


@pytest.mark.parametrize(("make", "says"), ADJUSTMENTS.values(), ids=ADJUSTMENTS)
def test_what_belongs_to_another_block_is_refused(make: Callable[[], object], says: str) -> None:
    with pytest.raises(InconsistentBlockError, match=says):
        make()


@pytest.mark.parametrize(
    ("entities", "values", "free", "says"),
    [
        (("camera",), np.zeros(3), np.ones((1, 3), dtype=bool), r"values of boresight has the shape \(3,\)"),
        (
            ("camera",),
            np.zeros((1, 3)),
            np.ones(3, dtype=bool),
            r"free parameters of boresight has the shape \(3,\)",
        ),
        (("camera",), np.full((1, 3), np.nan), np.ones((1, 3), dtype=bool), "finite"),
        (("other",), np.zeros((1, 3)), np.ones((1, 3), dtype=bool), "boresight belongs to other"),
        (
            ("camera", "other"),
            np.zeros((2, 3)),
            np.ones((2, 3), dtype=bool),
            "boresight belongs to camera, other",
        ),
    ],
)
def test_system_parameters_that_do_not_fit_are_refused(
    entities: tuple[str, ...], values: Any, free: Any, says: str
) -> None:
    others = tuple(given for given in BLOCK.system if given.family.name != "boresight")
    names = tuple(BLOCK.cameras[0].name if name == "camera" else name for name in entities)
    with pytest.raises(InconsistentBlockError, match=says.replace("camera", BLOCK.cameras[0].name)):
        replace(BLOCK, system=(*others, SystemParameters(FAMILIES["boresight"], names, values, free)))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"focal_length": -0.1}, "focal_length of camera .* is -0.1"),
        ({"columns": 0}, "columns of camera .* is 0"),
        ({"pixel_size": np.nan}, "pixel_size of camera .* is nan"),
        ({"principal_point": (0.0,)}, "not two lengths x0, y0"),
        ({"pixel_origin": "center"}, "is 'center', not one of 'corner', 'centre'"),
        ({"mount_deg": 45}, "is 45, not one of 0, 90, 180, 270"),
    ],
)
def test_cameras_that_do_not_exist_are_refused(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(InconsistentBlockError, match=says):
        camera(**changes)


def test_lists_of_values_and_of_free_parameters_are_arrays() -> None:
    names = tuple(item.name for item in BLOCK.cameras)
    given = SystemParameters(FAMILIES["boresight"], names, [[0, 0, 0]] * len(names), [[1, 0, 1]] * len(names))  # type: ignore[arg-type]
    assert given.values.dtype == np.float64
    assert given.free[0].tolist() == [True, False, True]


def test_system_parameters_of_no_family_and_blocks_without_flights_are_refused() -> None:
    with pytest.raises(InconsistentBlockError, match=r"is 'boresight', not a Family such as FAMILIES"):
        SystemParameters("boresight", (), np.zeros((0, 3)), np.zeros((0, 3), dtype=bool))  # type: ignore[arg-type]
    with pytest.raises(InconsistentBlockError, match="The block has no flights"):
        replace(BLOCK, flights=(), system=())
    with pytest.raises(InconsistentBlockError, match="The block has interior_orientation twice"):
        replace(BLOCK, system=(*BLOCK.system, BLOCK.system[0]))


@pytest.mark.parametrize("wrong", [RAYS, (RAYS, CONTROL), None])
def test_what_is_not_observations_is_refused_with_what_is(wrong: Any) -> None:
    with pytest.raises(TypeError, match="takes a Block, Observations and AdjustmentOptions, no"):
        adjust_block(BLOCK, wrong)


def test_a_name_that_does_not_exist_is_refused_with_those_that_do() -> None:
    with pytest.raises(UnknownNameError, match=r"no object point 'nowhere'\. There are: "):
        ImagePoints.measured(BLOCK, [BLOCK.images[0]], ["nowhere"], [[0.0, 0.0]], 1e-6)


def test_a_family_or_entity_that_does_not_exist_is_refused_with_those_that_do() -> None:
    with pytest.raises(UnknownNameError, match=r"no family of system parameters 'boresite'.*'boresight'"):
        DirectObservations.known(BLOCK, "boresite", [0], np.zeros((1, 3)), 0.1)
    with pytest.raises(UnknownNameError, match=r"no flight 'third'\. There are: "):
        DirectObservations.known(BLOCK, "gnss_shift", ["third"], np.zeros((1, 3)), 0.1)
    with pytest.raises(UnknownNameError, match="no object point 'nowhere'"):
        Distances.measured(BLOCK, [0], ["nowhere"], [1.0], 0.1)


def test_a_choice_that_does_not_exist_is_refused_with_a_similar_one() -> None:
    with pytest.raises(UnknownNameError, match="no choice of robust 'hubert'"):
        AdjustmentOptions(robust="hubert")  # type: ignore[arg-type]


def test_what_is_not_determined_is_said_once() -> None:
    nothing = replace(
        RAYS, **{name: getattr(RAYS, name)[:0] for name in ("image", "point", "xy", "sigma", "active")}
    )
    scene: Scene = SCENE
    with pytest.raises(DatumDefectError) as caught:
        adjust_block(scene.block, Observations(nothing, (CONTROL,)))
    sentences = str(caught.value).split(". ")
    assert len(sentences) == len(set(sentences)) <= 14
    assert "more like these" in str(caught.value)
