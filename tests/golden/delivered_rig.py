"""A delivered flight of a rig: several heads have the pose of one exposure, from docs/theory/adjustment.md.

R_c = R_e D M_h,  X0 = X_e + R_e (v τ_h + D t_h),  M_h = T_rᵀ R(ρ_h) T_h,  t_h = T_rᵀ p_h,  D = exp(ω τ_h)

with v and ω of the body turned by S = (R_B(b) T_r)ᵀ, in which the boresight b is that of the result and no
unknown.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import pandas as pd

from tests.golden.delivered_block import ANGLES, PLACE, STEP, Array, Delivered, mounting, opk, rpy, turned

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
        """Velocities and rates of the exposures, axes of the aligned reference head, m/s and rad/s."""
        velocity = turned(np.swapaxes(self.local_from_body, 1, 2), self.velocity())
        rate = np.radians(self.given[[f"rate_{axis}" for axis in BODY]].to_numpy())
        boresight = rpy(self.of(self.g, tuple(f"boresight_{axis}" for axis in BODY), self.camera))
        return turned(np.swapaxes(boresight, 1, 2), velocity), turned(np.swapaxes(boresight, 1, 2), rate)

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


def dependence(block: DeliveredRig, x: Array, images: pd.DataFrame, columns: list[int]) -> Array:
    """(6 n, u) Derivatives of the orientations of images, m and rad, by some of the unknowns.

    Parameters
    ----------
    x : all unknowns: poses of the exposures, points, system parameters.
    images : exterior_orientations.parquet.
    """
    event = images["image"].map(block.image_number).to_numpy()
    camera = images["image"].map(block.camera_of_image).tolist()

    def poses(x: Array) -> tuple[Array, Array]:
        n, g = len(block.images), x[-len(block.g) :]
        exposure = x[: 6 * n].reshape(n, 6)
        centre, attitude = block.centre + exposure[:, :3], opk(exposure[:, 3:])
        return block.pose_of_heads(centre[event], attitude[event], g, camera, event)

    centre, r = poses(x)
    angles = np.radians(images[list(ANGLES)].to_numpy())
    np.testing.assert_allclose(images[list(PLACE)], centre, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(opk(angles), r, rtol=0.0, atol=1e-12)
    found = []
    for k in columns:
        moved = x.astype(complex)
        moved[k] += 1j * STEP
        at, turned_to = poses(moved)
        # ω = atan2(−r12, r22), φ = asin(r02), κ = atan2(−r01, r00).
        d, cosine = turned_to.imag / STEP, np.cos(angles[:, 1])
        omega = (d[:, 2, 2] * r[:, 1, 2] - d[:, 1, 2] * r[:, 2, 2]) / cosine**2
        kappa = (d[:, 0, 0] * r[:, 0, 1] - d[:, 0, 1] * r[:, 0, 0]) / cosine**2
        found.append(
            np.hstack([at.imag / STEP, np.column_stack([omega, d[:, 0, 2] / cosine, kappa])]).ravel()
        )
    return np.stack(found, axis=1)
