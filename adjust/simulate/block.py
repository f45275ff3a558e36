"""A simulated block: its truth, what was measured of it, and the way into an adjustment."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from adjust.approximate.intersection import intersect
from adjust.arrays import Floats, Ints
from adjust.block import Block
from adjust.geometry import rotation
from adjust.observations.base import ObservationGroup, StochasticModel
from adjust.observations.control_point import ControlPoints
from adjust.observations.direct import DirectObservations
from adjust.observations.gauss_markov import GaussMarkov
from adjust.observations.gnss_position import GnssPositions, StripMotion
from adjust.observations.image_point import ImagePoints
from adjust.observations.ins_attitude import BodyRates, InsAttitudes
from adjust.parameters import (
    FAMILIES,
    GNSS_DRIFT,
    GNSS_SHIFT,
    GNSS_STRIP_BIAS,
    INS_DRIFT,
    INS_STRIP_BIAS,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    TIME_OFFSET,
    Family,
    State,
    SystemParameters,
    free_in_rig,
)
from adjust.rig import OF_HEADS
from adjust.simulate.gross_errors import GrossErrors, gross_errors_of
from adjust.simulate.heads import stated_heads
from adjust.simulate.noise import gnss_markov_noise, ins_markov_noise, white_noise
from adjust.simulate.random_streams import RandomStreams, Source
from adjust.simulate.system import certified_interior, strip_errors
from adjust.simulate.truth import BlockSpecification, BlockTruth, block_truth
from adjust.solve.system import Observations


@dataclass(frozen=True, eq=False)
class Measurements:
    """What was measured, with noise and gross errors; local frame, metres.

    Attributes
    ----------
    xy : (r, 2) image points.
    surveyed : (k, 3) surveyed coordinates, complete whatever is known of them later.
    surveyed_height : (k,) their heights in the frame's sense.
    positions : (n, 3) of the antenna.
    local_from_body : (n, 3, 3) attitudes of the inertial unit.
    gross_errors : what is wrong on purpose.
    """

    xy: Floats
    surveyed: Floats
    surveyed_height: Floats
    positions: Floats
    local_from_body: Floats
    gross_errors: GrossErrors


@dataclass(frozen=True, eq=False)
class SimulatedBlock:
    """A block with known truth, ready to be adjusted.

    Attributes
    ----------
    specification, truth, measured : see there.
    """

    specification: BlockSpecification
    truth: BlockTruth
    measured: Measurements

    def measured_again(self, seed: int) -> SimulatedBlock:
        """The same truth measured with the noise and the gross errors of another seed."""
        return replace(self, measured=measure(self.specification, self.truth, seed))

    def flown_again(self, seed: int) -> SimulatedBlock:
        """The same flight on another day: biases and drifts of the strips, too, are those of another seed."""
        state, strips = self.truth.state, len(self.truth.plan.strips)
        random = strip_errors(self.specification.system, strips, RandomStreams(seed))
        truth = replace(self.truth, state=replace(state, system={**state.system, **random}))
        return SimulatedBlock(self.specification, truth, measure(self.specification, truth, seed))

    def block(self, free: Collection[str] = ()) -> Block:
        """The block to adjust: certified values, approximate values from GNSS/INS and intersection.

        Parameters
        ----------
        free : families of system parameters to estimate; the others are held at zero, the interior
            orientation at its certificate.
        """
        truth, plan, rig = self.truth, self.truth.plan, self.truth.state.rig
        cameras = self.specification.cameras
        known = truth.state.system
        system = tuple(
            self._parameters(family, family.name in free)
            for name, family in FAMILIES.items()
            if name in known
        )
        mounting = np.stack([camera.body_from_camera for camera in cameras])[plan.camera]
        block = Block(
            self.specification.frame,
            cameras,
            truth.images,
            truth.camera_of_image,
            plan.flights,
            plan.flight if rig is None else plan.flight[rig.event_of_image],
            truth.points,
            system,
            self.measured.positions,
            self.measured.local_from_body @ mounting,
            np.zeros((len(truth.points), 3)),
            rig=rig,
        )
        found = intersect(self._image_points(), block.approximate_state(), len(truth.points))
        # A ray with a gross error may put a point behind a camera; the truth is then as good a start.
        start = np.where(found.usable[:, None], found.object_point, truth.state.object_point)
        return replace(block, object_point=start)

    @property
    def event_of_image(self) -> Ints:
        """(n,) exposure of every image."""
        rig = self.truth.state.rig
        return np.arange(len(self.truth.images)) if rig is None else rig.event_of_image

    def true_state(self) -> State:
        """True values of all unknowns."""
        return self.truth.state

    def observations(
        self,
        block: Block,
        without: Collection[str] = (),
        correlation_times: Mapping[str, float] | None = None,
    ) -> Observations:
        """The observations of a block made by :meth:`block`, weighted as specified.

        Free strip biases and drifts come with direct observations of zero and the standard deviations
        they were drawn from. Check points give rays only.

        Parameters
        ----------
        without : names of groups that are left out: "control_points", "gnss_positions", "ins_attitudes".
        correlation_times : seconds for which the errors of "gnss_positions" and "ins_attitudes" are taken to
            last along a strip; not at all for what is not named.
        """
        times = correlation_times or {}
        control = self._control_points()
        groups: list[ObservationGroup] = [] if control is None else [control]
        groups += [
            self._gnss_positions(block, times.get(GnssPositions.name)),
            self._ins_attitudes(block, times.get(InsAttitudes.name)),
            *self._priors(block),
        ]
        kept = tuple(group for group in groups if group.name not in without)
        return Observations(self._image_points(), kept)

    def _entities(self, family: Family) -> tuple[str, ...]:
        names = {
            "camera": tuple(camera.name for camera in self.specification.cameras),
            "flight": self.truth.plan.flights,
            "strip": self.truth.plan.strips,
        }
        return names[family.entity_kind]

    def _parameters(self, family: Family, is_free: bool) -> SystemParameters:
        entities = self._entities(family)
        shape = (len(entities), len(family.components))
        values = np.zeros(shape)
        if family.name == INTERIOR_ORIENTATION:
            values = certified_interior(self.specification.cameras)
        freedom = np.full(shape, is_free)
        rig = self.truth.state.rig
        if rig is not None and family.name in OF_HEADS:
            values = stated_heads(self.specification.heads, len(entities))[family.name]
        if rig is not None and family.entity_kind == "camera":
            freedom = free_in_rig(rig, family.name, freedom)
        return SystemParameters(family, entities, values, freedom)

    def _image_points(self) -> ImagePoints:
        rays, rig = len(self.measured.xy), self.truth.state.rig
        return ImagePoints(
            self.truth.image,
            self.truth.point,
            self.truth.camera_of_image,
            self.measured.xy,
            np.full((rays, 2), self.specification.noise.image),
            np.ones(rays, dtype=bool),
            event_of_image=None if rig is None else rig.event_of_image,
        )

    def _control_points(self) -> ControlPoints | None:
        """Observations of the control points; None if there are none."""
        truth = self.truth
        kept = np.flatnonzero(~truth.is_check)
        if len(kept) == 0:
            return None
        present = truth.present[kept]
        plan_known = np.asarray(present[:, :2].all(axis=1))
        sigma = np.where(present, np.array(self.specification.noise.control), np.nan)
        return ControlPoints(
            truth.surveyed[kept],
            np.where(plan_known[:, None], self.measured.surveyed[kept], np.nan),
            np.where(present[:, 2], self.measured.surveyed_height[kept], np.nan),
            self.specification.frame,
            StochasticModel.from_sigma(sigma),
        )

    def _over_time(self, sigma: Floats, correlation_time: float | None) -> StochasticModel:
        """Weights of positions or attitudes with standard deviations (3,)."""
        plan = self.truth.plan
        model = StochasticModel.from_sigma(np.broadcast_to(sigma, (len(plan.images), 3)))
        if correlation_time is None:
            return model
        return model.correlated(GaussMarkov(plan.strip, self.truth.trajectory.time, correlation_time))

    def _gnss_positions(self, block: Block, correlation_time: float | None) -> GnssPositions:
        plan, positions = self.truth.plan, self.measured.positions
        n = len(plan.images)
        motion = StripMotion(plan.strip, since_middle(self.truth), self.truth.trajectory.velocity)
        return GnssPositions(
            np.arange(n, dtype=np.int64),
            plan.camera,
            plan.flight,
            positions,
            np.array(self.specification.frame.local_from_enu(positions)),
            block.body_from_camera,
            self._over_time(self.specification.noise.stated_gnss, correlation_time),
            motion,
        )

    def _ins_attitudes(self, block: Block, correlation_time: float | None) -> InsAttitudes:
        plan = self.truth.plan
        n = len(plan.images)
        return InsAttitudes(
            np.arange(n, dtype=np.int64),
            plan.camera,
            self.measured.local_from_body,
            block.body_from_camera,
            self._over_time(self.specification.noise.stated_ins, correlation_time),
            BodyRates(plan.flight, self.truth.trajectory.rate),
            StripMotion(plan.strip, since_middle(self.truth), self.truth.trajectory.velocity),
        )

    def _priors(self, block: Block) -> list[DirectObservations]:
        """Zero as an observation of what was drawn at random about zero, where it is free."""
        drawn = self.specification.system.of_strips
        groups = []
        for parameters in block.system:
            sigma = np.array(drawn.get(parameters.family.name, (0.0, 0.0, 0.0)))
            if parameters.free.all() and np.all(sigma > 0.0):
                entities = np.arange(len(parameters.entities), dtype=np.int64)
                model = StochasticModel.from_sigma(np.broadcast_to(sigma, parameters.values.shape))
                groups.append(DirectObservations(parameters.family, entities, parameters.values, model))
        return groups


def simulate_block(specification: BlockSpecification) -> SimulatedBlock:
    """Simulate a block: the truth, then the measurements.

    Raises
    ------
    InconsistentBlockError : if the flight plan gives no block.
    """
    truth = block_truth(specification)
    return SimulatedBlock(specification, truth, measure(specification, truth, specification.seed))


def since_middle(truth: BlockTruth) -> Floats:
    """Seconds (n,) since the middle of the time span of each exposure's strip."""
    time, strip = truth.trajectory.time, truth.plan.strip
    first = np.full(len(truth.plan.strips), np.inf)
    last = -first
    np.minimum.at(first, strip, time)
    np.maximum.at(last, strip, time)
    return np.asarray(time - (0.5 * (first + last))[strip])


def measure(specification: BlockSpecification, truth: BlockTruth, seed: int) -> Measurements:
    """Measure a block, with the noise and the gross errors that belong to a seed."""
    noise, streams = specification.noise, RandomStreams(seed)
    full = np.flatnonzero(truth.present.all(axis=1) & ~truth.is_check)
    half_format = np.array([camera.half_format for camera in specification.cameras])
    wrong = gross_errors_of(
        specification.gross_errors,
        streams,
        truth.xy,
        half_format[truth.camera_of_image[truth.image]],
        full,
        len(truth.plan.strips),
    )
    sigma = np.full(2, noise.image)
    xy = truth.xy + white_noise(noise, streams, Source.IMAGE_NOISE, sigma, len(truth.xy))
    xy[wrong.image_points] += wrong.displacement

    frame, true = specification.frame, truth.state.object_point[truth.surveyed]
    error = white_noise(noise, streams, Source.CONTROL_NOISE, np.array(noise.control), len(true))
    surveyed = true + np.einsum("nij,nj->ni", frame.local_from_enu(true), error)
    one, other = wrong.swapped.T
    exchanged = np.arange(len(surveyed))
    exchanged[one], exchanged[other] = other, one
    surveyed = surveyed[exchanged]

    ins = white_noise(noise, streams, Source.INS_NOISE, np.array(noise.ins), len(truth.plan.images))
    ins += ins_markov_noise(noise, streams, truth.trajectory.time, truth.plan.strip)
    plan, system = truth.plan, truth.state.system
    ins -= system[INS_STRIP_BIAS][plan.strip] + system[INS_DRIFT][plan.strip] * since_middle(truth)[:, None]
    # log(R_INSᵀ R_b exp(ω Δt)) + γ + e (t − t_k) is the residual, so the observed attitude is the one at the
    # time of the trajectory turned back by it.
    offset = truth.state.system[TIME_OFFSET][truth.plan.flight, 0]
    offset = offset + wrong.time_error * np.isin(truth.plan.strip, wrong.strips)
    later = rotation.exp(truth.trajectory.rate * offset[:, None])
    attitude = truth.trajectory.local_from_body @ later @ np.swapaxes(rotation.exp(ins), 1, 2)
    return Measurements(
        xy,
        surveyed,
        frame.height(surveyed),
        _antenna_positions(specification, truth, streams, wrong),
        attitude,
        wrong,
    )


def _antenna_positions(
    specification: BlockSpecification, truth: BlockTruth, streams: RandomStreams, wrong: GrossErrors
) -> Floats:
    """A = X0 + R_b l + s_f + β_k + d_k (t − t_k) + v Δt + noise, (n, 3)."""
    noise, plan, flown, system = specification.noise, truth.plan, truth.trajectory, truth.state.system
    positions = (
        flown.projection_centre
        + np.einsum("nij,nj->ni", flown.local_from_body, system[LEVER_ARM][plan.camera])
        + system[GNSS_SHIFT][plan.flight]
        + system[GNSS_STRIP_BIAS][plan.strip]
        + system[GNSS_DRIFT][plan.strip] * since_middle(truth)[:, None]
        + system[TIME_OFFSET][plan.flight] * flown.velocity
    )
    positions[np.isin(plan.strip, wrong.strips)] += (
        wrong.time_error * flown.velocity[np.isin(plan.strip, wrong.strips)]
    )
    error = white_noise(noise, streams, Source.GNSS_WHITE, np.array(noise.gnss), len(positions))
    error += gnss_markov_noise(noise, streams, flown.time, plan.strip)
    axes = specification.frame.local_from_enu(flown.projection_centre)
    return np.asarray(positions + np.einsum("nij,nj->ni", axes, error))
