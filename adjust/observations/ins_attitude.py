"""INS attitudes at the moments of exposure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from adjust.arrays import Bools, Floats, Ints, as_sigmas, require_shape
from adjust.errors import InconsistentBlockError
from adjust.geometry import rotation
from adjust.observations.base import Linearization, StochasticModel, Term, require_rows, require_values
from adjust.observations.gnss_position import StripMotion
from adjust.parameters import (
    BORESIGHT,
    EXTERIOR_ORIENTATION,
    INS_DRIFT,
    INS_STRIP_BIAS,
    TIME_OFFSET,
    State,
    Unit,
)
from adjust.unknown_names import indices_of

if TYPE_CHECKING:
    from adjust.block import Block


@dataclass(frozen=True, eq=False)
class BodyRates:
    """How the body turns at the moments of exposure.

    Attributes
    ----------
    flight : (n,) index of the flight, whose time offset they go with.
    rate : (n, 3) radians per second about the body axes forward, right, down; zero where not known.
    """

    flight: Ints
    rate: Floats


@dataclass(frozen=True, eq=False)
class InsAttitudes:
    """Attitudes of the inertial measurement unit.

    The observation is zero when

        log( R_INSᵀ · R_b · exp(ω Δt_f) ) + γ_k + e_k (t − t_k) = 0,    R_b = R_c · Tᵀ · R_B(b)ᵀ

    a rotation vector in body axes: roll, pitch, yaw errors. R_INS is local from body as observed,
    R_c local from camera, T the nominal mounting, b the boresight misalignment, ω the rates of the body and
    Δt the time offset of flight f, by which the trajectory was read too late; it turns nothing without rates.
    γ and e are the bias and the drift of strip k about its mid time t_k: errors of the observed attitude
    about the body axes.

    Attributes
    ----------
    event : (n,) index of the event.
    camera : (n,) index of its camera (mounting; of a rig the reference head).
    observed : (n, 3, 3) local from body (forward, right, down).
    body_from_camera : (n, 3, 3) nominal mounting T.
    stochastic : components roll, pitch, yaw in radians, small rotations in body axes.
    turning : rates of the body; without them a time offset acts on positions alone.
    motion : strips and times; without them there is no strip bias or drift.
    """

    event: Ints
    camera: Ints
    observed: Floats
    body_from_camera: Floats
    stochastic: StochasticModel
    turning: BodyRates | None = None
    motion: StripMotion | None = None

    name: ClassVar[str] = "ins_attitudes"
    components: ClassVar[tuple[str, ...]] = ("roll", "pitch", "yaw")
    unit: ClassVar[Unit] = "rad"

    def __post_init__(self) -> None:
        require_rows(self, ("event", "camera"), observed=(3, 3), body_from_camera=(3, 3))
        require_values(self, rotation.are_rotations(self.observed)[:, None], "rotation matrix")

    @classmethod
    def measured(cls, block: Block, image: ArrayLike, observed: ArrayLike, sigma: ArrayLike) -> Self:
        """Attitudes of a block, without times and rates.

        Parameters
        ----------
        image : (n,) names, or indices, of its images; of a rig of its events.
        observed : (n, 3, 3) local from body (forward, right, down); of a rotation of the camera
            ``local_from_camera @ camera.body_from_camera.T``.
        sigma : roll, pitch, yaw, radians; a number, or an array that broadcasts to (n, 3).

        Raises
        ------
        InconsistentBlockError : of other shapes or values, or of axes other than those of the body.
        UnknownNameError : the block has no such image.
        """
        index = indices_of("image" if block.rig is None else "event", image, block.events)
        attitude = np.asarray(observed, dtype=np.float64)
        require_shape("The array of attitudes", attitude.shape, (len(index), 3, 3))
        weights = StochasticModel.from_sigma(as_sigmas(sigma, (len(index), 3)))
        approximate = block.local_from_camera[index] @ np.swapaxes(block.body_from_camera[index], 1, 2)
        cosine = 0.5 * (np.einsum("nij,nij->n", approximate, attitude) - 1.0)
        if len(index) and np.median(cosine) < 0.0:
            turned = np.rad2deg(np.arccos(np.clip(np.median(cosine), -1.0, 1.0)))
            raise InconsistentBlockError(
                f"The attitudes are turned by {turned:.0f}° (median) relative to the approximate rotations "
                "of the images. They are local from body (forward, right, down): of a rotation of the camera "
                "local_from_camera @ camera.body_from_camera.T."
            )
        return cls(index, block.camera_of_event[index], attitude, block.body_from_camera[index], weights)

    @property
    def point(self) -> Ints:
        """−1 for every attitude: it belongs to no object point."""
        return np.full(len(self.event), -1, dtype=np.int64)

    def linearize(self, state: State) -> Linearization:
        """Observation equations at a state.

        With v = log M and M = R_INSᵀ R_c Tᵀ R_Bᵀ D, D = exp(ω Δt), a small rotation δ of the camera turns M
        into M · exp(Dᵀ R_B T δ), a change of the boresight into M · exp(−Dᵀ E db) and one of the time offset
        into M · exp(ω dΔt), so all derivatives carry J_r⁻¹(v) and are exact.
        """
        boresight = state.system[BORESIGHT]  # of the few cameras, not of each event
        inertial_from_camera = rotation.from_roll_pitch_yaw(boresight)[self.camera] @ self.body_from_camera
        difference = (
            np.swapaxes(self.observed, 1, 2)
            @ state.local_from_camera[self.event]
            @ np.swapaxes(inertial_from_camera, 1, 2)
        )
        turned = self._turned(state.system)
        computed = rotation.log(difference if turned is None else difference @ turned)
        inverse = rotation.right_jacobian_inverse(computed)
        of_body = inverse if turned is None else inverse @ np.swapaxes(turned, 1, 2)
        of_rotation = of_body @ inertial_from_camera
        exterior = np.concatenate([np.zeros_like(of_rotation), of_rotation], axis=2)
        of_boresight = -of_body @ rotation.roll_pitch_yaw_jacobian(boresight)[self.camera]
        terms = [
            Term(EXTERIOR_ORIENTATION, self.event, exterior),
            Term(BORESIGHT, self.camera, of_boresight),
        ]
        if self.turning is not None and turned is not None:
            terms.append(Term(TIME_OFFSET, self.turning.flight, inverse @ self.turning.rate[:, :, None]))
        along, of_strips = _along_strip(self.motion, state)
        return Linearization(-computed - along, (*terms, *of_strips))

    def at_exposure(self, system: Mapping[str, Floats]) -> Floats:
        """Attitudes local from body (n, 3, 3) at the exposures: the observed ones less the time offset."""
        turned = self._turned(system)
        return self.observed if turned is None else self.observed @ np.swapaxes(turned, 1, 2)

    def _turned(self, system: Mapping[str, Floats]) -> Floats | None:
        """exp(ω Δt) (n, 3, 3); None without rates or time offset."""
        if self.turning is None or TIME_OFFSET not in system:
            return None
        return rotation.exp(self.turning.rate * system[TIME_OFFSET][self.turning.flight])

    def without(self, rejected: Bools) -> Self:
        """The same group with the attitudes (n,) that are rejected taken out."""
        return replace(self, stochastic=self.stochastic.without(rejected))

    def rescaled(self, factor: Floats) -> Self:
        """The same group with its standard deviations multiplied by factors that broadcast to (n, m)."""
        return replace(self, stochastic=self.stochastic.rescaled(factor))

    def with_correlation_time(self, seconds: float) -> Self:
        """The same group with errors that last so long."""
        return replace(self, stochastic=self.stochastic.with_correlation_time(seconds))


def _along_strip(motion: StripMotion | None, state: State) -> tuple[Floats | float, tuple[Term, ...]]:
    """Bias and drift of the strips (n, 3), radians in body axes, and the derivatives by them."""
    if motion is None:
        return 0.0, ()
    added, terms = np.zeros((len(motion.strip), 3)), []
    one = np.broadcast_to(np.eye(3), (len(motion.strip), 3, 3))
    since = motion.since_middle
    for family, factor in ((INS_STRIP_BIAS, np.ones_like(since)), (INS_DRIFT, since)):
        if family in state.system:
            added += state.system[family][motion.strip] * factor[:, None]
            terms.append(Term(family, motion.strip, one * factor[:, None, None]))
    return added, tuple(terms)
