"""A delivered flight of a rig: several heads have the pose of one exposure, from docs/theory/adjustment.md.

R_c = R_e D M_h,  X0 = X_e + R_e (v τ_h + D t_h),  M_h = T_rᵀ R(ρ_h) T_h,  t_h = T_rᵀ p_h,  D = exp(ω τ_h)
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from tests.golden.delivered_block import Array, Delivered, mounting, rpy, turned

BODY = ("roll", "pitch", "yaw")


class DeliveredRig(Delivered):
    """The exposures are those of the reference head; images at one time of a strip are one event."""

    def exposure_of(self, images: list[str]) -> dict[str, str]:
        own = self.given.loc[images]
        event = list(zip(own["strip"], own["time"], strict=True))
        heads = self.project["cameras"]
        reference = {
            key: name
            for key, name, camera in zip(event, images, own["camera"], strict=True)
            if "head" not in heads[camera]
        }
        return {name: reference[key] for name, key in zip(images, event, strict=True)}

    @cached_property
    def motion(self) -> tuple[Array, Array]:
        """Velocities and rates of the exposures, forward, right, down, m/s and rad/s."""
        velocity = turned(np.swapaxes(self.local_from_body, 1, 2), self.velocity())
        return velocity, np.radians(self.given[[f"rate_{axis}" for axis in BODY]].to_numpy())

    def pose_of_rays(self, centre: Array, r: Array, g: Array) -> tuple[Array, Array]:
        return self.pose_of_heads(centre, r, g, self.ray_camera, self.ray_image)

    def pose_of_heads(
        self, centre: Array, r: Array, g: Array, camera: list[str], exposure: Array
    ) -> tuple[Array, Array]:
        """Projection centres and local_from_camera of heads (n,), from the poses of their exposures."""
        position = self.of(g, tuple(f"relative_position_{axis}" for axis in "xyz"), camera)
        rotation = rpy(self.of(g, tuple(f"relative_rotation_{axis}" for axis in BODY), camera))
        offset = self.of(g, ("synchronisation_offset",), camera)
        velocity, rate = (part[exposure] for part in self.motion)
        of_reference = mounting(0)  # all cameras are mounted alike
        meanwhile = small_exp(turned(of_reference.T, rate) * offset)
        turn = of_reference.T @ rotation @ of_reference
        arm = turned(of_reference.T, velocity) * offset + turned(meanwhile, turned(of_reference.T, position))
        return centre + turned(r, arm), r @ meanwhile @ turn


def small_exp(vector: Array) -> Array:
    """Rotation matrices (n, 3, 3) of small rotation vectors, also complex."""
    x, y, z = vector.T
    nil = np.zeros_like(x)
    k = np.array([[nil, -z, y], [z, nil, -x], [-y, x, nil]]).transpose(2, 0, 1)
    return np.asarray(np.eye(3) + k + k @ k / 2.0 + k @ k @ k / 6.0)
