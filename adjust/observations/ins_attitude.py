"""INS attitudes at the moments of exposure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.geometry import rotation
from adjust.observations.base import Linearization, StochasticModel, Term
from adjust.parameters import BORESIGHT, EXTERIOR_ORIENTATION, State, Unit


@dataclass(frozen=True, eq=False)
class InsAttitudes:
    """Attitudes of the inertial measurement unit.

    The observation is zero when

        log( R_INSᵀ · R_c · Tᵀ · R_B(b)ᵀ ) = 0

    a rotation vector in body axes: roll, pitch, yaw errors. R_INS is local from body as observed,
    R_c local from camera, T the nominal mounting, b the boresight misalignment.

    Attributes
    ----------
    image : (n,) index of the image.
    camera : (n,) index of its camera (mounting).
    observed : (n, 3, 3) local from body (forward, right, down).
    body_from_camera : (n, 3, 3) nominal mounting T.
    stochastic : components roll, pitch, yaw in radians, small rotations in body axes.
    """

    image: Ints
    camera: Ints
    observed: Floats
    body_from_camera: Floats
    stochastic: StochasticModel

    name: ClassVar[str] = "ins_attitudes"
    components: ClassVar[tuple[str, ...]] = ("roll", "pitch", "yaw")
    unit: ClassVar[Unit] = "rad"

    @property
    def point(self) -> Ints:
        """−1 for every attitude: it belongs to no object point."""
        return np.full(len(self.image), -1, dtype=np.int64)

    def linearize(self, state: State) -> Linearization:
        """Observation equations at a state.

        With v = log M and M = R_INSᵀ R_c Tᵀ R_Bᵀ, a small rotation δ of the camera turns M into
        M · exp(R_B T δ) and a change of the boresight into M · exp(−E db), so both derivatives
        carry J_r⁻¹(v) and are exact.
        """
        boresight = state.system[BORESIGHT][self.camera]
        inertial_from_camera = rotation.from_roll_pitch_yaw(boresight) @ self.body_from_camera
        difference = (
            np.swapaxes(self.observed, 1, 2)
            @ state.local_from_camera[self.image]
            @ np.swapaxes(inertial_from_camera, 1, 2)
        )
        computed = rotation.log(difference)
        inverse = rotation.right_jacobian_inverse(computed)
        of_rotation = inverse @ inertial_from_camera
        exterior = np.concatenate([np.zeros_like(of_rotation), of_rotation], axis=2)
        of_boresight = -inverse @ rotation.roll_pitch_yaw_jacobian(boresight)
        terms = (
            Term(EXTERIOR_ORIENTATION, self.image, exterior),
            Term(BORESIGHT, self.camera, of_boresight),
        )
        return Linearization(-computed, terms)

    def without(self, rejected: Bools) -> Self:
        """The same group with the attitudes (n,) that are rejected taken out."""
        return replace(self, stochastic=self.stochastic.without(rejected))

    def rescaled(self, factor: Floats) -> Self:
        """The same group with its standard deviations multiplied by factors that broadcast to (n, m)."""
        return replace(self, stochastic=self.stochastic.rescaled(factor))

    def with_correlation_time(self, seconds: float) -> Self:
        """The same group with errors that last so long."""
        return replace(self, stochastic=self.stochastic.with_correlation_time(seconds))
