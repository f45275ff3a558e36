"""GNSS positions of the antenna at the moments of exposure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from adjust.arrays import Bools, Floats, Ints, as_sigmas, require_shape
from adjust.geometry import rotation
from adjust.observations.base import Linearization, StochasticModel, Term, require_rows, require_values
from adjust.parameters import (
    BORESIGHT,
    EXTERIOR_ORIENTATION,
    GNSS_DRIFT,
    GNSS_SHIFT,
    GNSS_STRIP_BIAS,
    LEVER_ARM,
    TIME_OFFSET,
    State,
    Unit,
)
from adjust.unknown_names import indices_of

if TYPE_CHECKING:
    from adjust.block import Block


@dataclass(frozen=True, eq=False)
class StripMotion:
    """When the positions were taken, and how the aircraft moved.

    Attributes
    ----------
    strip : (n,) index of the strip.
    since_middle : (n,) seconds since the middle of the strip.
    velocity : (n, 3) metres per second, local frame.
    """

    strip: Ints
    since_middle: Floats
    velocity: Floats

    def of(self, rows: Ints) -> StripMotion:
        """That of some of the exposures (k,)."""
        return StripMotion(self.strip[rows], self.since_middle[rows], self.velocity[rows])


@dataclass(frozen=True, eq=False)
class GnssPositions:
    """Positions of the GNSS antenna.

    The observation is zero when, in the axes C in which it is weighted (east, north, up of the map),

        C · (X0 + R_b · l + s_f + β_k + d_k (t − t_k) + v Δt_f − A) = 0,    R_b = R_c · Tᵀ · R_B(b)ᵀ

    with the projection centre X0, the lever arm l in body axes (forward, right, down), the shift s of
    flight f, the bias β and the drift d of strip k about its mid time t_k (local axes), the time
    offset Δt of the flight times the velocity v, and the observed position A. If what is delivered
    has been reduced to the projection centre already, l is what the reduction left over.

    Attributes
    ----------
    event : (n,) index of the event.
    camera, flight : (n,) index of its camera (mounting; of a rig the reference head) and flight.
    observed : (n, 3) metres, local frame.
    local_from_enu : (n, 3, 3) axes in which the components are given and weighted: those of the map grid
        for a delivery in map coordinates.
    body_from_camera : (n, 3, 3) nominal mounting T.
    stochastic : components east, north, up.
    motion : times and velocities; without them there is no strip bias, drift or time offset.
    """

    event: Ints
    camera: Ints
    flight: Ints
    observed: Floats
    local_from_enu: Floats
    body_from_camera: Floats
    stochastic: StochasticModel
    motion: StripMotion | None = None

    name: ClassVar[str] = "gnss_positions"
    components: ClassVar[tuple[str, ...]] = ("x", "y", "z")
    unit: ClassVar[Unit] = "m"

    def __post_init__(self) -> None:
        indices = ("event", "camera", "flight")
        require_rows(self, indices, observed=(3,), local_from_enu=(3, 3), body_from_camera=(3, 3))
        require_values(self, np.isfinite(self.observed.sum(axis=1, keepdims=True)))

    @classmethod
    def measured(cls, block: Block, image: ArrayLike, observed: ArrayLike, sigma: ArrayLike) -> Self:
        """Positions of a block, without times.

        Parameters
        ----------
        image : (n,) names, or indices, of its images; of a rig of its events.
        observed : (n, 3) metres, local frame.
        sigma : east, north, up, metres; a number, or an array that broadcasts to (n, 3).

        Raises
        ------
        InconsistentBlockError : of other shapes or values.
        UnknownNameError : the block has no such image.
        """
        index = indices_of("image" if block.rig is None else "event", image, block.events)
        antenna = np.asarray(observed, dtype=np.float64)
        require_shape("The array of positions", antenna.shape, (len(index), 3))
        return cls(
            index,
            block.camera_of_event[index],
            block.flight_of_event[index],
            antenna,
            block.frame.local_from_enu(antenna),
            block.body_from_camera[index],
            StochasticModel.from_sigma(as_sigmas(sigma, antenna.shape)),
        )

    @property
    def point(self) -> Ints:
        """−1 for every position: it belongs to no object point."""
        return np.full(len(self.event), -1, dtype=np.int64)

    def linearize(self, state: State) -> Linearization:
        """Observation equations at a state; all derivatives exact."""
        # Of the few cameras, not of each event.
        boresight, lever_arm = state.system[BORESIGHT], state.system[LEVER_ARM]
        inertial_from_body = rotation.from_roll_pitch_yaw(boresight)[self.camera]
        turned_arm = rotation.cross_matrix(lever_arm) @ rotation.roll_pitch_yaw_jacobian(boresight)
        shift = state.system[GNSS_SHIFT][self.flight]
        local_from_camera = state.local_from_camera[self.event]
        camera_from_inertial = np.swapaxes(inertial_from_body @ self.body_from_camera, 1, 2)
        local_from_inertial = local_from_camera @ camera_from_inertial
        arm_in_camera = np.einsum("nij,nj->ni", camera_from_inertial, lever_arm[self.camera])
        arm_in_local = np.einsum("nij,nj->ni", local_from_camera, arm_in_camera)
        computed = state.projection_centre[self.event] + arm_in_local + shift
        if self.motion is not None:
            computed = computed + _along_track(self.motion, self.flight, state)

        enu_from_local = np.swapaxes(self.local_from_enu, 1, 2)
        of_rotation = -enu_from_local @ local_from_camera @ rotation.cross_matrix(arm_in_camera)
        of_arm = enu_from_local @ local_from_inertial
        terms = (
            Term(EXTERIOR_ORIENTATION, self.event, np.concatenate([enu_from_local, of_rotation], axis=2)),
            Term(LEVER_ARM, self.camera, of_arm),
            Term(BORESIGHT, self.camera, of_arm @ turned_arm[self.camera]),
            Term(GNSS_SHIFT, self.flight, enu_from_local),
            *(() if self.motion is None else _motion_terms(self.motion, self.flight, state, enu_from_local)),
        )
        misclosure = np.einsum("nij,nj->ni", enu_from_local, self.observed - computed)
        return Linearization(misclosure, terms)

    def without(self, rejected: Bools) -> Self:
        """The same group with the positions (n,) that are rejected taken out."""
        return replace(self, stochastic=self.stochastic.without(rejected))

    def rescaled(self, factor: Floats) -> Self:
        """The same group with its standard deviations multiplied by factors that broadcast to (n, m)."""
        return replace(self, stochastic=self.stochastic.rescaled(factor))

    def with_correlation_time(self, seconds: float) -> Self:
        """The same group with errors that last so long."""
        return replace(self, stochastic=self.stochastic.with_correlation_time(seconds))


def _along_track(motion: StripMotion, flight: Ints, state: State) -> Floats:
    """What strip bias, drift and time offset add to the positions (n, 3), metres, local frame."""
    added = np.zeros_like(motion.velocity)
    if GNSS_STRIP_BIAS in state.system:
        added += state.system[GNSS_STRIP_BIAS][motion.strip]
    if GNSS_DRIFT in state.system:
        added += state.system[GNSS_DRIFT][motion.strip] * motion.since_middle[:, None]
    if TIME_OFFSET in state.system:
        added += state.system[TIME_OFFSET][flight] * motion.velocity
    return added


def _motion_terms(
    motion: StripMotion, flight: Ints, state: State, enu_from_local: Floats
) -> tuple[Term, ...]:
    """Derivatives with respect to the families that depend on strip and time."""
    velocity = np.einsum("nij,nj->ni", enu_from_local, motion.velocity)[:, :, None]
    terms = (
        Term(GNSS_STRIP_BIAS, motion.strip, enu_from_local),
        Term(GNSS_DRIFT, motion.strip, enu_from_local * motion.since_middle[:, None, None]),
        Term(TIME_OFFSET, flight, velocity),
    )
    return tuple(term for term in terms if term.block in state.system)
