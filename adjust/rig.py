"""Rigs: several heads on one body, which take the pictures of an event together.

The unknowns of an event are one pose, that of the camera frame of its reference head: (X_e, R_e). Head h
is at t_h and is turned by M_h, both in the camera frame of the reference head,

    R_c = R_e D M_h,    X0 = X_e + R_e (v τ_h + D t_h),    M_h = T_rᵀ R(ρ_h) T_h,    t_h = T_rᵀ p_h

with the nominal mountings T (body from camera) of the reference head r and of head h, the relative rotation
ρ_h = roll, pitch, yaw and the relative position p_h in the axes forward, right, down in which the reference
head is mounted nominally. A head that is exposed τ_h after the moment of the event has its pose as the body
moved meanwhile: D = exp(ω τ_h), with its velocity v and its rates ω in the camera frame of the reference
head. Known are those along and about the axes of the body, v_b and ω_b: with R_e = R_b R_B(b) T_r,

    v = S v_b,    ω = S ω_b,    S = (R_B(b) T_r)ᵀ,

so that R_e v = R_b v_b is the velocity in the local frame. They turn with the event, and know nothing of the
datum. The boresight b in S is a given one while equations are solved, and that of the result when they are
solved again: as an unknown it would be known from the direction of the flight, to a degree, and hide that
nothing else determines it. What image points would add to b is of the size (v τ_h σ_b / σ_X0)², next to
nothing. Derivatives J by (X0, δ_c) of a picture become those by its event and its head:

    J_event = J · [[I, −R_e [v τ_h + D t_h]×], [0, M_hᵀ Dᵀ]],    J_τ = J · [R_e (v + D [ω]× t_h); M_hᵀ ω],
    J_(p, ρ) = J · [[R_e D T_rᵀ, 0], [0, M_hᵀ T_rᵀ E(ρ)]].

No image point notices (R_e G, X_e + R_e g; Gᵀ M_h, Gᵀ (t_h − g)), nor a time that is common to all heads: the
reference head is held at zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.geometry import rotation

RELATIVE_POSITION = "relative_position"
RELATIVE_ROTATION = "relative_rotation"
SYNCHRONISATION_OFFSET = "synchronisation_offset"
#: System parameters of heads, in the order of the seven columns that pictures have for them.
OF_HEADS = (RELATIVE_POSITION, RELATIVE_ROTATION, SYNCHRONISATION_OFFSET)


@dataclass(frozen=True, eq=False)
class Pictures:
    """Poses of pictures, and their dependence on the events.

    Attributes
    ----------
    projection_centre, local_from_camera : (n, 3) metres and (n, 3, 3).
    of_event : (n, 3, 14) −R_e [v τ + D t]×, Mᵀ Dᵀ, R_e D T_rᵀ, Mᵀ T_rᵀ E, R_e (v + D [ω]× t) and Mᵀ ω beside
        each other; None where every picture is an event.
    """

    projection_centre: Floats
    local_from_camera: Floats
    of_event: Floats | None

    def jacobians(self) -> tuple[Floats, Floats]:
        """Derivatives of the poses (X0, δ_c): by those of the events (n, 6, 6), by (p, ρ, τ) (n, 6, 7)."""
        n = len(self.projection_centre)
        of_event, of_head = np.zeros((n, 6, 6)), np.zeros((n, 6, 7))
        of_event[:, :3, :3] = of_event[:, 3:, 3:] = np.eye(3)
        if self.of_event is not None:
            of_event[:, :3, 3:], of_event[:, 3:, 3:] = self.of_event[:, :, :3], self.of_event[:, :, 3:6]
            of_head[:, :3, :3], of_head[:, 3:, 3:6] = self.of_event[:, :, 6:9], self.of_event[:, :, 9:12]
            of_head[:, :3, 6], of_head[:, 3:, 6] = self.of_event[:, :, 12], self.of_event[:, :, 13]
        return of_event, of_head


@dataclass(frozen=True, eq=False)
class EventMotion:
    """How the body moved at the moments of the events, along and about its axes forward, right, down.

    Attributes
    ----------
    velocity : (e, 3) metres per second.
    rate : (e, 3) radians per second; zero where not known.
    boresight : (c, 3) b of S for each camera, radians; None: that of the state.
    """

    velocity: Floats
    rate: Floats
    boresight: Floats | None = None


@dataclass(frozen=True, eq=False)
class Rig:
    """Which head took every picture of every event.

    Attributes
    ----------
    events : names of the e events.
    event_of_image, camera_of_image : (n,) event and head (index of the camera) of every picture.
    reference : (c,) reference head of the body on which each camera is; a camera alone is its own.
    body_from_camera : (c, 3, 3) nominal mountings T.
    motion : velocities and rates at the events; None: synchronisation offsets move nothing.
    """

    events: tuple[str, ...]
    event_of_image: Ints
    camera_of_image: Ints
    reference: Ints
    body_from_camera: Floats
    motion: EventMotion | None = None

    @property
    def camera_of_event(self) -> Ints:
        """(e,) reference head of every event."""
        found = np.full(len(self.events), -1, dtype=np.int64)
        found[self.event_of_image] = self.reference[self.camera_of_image]
        return found

    @property
    def is_reference(self) -> Bools:
        """(c,) cameras that are reference heads."""
        return np.asarray(self.reference == np.arange(len(self.reference)))

    @property
    def joined_heads(self) -> Bools:
        """(c,) cameras that take pictures together with other heads of their rig."""
        taken = np.isin(np.arange(len(self.reference)), self.camera_of_image)
        heads = np.bincount(self.reference[taken], minlength=len(self.reference))
        return np.asarray(taken & (heads[self.reference] > 1))

    def moving_by(self, boresight: Floats) -> Rig:
        """The same rig with this boresight (c, 3) in S; itself without motion."""
        return (
            self if self.motion is None else replace(self, motion=replace(self.motion, boresight=boresight))
        )

    def pictures(
        self,
        projection_centre: Floats,
        local_from_camera: Floats,
        system: Mapping[str, Floats],
        boresight: Floats,
    ) -> Pictures:
        """Poses of the pictures from those of the events, (e, 3) and (e, 3, 3), and the heads' parameters.

        Parameters
        ----------
        boresight : (c, 3) of the state.
        """
        heads, camera, event = self._heads(system), self.camera_of_image, self.event_of_image
        r_e = local_from_camera[event]
        position, turn, axes, of_rotation = (part[camera] for part in heads)
        turned = np.swapaxes(turn, 1, 2)
        later, of_turn, arm, of_offset = r_e, turned, position, np.zeros((len(event), 3, 2))
        if self.motion is not None:
            offset = system[SYNCHRONISATION_OFFSET][camera]
            own = boresight if self.motion.boresight is None else self.motion.boresight
            aligned = np.swapaxes(rotation.from_roll_pitch_yaw(own), 1, 2)[self.reference[camera]]
            velocity, rate = (
                np.einsum("nij,nj->ni", axes @ aligned, known[event])
                for known in (self.motion.velocity, self.motion.rate)
            )
            meanwhile = rotation.exp(rate * offset)
            later, of_turn = r_e @ meanwhile, turned @ np.swapaxes(meanwhile, 1, 2)
            arm = velocity * offset + np.einsum("nij,nj->ni", meanwhile, position)
            faster = velocity + np.einsum("nij,nj->ni", meanwhile, np.cross(rate, position))
            of_offset[:, :, 0] = np.einsum("nij,nj->ni", r_e, faster)
            of_offset[:, :, 1] = np.einsum("nij,nj->ni", turned, rate)
        of_event = np.concatenate(
            [-r_e @ rotation.cross_matrix(arm), of_turn, later @ axes, turned @ of_rotation, of_offset],
            axis=2,
        )
        return Pictures(
            projection_centre[event] + np.einsum("nij,nj->ni", r_e, arm),
            np.ascontiguousarray(later @ turn),
            np.ascontiguousarray(of_event),
        )

    def _heads(self, system: Mapping[str, Floats]) -> tuple[Floats, Floats, Floats, Floats]:
        """For each camera t (c, 3), M, T_rᵀ and T_rᵀ E(ρ), (c, 3, 3) each."""
        angles = system[RELATIVE_ROTATION]
        axes = np.swapaxes(self.body_from_camera[self.reference], 1, 2)
        turn = axes @ rotation.from_roll_pitch_yaw(angles) @ self.body_from_camera
        position = np.einsum("cij,cj->ci", axes, system[RELATIVE_POSITION])
        return position, turn, axes, axes @ rotation.roll_pitch_yaw_jacobian(angles)
