"""GNSS positions of the antenna at the moments of exposure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal, Self

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.geometry import rotation
from adjust.observations.base import Linearization, StochasticModel, Term
from adjust.parameters import BORESIGHT, EXTERIOR_ORIENTATION, GNSS_SHIFT, LEVER_ARM, State


@dataclass(frozen=True, eq=False)
class GnssPositions:
    """Positions of the GNSS antenna.

    The observation is zero when, in the axes C (east, north, up at the exposure),

        C · (X0 + R_b · l + s − A) = 0,    R_b = R_c · Tᵀ · R_B(b)ᵀ

    with the projection centre X0, the lever arm l in body axes (forward, right, down), the shift s of
    the flight in local axes and the observed position A. If what is delivered has been reduced to
    the projection centre already, l is what the reduction left over.

    Attributes
    ----------
    image : (n,) index of the image.
    camera, flight : (n,) index of its camera (mounting) and flight.
    observed : (n, 3) metres, local frame.
    local_from_enu : (n, 3, 3) axes in which the components are given and weighted.
    body_from_camera : (n, 3, 3) nominal mounting T.
    stochastic : components east, north, up.
    """

    image: Ints
    camera: Ints
    flight: Ints
    observed: Floats
    local_from_enu: Floats
    body_from_camera: Floats
    stochastic: StochasticModel

    name: ClassVar[str] = "gnss_positions"
    components: ClassVar[tuple[str, ...]] = ("x", "y", "z")
    unit: ClassVar[Literal["m", "rad"]] = "m"

    @property
    def point(self) -> Ints:
        """−1 for every position: it belongs to no object point."""
        return np.full(len(self.image), -1, dtype=np.int64)

    def linearize(self, state: State) -> Linearization:
        """Observation equations at a state; all derivatives exact."""
        boresight = state.system[BORESIGHT][self.camera]
        lever_arm = state.system[LEVER_ARM][self.camera]
        shift = state.system[GNSS_SHIFT][self.flight]
        local_from_camera = state.local_from_camera[self.image]
        inertial_from_body = rotation.from_roll_pitch_yaw(boresight)
        camera_from_inertial = np.swapaxes(inertial_from_body @ self.body_from_camera, 1, 2)
        local_from_inertial = local_from_camera @ camera_from_inertial
        arm_in_camera = np.einsum("nij,nj->ni", camera_from_inertial, lever_arm)
        arm_in_local = np.einsum("nij,nj->ni", local_from_camera, arm_in_camera)
        computed = state.projection_centre[self.image] + arm_in_local + shift

        enu_from_local = np.swapaxes(self.local_from_enu, 1, 2)
        of_rotation = -enu_from_local @ local_from_camera @ rotation.cross_matrix(arm_in_camera)
        of_boresight = (
            enu_from_local
            @ local_from_inertial
            @ rotation.cross_matrix(lever_arm)
            @ rotation.roll_pitch_yaw_jacobian(boresight)
        )
        terms = (
            Term(EXTERIOR_ORIENTATION, self.image, np.concatenate([enu_from_local, of_rotation], axis=2)),
            Term(LEVER_ARM, self.camera, enu_from_local @ local_from_inertial),
            Term(BORESIGHT, self.camera, of_boresight),
            Term(GNSS_SHIFT, self.flight, enu_from_local),
        )
        misclosure = np.einsum("nij,nj->ni", enu_from_local, self.observed - computed)
        return Linearization(misclosure, terms)

    def without(self, rejected: Bools) -> Self:
        """The same group with the positions (n,) that are rejected taken out."""
        return replace(self, stochastic=self.stochastic.without(rejected))
