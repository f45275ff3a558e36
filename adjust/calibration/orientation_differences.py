"""Adjusted minus observed orientations, the input of the second step of a two-step calibration.

    θ_i = Log(R_INS,iᵀ R_AT,i Tᵀ)            roll, pitch, yaw of the misalignment that image i shows
    o_i = A_i − X0_i                          observed minus adjusted position
    l_i = R_INS,iᵀ o_i                        the same in body axes: lever arm
    s_i = R_enu,iᵀ (o_i − R_INS,i l_given)    what the given lever arm leaves, along east, north, up: shift

θ is a rotation vector; up to 0.3° it differs from the angles roll, pitch, yaw by less than 0.001°, and
`misalignment_angles` turns a mean of it into them exactly. The signs are those of docs/conventions.md:
R_c = R_INS R_B T, antenna = X0 + R_b l + s.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.errors import InconsistentBlockError
from adjust.geometry import rotation

#: Names of the nine components, in their order; radians the first three, metres the others.
COMPONENTS = ("roll", "pitch", "yaw", "forward", "right", "down", "east", "north", "up")
MISALIGNMENT, LEVER_ARM, SHIFT = slice(0, 3), slice(3, 6), slice(6, 9)


@dataclass(frozen=True, slots=True, eq=False)
class OrientationPairs:
    """Adjusted and observed orientations of n images, in one Cartesian frame.

    Attributes
    ----------
    projection_centre : (n, 3) adjusted, metres, local frame.
    local_from_camera : (n, 3, 3) adjusted.
    position : (n, 3) observed, metres, local frame.
    local_from_body : (n, 3, 3) observed, R_INS.
    body_from_camera : (n, 3, 3) nominal mounting T.
    local_from_enu : (n, 3, 3) east, north, up at the exposures.
    """

    projection_centre: Floats
    local_from_camera: Floats
    position: Floats
    local_from_body: Floats
    body_from_camera: Floats
    local_from_enu: Floats


@dataclass(frozen=True, slots=True, eq=False)
class OrientationDifferences:
    """Boresight and offset indicated by each of n images.

    Attributes
    ----------
    misalignment : (n, 3) rotation vectors θ in body axes (roll, pitch, yaw), radians.
    lever_arm : (n, 3) metres, body axes (forward, right, down).
    shift : (n, 3) metres, along east, north, up.
    strip : (n,) number of the strip, 0 … strips − 1.
    flight : (n,) number of the flight, 0 … flights − 1.
    place : (n,) time in seconds or, if unknown, number of the exposure: the order within a strip.
    heading : (n,) radians, clockwise from north.
    height : (n,) metres.
    covariance : (n, 9, 9) of the components in rad and m, adjusted and observed together; None: not known.
    """

    misalignment: Floats
    lever_arm: Floats
    shift: Floats
    strip: Ints
    flight: Ints
    place: Floats
    heading: Floats
    height: Floats
    covariance: Floats | None = None

    @property
    def components(self) -> Floats:
        """(n, 9) in the order of `COMPONENTS`."""
        return np.hstack([self.misalignment, self.lever_arm, self.shift])

    def only(self, kept: Bools) -> OrientationDifferences:
        """Only the selected images (n,); strips and flights keep their numbers."""
        return replace(
            self,
            misalignment=self.misalignment[kept],
            lever_arm=self.lever_arm[kept],
            shift=self.shift[kept],
            strip=self.strip[kept],
            flight=self.flight[kept],
            place=self.place[kept],
            heading=self.heading[kept],
            height=self.height[kept],
            covariance=None if self.covariance is None else self.covariance[kept],
        )


def orientation_differences(
    pairs: OrientationPairs,
    strip: Ints,
    flight: Ints,
    place: Floats,
    height: Floats,
    pair_covariance: Floats | None = None,
    given_lever_arm: Floats | None = None,
) -> OrientationDifferences:
    """Misalignment and offset that each image shows.

    Parameters
    ----------
    strip, flight, place, height : (n,) see `OrientationDifferences`.
    pair_covariance : (n, 6, 6) of the differences as they stand: small rotation in body axes (rad), then
        position in the local frame (m); adjusted and observed together. None: not known.
    given_lever_arm : (3,) known beforehand, metres, body axes; None: none. The shift is what it leaves.

    Raises
    ------
    InconsistentBlockError
        If there is no pair, or one is not finite.
    """
    offset = pairs.position - pairs.projection_centre
    if len(offset) == 0:
        raise InconsistentBlockError("There is no image with an adjusted and an observed orientation.")
    body_from_local = np.swapaxes(pairs.local_from_body, 1, 2)
    camera_from_body = np.swapaxes(pairs.body_from_camera, 1, 2)
    misalignment = rotation.log(body_from_local @ pairs.local_from_camera @ camera_from_body)
    if not (np.isfinite(offset).all() and np.isfinite(misalignment).all()):
        raise InconsistentBlockError("An adjusted or observed orientation is not complete.")
    by_lever_arm = pairs.local_from_body @ (np.zeros(3) if given_lever_arm is None else given_lever_arm)
    enu_from_local = np.swapaxes(pairs.local_from_enu, 1, 2)
    forward = np.einsum("nij,nj->ni", enu_from_local, pairs.local_from_body[:, :, 0])
    return OrientationDifferences(
        misalignment=misalignment,
        lever_arm=np.einsum("nij,nj->ni", body_from_local, offset),
        shift=np.einsum("nij,nj->ni", enu_from_local, offset - by_lever_arm),
        strip=strip,
        flight=flight,
        place=place,
        heading=np.arctan2(forward[:, 0], forward[:, 1]),
        height=height,
        covariance=_propagated(pair_covariance, body_from_local, enu_from_local),
    )


def _propagated(pair: Floats | None, body_from_local: Floats, enu_from_local: Floats) -> Floats | None:
    """Covariance (n, 9, 9) of the components from that of rotation and position (n, 6, 6)."""
    if pair is None:
        return None
    jacobian = np.zeros((len(pair), 9, 6))
    jacobian[:, :3, :3] = np.eye(3)
    jacobian[:, 3:6, 3:] = body_from_local
    jacobian[:, 6:, 3:] = enu_from_local
    return np.asarray(jacobian @ pair @ np.swapaxes(jacobian, 1, 2))


def misalignment_angles(vector: Floats) -> Floats:
    """Roll, pitch, yaw (..., 3) of R_B = R_z(yaw) R_y(pitch) R_x(roll) = Exp(vector), radians."""
    return rotation.to_heading_pitch_roll(rotation.exp(vector))[..., ::-1]
