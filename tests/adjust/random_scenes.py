"""Small blocks in which the features of the adjustment meet at random."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Bools, Floats
from adjust.block import Block
from adjust.observations.base import ObservationGroup, StochasticModel
from adjust.observations.control_point import ControlPoints
from adjust.observations.direct import DirectObservations
from adjust.observations.distance import Distances
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.image_point import ImagePoints
from adjust.observations.ins_attitude import InsAttitudes
from adjust.observations.joint_prior import JointPrior
from adjust.options import AdjustmentOptions
from adjust.parameters import ADDITIONAL_PARAMETERS, ConsideredParameters, ParameterPlace, SystemParameters
from adjust.rig import OF_HEADS
from adjust.solve.system import Observations
from tests.adjust.scenes import DEGREE, Scene, two_strips

#: What is known beforehand of the parameters of each family, SI and radians; of additional parameters µm.
SIGMA = {
    "interior_orientation": 2e-5, "boresight": 0.01 * DEGREE, "lever_arm": 0.05, "gnss_shift": 0.1,
    "gnss_strip_bias": 0.05, "gnss_drift": 0.005, "ins_strip_bias": 0.01 * DEGREE, "ins_drift": 1e-3 * DEGREE,
    "time_offset": 1e-3, "relative_position": 5e-3, "relative_rotation": 0.01 * DEGREE,
    "synchronisation_offset": 2e-4, ADDITIONAL_PARAMETERS: 1.0,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Drawn:
    """A block, its observations, and how it is adjusted."""

    block: Block
    observations: Observations
    options: AdjustmentOptions


class _Dice:
    """Random numbers of one block."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)

    def chance(self, probability: float) -> bool:
        return bool(self.random.random() < probability)

    def mask(self, probability: float, *shape: int) -> Bools:
        return self.random.random(shape) < probability

    def one_of(self, *values: object) -> object:
        return values[int(self.random.integers(len(values)))]

    def covariance(self, places: tuple[ParameterPlace, ...]) -> Floats:
        """A full one of so many parameters, of some size."""
        k = len(places)
        root = self.random.normal(size=(k, k))
        matrix = root @ root.T + k * np.eye(k)
        size = [SIGMA[place.family] for place in places] * self.random.uniform(0.3, 2.0, k)
        scale = size / np.sqrt(np.diagonal(matrix))
        return np.asarray(matrix * np.outer(scale, scale))

    def some(self, places: list[ParameterPlace], least: int, most: int) -> tuple[ParameterPlace, ...]:
        count = int(self.random.integers(least, min(len(places), most) + 1))
        return tuple(places[k] for k in self.random.permutation(len(places))[:count])


def drawn(seed: int, all_known: bool = False) -> Drawn:
    """The block of a seed.

    Parameters
    ----------
    all_known : whether every free parameter is observed directly, too.
    """
    dice = _Dice(seed)
    scene = _scene(dice)
    block, rays, others = scene.block, scene.observations.image_points, list(scene.observations.others)
    if block.rig is not None and dice.chance(0.5):
        block, rays = _without_pictures(dice, block, rays)
    rays = _few_rays(dice, rays, len(block.points))
    if rays.self_calibration is not None and len(block.flights) == 2 and dice.chance(0.5):
        block, rays = _of_flights(block, rays)
    others = [_weighted(dice, group) for group in others]
    others += [
        _known(dice, item, all_known)
        for item in block.system
        if item.free.any() and (all_known or dice.chance(0.7))
    ]
    free, held = _places(block)
    if len(free) >= 2 and dice.chance(0.4):
        others.append(_known_together(dice, block, dice.some(free, 2, 7)))
    if held and dice.chance(0.5):
        places = dice.some(held, 1, 8)
        block = replace(block, considered=ConsideredParameters(places, dice.covariance(places)))
    order = dice.random.permutation(len(others))
    return Drawn(block, Observations(rays, tuple(others[k] for k in order)), _options(dice, scene))


def _scene(dice: _Dice) -> Scene:
    strips, heads = int(dice.random.integers(1, 4)), int(dice.random.choice([1, 1, 1, 2, 3]))
    additional = dice.chance(0.6)
    switches = {
        "strips": min(strips, 2) if heads == 3 else strips,
        "images_per_strip": 3 if heads == 3 or strips == 3 else 4,
        "heads": heads,
        "cameras": dice.one_of(1, 2),
        "flights": dice.one_of(1, 2) if strips > 1 else 1,
        "frame": dice.one_of("cartesian", "topocentric"),
        "points_along": 7,
        "points_across": 5,
        "headings_deg": dice.one_of((90.0, 270.0), (90.0, 91.0, 0.0)),
        "synchronised": dice.chance(0.5),
        "turning": dice.chance(0.5),
        "gnss": dice.chance(0.8),
        "ins": dice.chance(0.8),
        "additional": additional,
        "forward": additional and heads == 1 and dice.chance(0.3),
        "distances": dice.one_of(0, 0, 2, 4),
        "gnss_correlation_s": dice.one_of(None, 8.0, 30.0),
        "ins_correlation_s": dice.one_of(None, 8.0, 30.0),
        "control": tuple(
            dice.one_of("full", "plan", "height", "covariance")
            for _ in range(dice.random.choice([0, 1, 3, 4, 5, 6]))
        ),
        "noise_seed": int(dice.random.integers(1 << 30)),
        "start_seed": int(dice.random.integers(1 << 30)),
    }
    free = {
        item.family.name: dice.mask(float(dice.random.choice([0.5, 1.0])), *item.values.shape)
        for item in two_strips(**{**switches, "control": ()}).block.system
        if dice.chance(0.45)
    }
    return two_strips(**switches, free=free)


def _options(dice: _Dice, scene: Scene) -> AdjustmentOptions:
    weak = not scene.plan.gnss and len(scene.plan.control) < 3
    return AdjustmentOptions(
        threads=1,
        control_folds=dice.one_of(None, 2, 3),  # type: ignore[arg-type]
        critical_value=dice.one_of(None, 2.5, 3.29),  # type: ignore[arg-type]
        test=dice.one_of("components", "observations"),  # type: ignore[arg-type]
        free_network=dice.one_of("object_points", "projection_centres", "both")  # type: ignore[arg-type]
        if weak or dice.chance(0.15)
        else None,
    )


def _without_pictures(dice: _Dice, block: Block, rays: ImagePoints) -> tuple[Block, ImagePoints]:
    """Some pictures of the heads are missing; perhaps all of the first one, which is a platform then."""
    assert block.rig is not None
    keep = dice.mask(0.85, len(block.images))
    if dice.chance(0.3):
        keep &= block.camera_of_image != 0
    last = np.flatnonzero(np.diff(block.event_of_image, append=-1))
    keep[last] |= ~np.bincount(block.event_of_image, weights=keep).astype(bool)
    rig = replace(
        block.rig, event_of_image=block.event_of_image[keep], camera_of_image=block.camera_of_image[keep]
    )
    number, few = np.cumsum(keep) - 1, rays.only(np.flatnonzero(keep[rays.image]))
    model = rays.self_calibration
    if model is not None:
        model = replace(model, entity_of_image=model.entity_of_image[keep])
    left = replace(
        block,
        images=tuple(np.array(block.images)[keep]),
        camera_of_image=block.camera_of_image[keep],
        flight_of_image=block.flight_of_image[keep],
        rig=rig,
    )
    return left, replace(
        few,
        image=number[few.image],
        camera_of_image=left.camera_of_image,
        self_calibration=model,
        event_of_image=rig.event_of_image,
    )


def _few_rays(dice: _Dice, rays: ImagePoints, points: int) -> ImagePoints:
    """Two or three rays for some points, other weights, rejected rays, corrected image coordinates."""
    kept = np.ones(len(rays.image), dtype=bool)
    for point in np.flatnonzero(dice.mask(0.3, points)):
        kept[dice.random.permutation(np.flatnonzero(rays.point == point))[dice.random.integers(2, 4) :]] = (
            False
        )
    rays = rays.only(np.flatnonzero(kept))
    n = len(rays.image)
    if dice.chance(0.6):
        rays = rays.rescaled(dice.random.uniform(0.6, 2.0, (n, 2)))
    if dice.chance(0.3):
        rays = replace(rays, offset=dice.random.normal(0.0, 1e-6, (n, 2)))
    return rays.without(dice.mask(0.05, n)) if dice.chance(0.4) else rays


def _of_flights(block: Block, rays: ImagePoints) -> tuple[Block, ImagePoints]:
    """Additional parameters of every camera in each of the two flights."""
    model, cameras = rays.self_calibration, len(block.cameras)
    assert model is not None
    model = replace(
        model,
        corrections=2 * model.corrections,
        distortions=2 * model.distortions,
        entity_of_image=model.entity_of_image + cameras * block.flight_of_image,
    )
    flights = tuple(flight for flight in block.flights for _ in range(cameras))
    system = (
        item
        if item.family.name != ADDITIONAL_PARAMETERS
        else replace(
            item,
            entities=2 * item.entities,
            values=np.tile(item.values, (2, 1)),
            free=np.tile(item.free, (2, 1)),
            flights=flights,
        )
        for item in block.system
    )
    return replace(block, system=tuple(system)), replace(rays, self_calibration=model)


def _weighted(dice: _Dice, group: ObservationGroup) -> ObservationGroup:
    """Correlated or missing components, other weights, rejected observations."""
    model, n = group.stochastic, len(group.event)
    if isinstance(group, GnssPositions | InsAttitudes):
        if dice.chance(0.4):
            root = model.sigma[:, :, None] * (np.tril(dice.random.uniform(-0.5, 0.5, (n, 3, 3))) + np.eye(3))
            whole = StochasticModel.from_covariance(root @ np.swapaxes(root, 1, 2), model.present)
            model = replace(whole, over_time=model.over_time)
        if model.over_time is None and dice.chance(0.4):
            root = model.unwhitener
            model = StochasticModel.from_covariance(root @ np.swapaxes(root, 1, 2), dice.mask(0.8, n, 3))
        if dice.chance(0.2):
            model = replace(model.rescaled(np.full((n, 1), np.sqrt(2.0))), share=np.full(n, 0.5))
        group = replace(group, stochastic=model)
    if isinstance(group, GnssPositions | InsAttitudes | ControlPoints) and dice.chance(0.3):
        group = group.rescaled(dice.random.uniform(0.5, 2.0, (n, 1)))
    if isinstance(group, GnssPositions | InsAttitudes | ControlPoints | Distances) and dice.chance(0.35):
        group = group.without(dice.mask(0.25, n))
    return group


def _known(dice: _Dice, parameters: SystemParameters, every: bool) -> DirectObservations:
    """Direct observations of the parameters of a family, or of some of them."""
    sigma = SIGMA[parameters.family.name] * dice.random.uniform(0.3, 3.0, parameters.values.shape)
    given = parameters.values + dice.random.normal(0.0, sigma)
    observed = parameters.free if every else dice.mask(0.8, *sigma.shape)
    model = StochasticModel.from_sigma(np.where(observed, sigma, np.nan))
    return DirectObservations(parameters.family, np.arange(len(given)), given, model)


def _places(block: Block) -> tuple[list[ParameterPlace], list[ParameterPlace]]:
    """The free parameters, and those that are held and could be considered."""
    free, held = list[ParameterPlace](), list[ParameterPlace]()
    for item in block.system:
        for (entity, component), is_free in np.ndenumerate(item.free):
            of_heads = block.rig is not None and item.family.name in OF_HEADS
            if not (of_heads and block.rig.is_reference[entity]):
                (free if is_free else held).append(ParameterPlace(item.family.name, entity, component))
    return free, held


def _known_together(dice: _Dice, block: Block, places: tuple[ParameterPlace, ...]) -> JointPrior:
    values = {item.family.name: item.values for item in block.system}
    covariance = dice.covariance(places)
    given = np.array([[values[family][entity, component] for family, entity, component in places]])
    given = given + np.linalg.cholesky(covariance) @ dice.random.normal(size=len(places))
    model = StochasticModel.from_covariance(covariance[None], np.ones(given.shape, dtype=bool))
    names = tuple(f"p{k}" for k in range(len(places)))
    return JointPrior("camera", names, ("1",) * len(places), places, given, model)
