"""A network with more strips and more control points than it has."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.geometry import rotation
from adjust.geometry.rotation import ENU_FROM_NED
from adjust.parameters import BORESIGHT, INTERIOR_ORIENTATION
from adjust.planning.network import PlannedControl, PlannedExposures, PlannedNetwork, PlannedRays
from adjust.rig import EventMotion, Rig
from adjust.simulate.survey import spread_order
from adjust.simulate.terrain import raised
from adjust.simulate.visibility import ImageGeometry, visible_rays

# Part of the half format along the borders in which nothing is measured.
_MARGIN = 0.02
_SEED = 20130903
# Where a point is to be surveyed several images must see it.
_LEAST_RAYS = 3
_SPEED = 75.0
_TURN = 180.0
_NO_CONTROL_SIGMA = 0.02


@dataclass(frozen=True, eq=False)
class AddedStrip:
    """A strip to be flown.

    Attributes
    ----------
    plan : (k, 2) metres, local frame, in the order of flight.
    heading : radians, clockwise from north.
    height : above the mean ground, metres.
    """

    plan: Floats
    heading: float
    height: float


def extended(network: PlannedNetwork, strips: tuple[AddedStrip, ...], control: int = 0) -> PlannedNetwork:
    """The network with strips flown level in addition, and with more control points.

    The additional images see the object points that are there, as often as the images there see theirs; their
    positions, attitudes and image points are as good as those are on average; they belong to the flight with
    most exposures and are taken with its camera, of a rig with all heads that take images.

    Parameters
    ----------
    control : number of object points, well spread, that are surveyed in addition.
    """
    wider = network
    if strips:
        added = _exposures(network, strips)
        names = tuple(f"added {number}" for number in range(1, len(strips) + 1))
        wider = replace(network, strips=network.strips + names, exposures=network.exposures.joined(added))
        if network.rig is not None:
            wider = replace(wider, rig=_with_events(network.rig, wider, len(added)))
        wider = replace(wider, rays=_joined(network.rays, _rays(network, wider)))
    return wider.with_control(_control(network, control)) if control else wider


def _exposures(network: PlannedNetwork, strips: tuple[AddedStrip, ...]) -> PlannedExposures:
    given = network.exposures
    count = [len(strip.plan) for strip in strips]
    n = sum(count)
    ground = float(np.median(network.ground))
    plan = np.concatenate([strip.plan for strip in strips])
    height = np.repeat([strip.height for strip in strips], count)
    heading = np.repeat([strip.heading for strip in strips], count)
    centre = raised(plan, ground + height, network.frame)
    flight = int(np.bincount(given.flight).argmax())
    camera = int(np.bincount(given.camera[given.flight == flight]).argmax())
    axes = np.asarray(network.frame.local_from_enu(centre))
    level = rotation.ned_from_body(np.stack([heading, np.zeros(n), np.zeros(n)], -1))
    misaligned = rotation.from_roll_pitch_yaw(network.system[BORESIGHT][camera : camera + 1])[0]
    in_body = misaligned @ network.cameras[camera].body_from_camera
    time, start = [], float(given.time.max()) + _TURN
    for strip in strips:
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(strip.plan, axis=0).T))])
        time.append(start + way / _SPEED)
        start = float(time[-1][-1]) + _TURN
    forward = np.stack([np.sin(heading), np.cos(heading), np.zeros(n)], -1)
    seen = given.attitude_observed
    covariance = given.attitude_covariance[seen].mean(axis=0) if seen.any() else np.eye(3)
    return PlannedExposures(
        np.full(n, camera, dtype=np.int64),
        np.full(n, flight, dtype=np.int64),
        np.repeat(np.arange(len(strips)), count) + len(network.strips),
        np.concatenate(time),
        _SPEED * np.einsum("nij,nj->ni", axes, forward),
        np.zeros((n, 3)),
        centre,
        axes @ ENU_FROM_NED @ level @ in_body,
        np.tile(np.sqrt(np.nanmean(given.position_sigma**2, axis=0)), (n, 1))
        if network.has_positions
        else np.full((n, 3), np.nan),
        axes,
        np.tile(covariance, (n, 1, 1)),
        np.full(n, bool(seen.any())),
    )


def _with_events(rig: Rig, wider: PlannedNetwork, count: int) -> Rig:
    """The rig with the last exposures of a network as events of all heads that take images."""
    camera = int(wider.exposures.camera[-1])
    heads = np.unique(rig.camera_of_image[rig.reference[rig.camera_of_image] == camera])
    motion = rig.motion
    if motion is not None:
        body_from_local = np.swapaxes(wider.local_from_body[-count:], 1, 2)
        velocity = np.einsum("nij,nj->ni", body_from_local, wider.exposures.velocity[-count:])
        motion = EventMotion(
            np.concatenate([motion.velocity, velocity]),
            np.concatenate([motion.rate, wider.exposures.rate[-count:]]),
        )
    return replace(
        rig,
        events=(*rig.events, *(f"added {number}" for number in range(1, count + 1))),
        event_of_image=np.concatenate(
            [rig.event_of_image, np.repeat(np.arange(count), len(heads)) + len(rig.events)]
        ),
        camera_of_image=np.concatenate([rig.camera_of_image, np.tile(heads, count)]),
        motion=motion,
    )


def _rays(network: PlannedNetwork, wider: PlannedNetwork) -> PlannedRays:
    """Rays of the additional exposures; tie points are found as often as in the images that are there."""
    given = len(network.event_of_image)
    visible, _ = visible_rays(_geometry(wider, slice(0, given)), network.object_point)
    share = min(1.0, len(network.rays.image) / max(len(visible), 1))
    image, point = visible_rays(_geometry(wider, slice(given, None)), network.object_point)
    found = np.random.default_rng(_SEED).uniform(size=len(image)) < share
    found |= np.isin(point, network.control.point)
    sigma = np.sqrt(np.mean(network.rays.sigma**2, axis=0))
    image = image[found] + given
    return PlannedRays(image, point[found], np.tile(sigma, (len(image), 1)))


def _geometry(network: PlannedNetwork, images: slice) -> ImageGeometry:
    camera, pictures = network.camera_of_image[images], network.state.pictures
    half = np.array([camera.half_format for camera in network.cameras])[camera]
    return ImageGeometry(
        pictures.projection_centre[images],
        pictures.local_from_camera[images],
        network.system[INTERIOR_ORIENTATION][camera],
        (1.0 - _MARGIN) * half,
    )


def _joined(given: PlannedRays, added: PlannedRays) -> PlannedRays:
    image, point = (
        np.concatenate([getattr(one, key) for one in (given, added)]) for key in ("image", "point")
    )
    order = np.lexsort((image, point))
    return PlannedRays(image[order], point[order], np.concatenate([given.sigma, added.sigma])[order])


def _control(network: PlannedNetwork, count: int) -> PlannedControl:
    """The control points there are, and others spread between them."""
    given = network.control
    rays = np.bincount(network.rays.point, minlength=len(network.object_point))
    candidates = np.setdiff1d(np.flatnonzero(rays >= _LEAST_RAYS), given.point)
    chosen = _spread(network.object_point[:, :2], given.point, candidates)[:count]
    full = given.present.all(axis=1)
    covariance = (
        given.covariance[full].mean(axis=0) if full.any() else np.diag(np.full(3, _NO_CONTROL_SIGMA**2))
    )
    return PlannedControl(
        np.concatenate([given.point, chosen]),
        np.concatenate([given.covariance, np.tile(covariance, (len(chosen), 1, 1))]),
        np.concatenate([given.present, np.ones((len(chosen), 3), dtype=bool)]),
    )


def _spread(place: Floats, given: Ints, candidates: Ints) -> Ints:
    """Candidates in the order in which each next one is the farthest from the given and all before it."""
    if len(given) == 0 or len(candidates) == 0:
        return candidates[spread_order(place[candidates])]
    nearest = np.min(np.linalg.norm(place[candidates][:, None] - place[given][None], axis=2), axis=1)
    order = []
    for _ in range(len(candidates)):
        best = int(np.argmax(nearest))
        order.append(best)
        nearest = np.minimum(nearest, np.linalg.norm(place[candidates] - place[candidates[best]], axis=1))
        nearest[order] = -1.0
    return candidates[order]
