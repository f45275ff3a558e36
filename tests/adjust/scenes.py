"""Small blocks with known truth.

``two_strips`` builds an ordinary photogrammetric block, seen from a thousand metres by a camera with
c = 100 mm, whose parts can be switched by the keys of :class:`Plan`. Without a noise seed the
observations are exact; the approximate values are the truth until a start seed disturbs them.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.block import Block
from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.forward import Distortion
from adjust.camera.additional.register import additional_parameters
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.camera.interior import FrameCamera
from adjust.geometry import rotation
from adjust.geometry.earth import CartesianFrame, Ellipsoid, LocalFrame, TopocentricFrame
from adjust.observations.base import StochasticModel
from adjust.observations.control_point import ControlPoints
from adjust.observations.direct import DirectObservations
from adjust.observations.distance import Distances
from adjust.observations.gauss_markov import GaussMarkov
from adjust.observations.gnss_position import GnssPositions, StripMotion
from adjust.observations.image_point import ImagePoints
from adjust.observations.ins_attitude import BodyRates, InsAttitudes
from adjust.parameters import (
    ADDITIONAL_PARAMETERS,
    BORESIGHT,
    FAMILIES,
    GNSS_DRIFT,
    GNSS_SHIFT,
    GNSS_STRIP_BIAS,
    INS_DRIFT,
    INS_STRIP_BIAS,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    TIME_OFFSET,
    State,
    SystemParameters,
    additional_family,
)
from adjust.rig import (
    OF_HEADS,
    RELATIVE_POSITION,
    RELATIVE_ROTATION,
    SYNCHRONISATION_OFFSET,
    EventMotion,
    Rig,
)
from adjust.solve.system import Observations

MICROMETRE = 1e-6
DEGREE = np.pi / 180.0
GRS80 = Ellipsoid(6378137.0, 1.0 / 298.257222101)
ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FLYING_HEIGHT_M = 1000.0
BASE_M = 280.0
STRIP_DISTANCE_M = 620.0
GROUND_SPEED_M_S = 70.0

ControlKind = Literal["full", "plan", "height", "covariance"]


@dataclass(frozen=True)
class Polynomials:
    """Additional parameters in µm at 50 mm: a stretch that comes first, x², xy, x r², shear of a quarter."""

    names: tuple[str, ...]

    @property
    def first(self) -> Bools:
        """Which of them come first."""
        return np.array([name == "test:stretch" for name in self.names])

    def basis(self, xy: Floats) -> Floats:
        """Corrections (n, 2, k), metres."""
        u, v = xy[:, 0] / 0.05, xy[:, 1] / 0.05
        r2, nothing = u**2 + v**2, np.zeros_like(u)
        terms = {
            "test:stretch": (50.0 * u, nothing),
            "test:square": (u**2, nothing),
            "test:shear": (u * v, v),
            "test:radial": (u * r2, v * r2),
            "test:quarter": (np.where((u > 0) & (v > 0), u * v, 0.0), nothing),
        }
        return np.stack([np.stack(terms[name], axis=1) for name in self.names], axis=2) * MICROMETRE


@dataclass(frozen=True)
class Plan:
    """What a block consists of.

    ``free`` says for each family which parameters are unknown: anything that broadcasts to
    the values. ``priors`` gives a standard deviation (SI) with which a family is observed
    directly. ``additional``: every camera has a set of additional parameters of its own; ``forward``: and a
    distortion of the ideal point, some millimetres in the corners. ``turning``: the body turns at the
    exposures, and the rates are delivered. ``distances``: number of measured distances between object points;
    the first point is an end of two of them. ``heads``: with every camera so many take a picture at each
    exposure; the further heads look aside, and have no additional parameters. ``synchronised``: they are
    exposed at one moment, not some milliseconds off, while the body turns.
    ``noise_seed`` and ``start_seed`` None: no noise, no disturbance. Correlation times are
    those of the errors of positions and attitudes along a strip (exposures are 4 s apart); None: white.
    """

    strips: int = 2
    images_per_strip: int = 5
    points_along: int = 12
    points_across: int = 6
    frame: Literal["cartesian", "topocentric"] = "topocentric"
    cameras: Literal[1, 2] = 1
    heads: Literal[1, 2, 3] = 1
    synchronised: bool = True
    flights: Literal[1, 2] = 1
    headings_deg: tuple[float, ...] = (90.0, 270.0)
    tilt_deg: float = 2.0
    control: tuple[ControlKind, ...] = ("full", "full", "plan", "height", "covariance")
    gnss: bool = True
    ins: bool = True
    free: Mapping[str, object] = field(default_factory=dict)
    priors: Mapping[str, float] = field(default_factory=dict)
    additional: bool = False
    forward: bool = False
    noise_seed: int | None = None
    start_seed: int | None = None
    sigma_image_m: float = 2.0 * MICROMETRE
    sigma_gnss_m: float = 0.05
    sigma_ins_rad: float = 0.005 * DEGREE
    sigma_control_m: float = 0.03
    distances: int = 0
    sigma_distance_m: float = 0.01
    turning: bool = False
    gnss_correlation_s: float | None = None
    ins_correlation_s: float | None = None


@dataclass(frozen=True, eq=False)
class Scene:
    """A block with approximate values, its observations and the truth."""

    plan: Plan
    block: Block
    observations: Observations
    truth: State


def two_strips(**switches: object) -> Scene:
    """The block of a plan; ``switches`` replace the defaults of :class:`Plan`."""
    plan = replace(Plan(), **switches)  # type: ignore[arg-type]
    frame: LocalFrame = (
        CartesianFrame()
        if plan.frame == "cartesian"
        else TopocentricFrame(GRS80, np.deg2rad(48.0), np.deg2rad(9.0), 300.0)
    )
    cameras = _cameras(plan)
    camera_of_event, flight_of_event = _assignments(plan)
    system = _true_system(plan)
    centre, attitude = _exposures(plan, frame)
    mounting = np.stack([camera.body_from_camera for camera in cameras])[camera_of_event]
    boresight = rotation.from_roll_pitch_yaw(system[BORESIGHT])[camera_of_event]
    rates = np.random.default_rng(12).normal(0.0, DEGREE, (len(centre), 3))
    velocity = np.einsum("nji,nj->ni", attitude, _motion(plan, frame, centre).velocity)
    body = EventMotion(velocity, rates)
    rig = _rig(plan, cameras, camera_of_event, body)
    truth = State(centre, attitude @ boresight @ mounting, _terrain(plan), system, rig)
    camera_of_image = camera_of_event if rig is None else rig.camera_of_image
    flight_of_image = flight_of_event if rig is None else flight_of_event[rig.event_of_image]
    noise = None if plan.noise_seed is None else np.random.default_rng(plan.noise_seed)

    rays, seen = _image_points(plan, cameras, camera_of_image, truth, noise)
    truth = replace(truth, object_point=truth.object_point[seen])
    n = len(centre)
    others: list[object] = []
    if plan.control:
        others.append(_control(plan, frame, rays, truth.object_point, noise))
    if plan.gnss:
        others.append(_gnss(plan, frame, truth, camera_of_event, flight_of_event, mounting, noise))
    if plan.ins:
        motion = _motion(plan, frame, centre)
        drawn = _along_strips(_drawn(noise, plan.sigma_ins_rad, (n, 3)), motion, plan.ins_correlation_s)
        weights = _over_time(
            StochasticModel.from_sigma(np.full((n, 3), plan.sigma_ins_rad)), motion, plan.ins_correlation_s
        )
        rates = rates if plan.turning else np.zeros((n, 3))
        # log(R_INSᵀ R_b exp(ω Δt)) = v for the true R_b: R_INS = R_b exp(ω Δt) exp(−v).
        later = rotation.exp(rates * system[TIME_OFFSET][flight_of_event])
        drawn = drawn - system[INS_STRIP_BIAS][motion.strip]
        drawn -= system[INS_DRIFT][motion.strip] * motion.since_middle[:, None]
        observed = attitude @ later @ rotation.exp(-drawn)
        turning = BodyRates(flight_of_event, rates) if plan.turning else None
        others.append(
            InsAttitudes(np.arange(n), camera_of_event, observed, mounting, weights, turning, motion)
        )
    if plan.distances:
        others.append(_distances(plan, truth.object_point, noise))
    for family, sigma in plan.priors.items():
        if family not in system:
            continue
        shape = system[family].shape
        given = system[family] + _drawn(noise, sigma, shape)
        weights = StochasticModel.from_sigma(np.full(shape, sigma))
        others.append(DirectObservations(FAMILIES[family], np.arange(shape[0]), given, weights))
    start = _disturbed(plan, truth)
    block = Block(
        frame,
        cameras,
        tuple(f"image_{i:02d}" for i in range(len(camera_of_image))),
        camera_of_image,
        tuple(f"flight_{i}" for i in range(plan.flights)),
        flight_of_image,
        tuple(f"point_{j:03d}" for j in range(len(truth.object_point))),
        _system_parameters(plan, cameras, system),
        start.projection_centre,
        start.local_from_camera,
        start.object_point,
        rig=rig,
    )
    return Scene(plan, block, Observations(rays, tuple(others)), truth)  # type: ignore[arg-type]


def _cameras(plan: Plan) -> tuple[FrameCamera, ...]:
    """One camera with x forward; the second one stands across, with another focal length; their heads."""
    forward = FrameCamera("forward", 14000, 20000, 5e-6, 0.100, (0.0, 0.0), "corner", 0)
    across = FrameCamera("across", 20000, 14000, 5e-6, 0.105, (0.0, 0.0), "centre", 90)
    first = (forward, across)[: plan.cameras]
    return (
        *first,
        *(
            replace(camera, name=f"{camera.name}_{head}", focal_length=0.09 + 0.002 * head)
            for camera in first
            for head in range(1, plan.heads)
        ),
    )


# Of the further heads: roll, pitch, yaw in degrees, and metres forward, right, down.
_HEAD_ANGLES = np.array([[24.0, -3.0, 2.0], [-19.0, 12.0, -5.0]])
_HEAD_PLACES = np.array([[0.30, -0.20, 0.10], [-0.25, 0.35, 0.05]])


def with_cameras_in_order(system: tuple[SystemParameters, ...], order: Ints) -> tuple[SystemParameters, ...]:
    """System parameters of the same cameras in another order: new camera k is the old one order[k]."""
    return tuple(
        replace(
            one,
            entities=tuple(one.entities[k] for k in order),
            values=one.values[order],
            free=one.free[order],
        )
        if one.family.entity_kind == "camera"
        else one
        for one in system
    )


def _rig(
    plan: Plan, cameras: tuple[FrameCamera, ...], camera_of_event: Ints, motion: EventMotion
) -> Rig | None:
    """The heads of the first camera follow those of both cameras, then come those of the second."""
    if plan.heads == 1:
        return None
    more = plan.heads - 1
    events = np.arange(len(camera_of_event))
    further = plan.cameras + camera_of_event[:, None] * more + np.arange(more)
    reference = np.concatenate([np.arange(plan.cameras), np.repeat(np.arange(plan.cameras), more)])
    return Rig(
        tuple(f"event_{event:02d}" for event in events),
        np.repeat(events, plan.heads),
        np.column_stack([camera_of_event, further]).ravel(),
        reference,
        np.stack([camera.body_from_camera for camera in cameras]),
        motion,
    )


def _assignments(plan: Plan) -> tuple[Ints, Ints]:
    """Camera (alternating) and flight (one half of the strips each) of every image."""
    image = np.arange(plan.strips * plan.images_per_strip)
    strip = image // plan.images_per_strip
    return image % plan.cameras, strip * plan.flights // plan.strips


def _true_system(plan: Plan) -> dict[str, Floats]:
    """True system parameters; what is not free is known."""
    interior = np.array([[0.100, 0.0, 0.0], [0.105, 0.0, 0.0]])
    if INTERIOR_ORIENTATION in plan.free:
        interior = interior + np.array([[20.0, 15.0, -10.0], [-30.0, 5.0, 25.0]]) * MICROMETRE
    more = plan.cameras * (plan.heads - 1)
    nothing = np.zeros((more, 3))
    of_heads = np.array([[0.09 + 0.002 * head, 1e-5, -2e-5] for head in range(1, plan.heads)])
    own = {} if plan.heads == 1 else _of_heads(plan)
    return (
        own
        | {
            INTERIOR_ORIENTATION: np.concatenate(
                [interior[: plan.cameras], np.resize(of_heads, (more, 3)) if more else nothing]
            ),
            BORESIGHT: np.concatenate(
                [np.array([[0.3, -0.2, 0.4], [-0.5, 0.1, 0.2]])[: plan.cameras] * DEGREE, nothing]
            ),
            LEVER_ARM: np.concatenate(
                [np.array([[0.4, -0.2, -1.1], [-0.3, 0.25, -1.2]])[: plan.cameras], nothing]
            ),
            GNSS_SHIFT: np.array([[0.0, 0.0, 0.0], [0.15, -0.25, 0.2]])[: plan.flights],
            GNSS_STRIP_BIAS: np.resize([[0.04, -0.03, 0.05], [-0.02, 0.06, 0.01]], (plan.strips, 3)),
            GNSS_DRIFT: np.resize([[0.004, 0.002, -0.003], [-0.005, 0.001, 0.006]], (plan.strips, 3)),
            **_of_attitudes(plan),
            TIME_OFFSET: np.array([[0.004], [-0.002]])[: plan.flights],
        }
        | ({ADDITIONAL_PARAMETERS: _additional(plan)} if plan.additional else {})
    )


def _of_attitudes(plan: Plan) -> dict[str, Floats]:
    """INS biases and drifts of the strips; zero where they are not among the unknowns."""
    values = {
        INS_STRIP_BIAS: np.array([[0.02, -0.01, 0.03], [-0.01, 0.03, 0.01]]) * DEGREE,
        INS_DRIFT: np.array([[1e-3, -2e-3, 2e-3], [-1e-3, 1e-3, 3e-3]]) * DEGREE,
    }
    return {name: np.resize(own, (plan.strips, 3)) * (name in plan.free) for name, own in values.items()}


def _of_heads(plan: Plan) -> dict[str, Floats]:
    """True positions, rotations and delays of all cameras, of both rigs a little different."""
    held, more = np.zeros((plan.cameras, 3)), plan.heads - 1
    drawn = np.random.default_rng(15).normal(0.0, 0.02, (plan.cameras * more, 3))
    angles = np.tile(_HEAD_ANGLES[:more] * DEGREE, (plan.cameras, 1)) + 0.1 * drawn
    places = np.tile(_HEAD_PLACES[:more], (plan.cameras, 1)) + drawn
    return {
        RELATIVE_POSITION: np.concatenate([held, places]),
        RELATIVE_ROTATION: np.concatenate([held, angles]),
        SYNCHRONISATION_OFFSET: np.concatenate(
            [held[:, :1], np.where(plan.synchronised, 0.0, 2e-3 + 0.1 * drawn[:, :1])]
        ),
    }


_TERMS = ("test:square", "test:shear", "test:radial", "test:quarter", "test:stretch")
# The forward camera has no shear, the other one no quarter and no stretch.
_ADDITIONAL = np.array([[3.0, 0.0, -4.0, 5.0, 0.6], [-2.0, 3.0, 2.0, 0.0, 0.0]])
_FORWARD_TERMS = ("brown-forward:k1", "brown-forward:p2", "brown-forward:b1")
# The other camera has an affinity only.
_FORWARD = np.array([[-0.06, 2e-3, 1e-3], [0.0, 0.0, -2e-3]])


def _terms(plan: Plan) -> tuple[str, ...]:
    return _TERMS + _FORWARD_TERMS * plan.forward


def _additional(plan: Plan) -> Floats:
    """True values of the additional parameters of every camera; zero where it does not have one."""
    values = np.concatenate([_ADDITIONAL, _FORWARD], axis=1) if plan.forward else _ADDITIONAL
    values = values[: plan.cameras]
    return np.concatenate([values, np.zeros((plan.cameras * (plan.heads - 1), values.shape[1]))])


def _distortion(values: Floats) -> Distortion:
    names = [name for name, value in zip(_FORWARD_TERMS, values, strict=True) if value != 0.0]
    return Distortion.of(additional_parameters("+".join(names), ImageFormat(0.05, 0.035, None, 0.1)))


def _self_calibration(plan: Plan, camera_of_image: Ints) -> SelfCalibration | None:
    if not plan.additional:
        return None
    corrections = tuple(
        Polynomials(tuple(name for name, value in zip(_TERMS, row, strict=True) if value != 0.0))
        for row in _ADDITIONAL[: plan.cameras]
    ) + (Polynomials(()),) * (plan.cameras * (plan.heads - 1))
    assert not plan.forward or plan.heads == 1
    distortions = tuple(_distortion(row) for row in _FORWARD[: plan.cameras]) if plan.forward else ()
    return SelfCalibration(_terms(plan), corrections, camera_of_image, distortions)


def _system_parameters(
    plan: Plan, cameras: tuple[FrameCamera, ...], truth: Mapping[str, Floats]
) -> tuple[SystemParameters, ...]:
    """Given values: the truth of what is held, nominal values of what is free."""
    result = []
    for name, values in truth.items():
        family = (
            FAMILIES[name] if name in FAMILIES else additional_family(_terms(plan), ("µm",) * values.shape[1])
        )
        free = np.broadcast_to(np.asarray(plan.free.get(name, False), dtype=bool), values.shape).copy()
        if name == ADDITIONAL_PARAMETERS:
            free &= values != 0.0
        if name in (BORESIGHT, LEVER_ARM):  # of the body: its reference head
            free[plan.cameras :] = False
        if name in OF_HEADS:
            free[: plan.cameras] = False
        nominal = np.zeros_like(values)
        if name == RELATIVE_ROTATION:
            nominal = np.round(values, 1)
        if name == RELATIVE_POSITION:
            nominal = np.round(values, 1)
        if name == INTERIOR_ORIENTATION:
            nominal[:, 0] = [camera.focal_length for camera in cameras]
        entities = (
            tuple(camera.name for camera in cameras)
            if family.entity_kind == "camera"
            else tuple(f"{family.entity_kind}_{i}" for i in range(len(values)))
        )
        result.append(SystemParameters(family, entities, np.where(free, nominal, values), free))
    return tuple(result)


def _exposures(plan: Plan, frame: LocalFrame) -> tuple[Floats, Floats]:
    """True projection centres (n, 3) and attitudes local from body (n, 3, 3)."""
    generator = np.random.default_rng(11)
    n = plan.strips * plan.images_per_strip
    strip, number = np.divmod(np.arange(n), plan.images_per_strip)
    heading = np.asarray(plan.headings_deg)[strip % len(plan.headings_deg)]
    centre = np.stack(
        [
            (number - 0.5 * (plan.images_per_strip - 1)) * BASE_M,
            (strip - 0.5 * (plan.strips - 1)) * STRIP_DISTANCE_M,
            np.full(n, FLYING_HEIGHT_M) + 25.0 * (strip % 2),
        ],
        axis=1,
    ) + generator.normal(0.0, 5.0, (n, 3))
    tilt = generator.uniform(-plan.tilt_deg, plan.tilt_deg, (n, 3))
    angles = np.deg2rad(np.stack([heading, np.zeros(n), np.zeros(n)], axis=1) + tilt)
    attitude = frame.local_from_enu(centre) @ ENU_FROM_NED @ rotation.ned_from_body(angles)
    return centre, attitude


def _terrain(plan: Plan) -> Floats:
    """Object points (m, 3) on undulating terrain, on a shaken grid."""
    generator = np.random.default_rng(12)
    half_x = 0.5 * (plan.images_per_strip - 1) * BASE_M + 250.0
    half_y = 0.5 * (plan.strips - 1) * STRIP_DISTANCE_M + 380.0
    x, y = np.meshgrid(
        np.linspace(-half_x, half_x, plan.points_along), np.linspace(-half_y, half_y, plan.points_across)
    )
    plane = np.stack([x.ravel(), y.ravel()], axis=1) + generator.uniform(-20.0, 20.0, (x.size, 2))
    height = 60.0 * np.sin(plane[:, 0] / 300.0) * np.cos(plane[:, 1] / 250.0) + generator.uniform(
        -15.0, 15.0, x.size
    )
    return np.column_stack([plane, height])


def _image_points(
    plan: Plan,
    cameras: tuple[FrameCamera, ...],
    camera_of_image: Ints,
    truth: State,
    noise: np.random.Generator | None,
) -> tuple[ImagePoints, Bools]:
    """Rays inside the format, and which object points (m,) are seen at least twice."""
    interior = truth.system[INTERIOR_ORIENTATION][camera_of_image]
    pictures = truth.pictures
    difference = truth.object_point[:, None, :] - pictures.projection_centre[None, :, :]
    in_camera = np.einsum("nji,mnj->mni", pictures.local_from_camera, difference)
    xy = interior[:, 1:] - interior[:, :1] * in_camera[:, :, :2] / in_camera[:, :, 2:]
    half = np.array([camera.half_format for camera in cameras])[camera_of_image]
    inside = (np.abs(xy) < half).all(axis=2) & (in_camera[:, :, 2] < 0.0)
    seen = inside.sum(axis=1) >= 2
    point, image = np.nonzero(inside[seen])
    measured = xy[seen][point, image]
    model = _self_calibration(plan, camera_of_image)
    if model is not None:
        ideal, principal, values = measured, interior[image, 1:], truth.system[ADDITIONAL_PARAMETERS]
        if model.forward is not None:
            c = interior[image, :1]
            ideal = ideal + c * model.forward.correction(image, (ideal - principal) / c, values)
        for _ in range(20):
            correction = model.correction(image, measured - principal, values)
            measured = ideal - correction
    measured = measured + _drawn(noise, plan.sigma_image_m, measured.shape)
    sigma = np.full(measured.shape, plan.sigma_image_m)
    active = np.ones(len(image), dtype=bool)
    event_of_image = None if truth.rig is None else truth.rig.event_of_image
    rays = ImagePoints(
        image, point, camera_of_image, measured, sigma, active, model, event_of_image=event_of_image
    )
    return rays, seen


def _control(
    plan: Plan, frame: LocalFrame, rays: ImagePoints, points: Floats, noise: np.random.Generator | None
) -> ControlPoints:
    """Control points among those with many rays, as far from each other as possible."""
    many = np.flatnonzero(np.bincount(rays.point) >= 3)
    chosen = [int(many[np.argmin(points[many, 0] + points[many, 1])])]
    while len(chosen) < len(plan.control):
        distance = np.min(np.linalg.norm(points[many, None, :2] - points[None, chosen, :2], axis=2), axis=1)
        chosen.append(int(many[np.argmax(distance)]))
    kinds = np.array(plan.control)
    covariance = np.broadcast_to(np.eye(3) * plan.sigma_control_m**2, (len(kinds), 3, 3)).copy()
    correlated = np.array([[1.0, 0.6, 0.3], [0.6, 2.0, -0.5], [0.3, -0.5, 4.0]])
    covariance[kinds == "covariance"] = correlated * plan.sigma_control_m**2
    present = np.ones((len(kinds), 3), dtype=bool)
    present[kinds == "plan", 2] = False
    present[kinds == "height", :2] = False
    true = points[chosen]
    standard = np.zeros((len(kinds), 3)) if noise is None else noise.normal(size=(len(kinds), 3))
    in_enu = np.einsum("nij,nj->ni", np.linalg.cholesky(covariance), standard)
    given = true + np.einsum("nij,nj->ni", frame.local_from_enu(true), in_enu)
    height = frame.height(true) + in_enu[:, 2]
    given[kinds == "height"] = np.nan
    height[kinds == "plan"] = np.nan
    return ControlPoints(
        np.array(chosen), given, height, frame, StochasticModel.from_covariance(covariance, present)
    )


def _distances(plan: Plan, points: Floats, noise: np.random.Generator | None) -> Distances:
    """Distances between object points all over the block."""
    ends = np.random.default_rng(14).choice(len(points), (plan.distances, 2), replace=False)
    ends[1:2, 0] = ends[0, 0]
    true = np.linalg.norm(points[ends[:, 1]] - points[ends[:, 0]], axis=1)
    sigma = np.full((plan.distances, 1), plan.sigma_distance_m)
    given = true + _drawn(noise, plan.sigma_distance_m, true.shape)
    return Distances(ends[:, 0], ends[:, 1], given, StochasticModel.from_sigma(sigma))


def _gnss(
    plan: Plan,
    frame: LocalFrame,
    truth: State,
    camera: Ints,
    flight: Ints,
    mounting: Floats,
    noise: np.random.Generator | None,
) -> GnssPositions:
    """Antenna positions, height twice as uncertain as the plan position."""
    boresight = rotation.from_roll_pitch_yaw(truth.system[BORESIGHT][camera])
    local_from_body = truth.local_from_camera @ np.swapaxes(boresight @ mounting, 1, 2)
    arm = np.einsum("nij,nj->ni", local_from_body, truth.system[LEVER_ARM][camera])
    motion = _motion(plan, frame, truth.projection_centre)
    antenna = (
        truth.projection_centre
        + arm
        + truth.system[GNSS_SHIFT][flight]
        + truth.system[GNSS_STRIP_BIAS][motion.strip]
        + truth.system[GNSS_DRIFT][motion.strip] * motion.since_middle[:, None]
        + truth.system[TIME_OFFSET][flight] * motion.velocity
    )
    local_from_enu = frame.local_from_enu(antenna)
    sigma = np.tile([plan.sigma_gnss_m, plan.sigma_gnss_m, 2.0 * plan.sigma_gnss_m], (len(camera), 1))
    drawn = np.zeros_like(sigma) if noise is None else sigma * noise.normal(size=sigma.shape)
    drawn = _along_strips(drawn, motion, plan.gnss_correlation_s)
    observed = antenna + np.einsum("nij,nj->ni", local_from_enu, drawn)
    return GnssPositions(
        np.arange(len(camera)),
        camera,
        flight,
        observed,
        local_from_enu,
        mounting,
        _over_time(StochasticModel.from_sigma(sigma), motion, plan.gnss_correlation_s),
        motion,
    )


def _over_time(model: StochasticModel, motion: StripMotion, correlation_s: float | None) -> StochasticModel:
    """Weights with or without correlation over time."""
    if correlation_s is None:
        return model
    return model.correlated(GaussMarkov(motion.strip, motion.since_middle, correlation_s))


def _along_strips(white: Floats, motion: StripMotion, correlation_s: float | None) -> Floats:
    """Errors (n, 3) with the correlations exp(−|Δt|/τ) within each strip, by a root of their matrix."""
    if correlation_s is None:
        return white
    apart = np.abs(motion.since_middle[:, None] - motion.since_middle)
    same = motion.strip[:, None] == motion.strip
    root = np.linalg.cholesky(np.where(same, np.exp(-apart / correlation_s), 0.0))
    return np.asarray(root @ white)


def _motion(plan: Plan, frame: LocalFrame, centre: Floats) -> StripMotion:
    """Strip, time since its middle and velocity of every exposure."""
    strip, number = np.divmod(np.arange(len(centre)), plan.images_per_strip)
    heading = np.deg2rad(np.asarray(plan.headings_deg)[strip % len(plan.headings_deg)])
    # Images are numbered from west to east, whichever way the strip was flown.
    eastward = np.where(np.sin(heading) < 0.0, -1.0, 1.0)
    since_middle = eastward * (number - 0.5 * (plan.images_per_strip - 1)) * BASE_M / GROUND_SPEED_M_S
    in_enu = GROUND_SPEED_M_S * np.stack([np.sin(heading), np.cos(heading), np.zeros(len(strip))], axis=1)
    return StripMotion(strip, since_middle, np.einsum("nij,nj->ni", frame.local_from_enu(centre), in_enu))


def _disturbed(plan: Plan, truth: State) -> State:
    """Approximate values: 2 m and 0.5° (largest) off the truth, object points 5 m."""
    if plan.start_seed is None:
        return truth
    generator = np.random.default_rng(plan.start_seed)
    n, m = len(truth.projection_centre), len(truth.object_point)
    return replace(
        truth,
        projection_centre=truth.projection_centre + _bounded(generator, n, 2.0),
        local_from_camera=truth.local_from_camera @ rotation.exp(_bounded(generator, n, 0.5 * DEGREE)),
        object_point=truth.object_point + _bounded(generator, m, 5.0),
    )


def _bounded(generator: np.random.Generator, count: int, length: float) -> Floats:
    """Vectors (count, 3) of a given length in random directions."""
    vector = generator.normal(size=(count, 3))
    return length * vector / np.linalg.norm(vector, axis=1, keepdims=True)


def _drawn(noise: np.random.Generator | None, sigma: float, shape: tuple[int, ...]) -> Floats:
    """Normally distributed errors, or zeros."""
    return np.zeros(shape) if noise is None else noise.normal(0.0, sigma, shape)


def with_rejected_rays(scene: Scene) -> Scene:
    """The same block without some rays: two points lose one of many, two lose all but one and drop out."""
    rays = scene.observations.image_points
    count = np.bincount(rays.point)
    first = np.searchsorted(rays.point, np.arange(len(count)))
    taken = np.zeros(len(rays.image), dtype=bool)
    controlled = np.concatenate(
        [group.point[group.point >= 0] for group in scene.observations.others] or [np.array([], int)]
    )
    free = np.setdiff1d(np.arange(len(count)), controlled)
    taken[first[free[count[free] >= 4][:2]]] = True
    taken[first[free[count[free] == 2][:2]]] = True
    return replace(scene, observations=replace(scene.observations, image_points=rays.without(taken)))


def with_correlated_attitudes(scene: Scene) -> Scene:
    """The same block with roll, pitch, yaw correlated within each attitude, differently in each."""
    others = list(scene.observations.others)
    number, ins = next((k, group) for k, group in enumerate(others) if isinstance(group, InsAttitudes))
    generator = np.random.default_rng(41)
    root = np.tril(generator.uniform(-0.5, 0.5, (len(ins.event), 3, 3))) + np.eye(3)
    covariance = scene.plan.sigma_ins_rad**2 * root @ np.swapaxes(root, 1, 2)
    model = StochasticModel.from_covariance(covariance, np.ones((len(ins.event), 3), dtype=bool))
    others[number] = replace(ins, stochastic=replace(model, over_time=ins.stochastic.over_time))
    return replace(scene, observations=replace(scene.observations, others=tuple(others)))


def with_rejected_distances(scene: Scene, rows: tuple[int, ...]) -> Scene:
    """The same block without some distances."""
    others = list(scene.observations.others)
    number = next(k for k, group in enumerate(others) if isinstance(group, Distances))
    others[number] = others[number].without(np.isin(np.arange(len(others[number].point)), rows))
    return replace(scene, observations=replace(scene.observations, others=tuple(others)))


def with_rejected_positions(scene: Scene, rows: tuple[int, ...]) -> Scene:
    """The same block without some GNSS positions."""
    others = list(scene.observations.others)
    number = next(k for k, group in enumerate(others) if isinstance(group, GnssPositions))
    others[number] = others[number].without(np.isin(np.arange(len(others[number].event)), rows))
    return replace(scene, observations=replace(scene.observations, others=tuple(others)))


ALL_FREE: Mapping[str, object] = {
    INTERIOR_ORIENTATION: True,
    BORESIGHT: True,
    LEVER_ARM: True,
    GNSS_SHIFT: [[False], [True]],
}
# Leaves one parameter of a family held, so that columns and components differ.
SOME_FREE: Mapping[str, object] = {
    INTERIOR_ORIENTATION: [[True, False, True]],
    BORESIGHT: [[False, True, True]],
    LEVER_ARM: [[True, True, False]],
}


@functools.cache
def variants() -> Mapping[str, Scene]:
    """Blocks that differ in all that the equations distinguish, disturbed and noisy; tests only read them."""
    seeds = {"noise_seed": 21, "start_seed": 22}
    everything = {"cameras": 2, "flights": 2, "free": ALL_FREE, "priors": {INTERIOR_ORIENTATION: 2e-5}}
    return {
        "nothing_free": two_strips(**seeds),
        "cartesian": two_strips(frame="cartesian", **seeds),
        "some_parameters_free": two_strips(free=SOME_FREE, **seeds),
        "everything_free_two_cameras": two_strips(**everything, **seeds),
        "rejected_rays": with_rejected_rays(two_strips(**everything, **seeds)),
        "additional_parameters_two_cameras": two_strips(
            **{**everything, "free": {**ALL_FREE, ADDITIONAL_PARAMETERS: True}}, additional=True, **seeds
        ),
        # b1 stretches the image as test:stretch does: one of both.
        "distortion_of_the_ideal_point": two_strips(
            **{**everything, "free": {**ALL_FREE, ADDITIONAL_PARAMETERS: [[True] * 7 + [False], [True] * 8]}},
            additional=True,
            forward=True,
            **seeds,
        ),
        "additional_parameters_held": two_strips(additional=True, free=SOME_FREE, **seeds),
        "control_only": two_strips(control=("full",) * 4, gnss=False, ins=False, **seeds),
        "no_control": two_strips(control=(), **seeds),
        "strip_families_and_time_free": two_strips(
            free={GNSS_STRIP_BIAS: True, GNSS_DRIFT: True, TIME_OFFSET: True, BORESIGHT: True},
            priors={GNSS_STRIP_BIAS: 0.05, GNSS_DRIFT: 0.005},
            **seeds,
        ),
        "attitudes_of_strips_free": two_strips(
            free={GNSS_STRIP_BIAS: True, INS_STRIP_BIAS: True, INS_DRIFT: True},
            priors={GNSS_STRIP_BIAS: 0.05},
            **seeds,
        ),
        "heads_held": two_strips(heads=2, synchronised=False, **seeds),
        "heads_free_two_cameras": two_strips(
            **{
                **everything,
                "free": {
                    **ALL_FREE,
                    ADDITIONAL_PARAMETERS: True,
                    RELATIVE_ROTATION: True,
                    RELATIVE_POSITION: [[True, True, False]],
                    SYNCHRONISATION_OFFSET: True,
                },
                "priors": {INTERIOR_ORIENTATION: 2e-5, RELATIVE_POSITION: 5e-4},
            },
            heads=3,
            synchronised=False,
            additional=True,
            **seeds,
        ),
        "distances": with_rejected_distances(
            two_strips(**{**everything, "priors": {}}, control=("full",) * 3, distances=8, **seeds), rows=(2,)
        ),
        "correlated_over_time": with_rejected_positions(
            with_correlated_attitudes(
                two_strips(
                    images_per_strip=7,
                    cameras=2,
                    free={BORESIGHT: True, GNSS_SHIFT: True, GNSS_STRIP_BIAS: True, LEVER_ARM: True},
                    priors={GNSS_STRIP_BIAS: 0.05, LEVER_ARM: 0.02},
                    gnss_correlation_s=12.0,
                    ins_correlation_s=30.0,
                    **seeds,
                )
            ),
            rows=(2, 3, 7),
        ),
    }
