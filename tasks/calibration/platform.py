"""The heads of a platform that takes no pictures, from the relative rotations of an adjusted flight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy import special

from adjust.arrays import Floats
from adjust.calibration.platform import covariance_with_mean_rotation, with_mean_rotation
from adjust.camera.virtual_image import PlatformHeads
from adjust.geometry import rotation
from tasks.deliveries.cameras import frame_cameras
from tasks.tables.covariance import Key, correlation_pairs, covariance_of, sigmas_of

_ROTATION = tuple(f"relative_rotation_{name}" for name in ("roll", "pitch", "yaw"))
_INTERIOR = ("focal_length", "principal_point_x", "principal_point_y")
_BODY = ("roll", "pitch", "yaw")


@dataclass(frozen=True, eq=False)
class AdjustedPlatform:
    """A platform with h heads as it was adjusted.

    Attributes
    ----------
    name : of the camera that stands for it; its image is the virtual one.
    head : names of the heads.
    given, adjusted : the heads; their mean rotation against each other is zero.
    half_format : (2,) half the sides of the virtual image, metres.
    covariance : (3h, 3h) of the small rotations of the heads, axes of the platform, radians².
    distance : mean height above ground, metres.
    """

    name: str
    head: tuple[str, ...]
    given: PlatformHeads
    adjusted: PlatformHeads
    half_format: Floats
    covariance: Floats
    distance: float

    @property
    def change(self) -> Floats:
        """(h, 3) small rotations against the given heads, radians."""
        turned = self.adjusted.platform_from_head @ np.swapaxes(self.given.platform_from_head, 1, 2)
        return np.asarray(rotation.log(turned))

    @property
    def probability(self) -> Floats:
        """(h,) probability that a change of each head is as large by chance."""
        found = []
        for head, change in enumerate(self.change):
            own = slice(3 * head, 3 * head + 3)
            size = change @ np.linalg.solve(self.covariance[own, own], change)
            found.append(special.chdtrc(3, size))
        return np.array(found)

    def angles(self) -> tuple[Floats, Floats]:
        """Omega, phi, kappa (h, 3), radians, and their joint covariance (3h, 3h)."""
        turn = self.adjusted.platform_from_head
        angles = rotation.to_omega_phi_kappa(turn)
        # δ of the head, R exp(δ), is Mᵀ μ of the platform.
        of_small = np.linalg.inv(rotation.omega_phi_kappa_jacobian(angles)) @ np.swapaxes(turn, 1, 2)
        heads = len(self.head)
        joint = self.covariance.reshape(heads, 3, heads, 3)
        turned = np.einsum("aij,ajbk,blk->aibl", of_small, joint, of_small)
        return np.asarray(angles), np.asarray(turned.reshape(3 * heads, 3 * heads))


def adjusted_platforms(
    parameters: pd.DataFrame, correlations: pd.DataFrame, cameras: pd.DataFrame, images: pd.DataFrame
) -> Iterator[AdjustedPlatform]:
    """Platforms that take no pictures and have at least two heads, all with estimated relative rotations.

    Parameters
    ----------
    parameters, correlations, cameras, images : the tables of these names.
    """
    taken = set(images["camera"])
    sigmas, pairs = sigmas_of(parameters), correlation_pairs(correlations)
    values = parameters.set_index(["parameter", "entity"])["value"]
    for name, heads in cameras[cameras["head_of"].notna()].groupby("head_of"):
        keys: list[Key] = [(parameter, head) for head in heads["camera"] for parameter in _ROTATION]
        if str(name) in taken or len(heads) < 2 or not all(key in sigmas for key in keys):
            continue
        found = np.deg2rad(np.array([values[key] for key in keys]).reshape(-1, 3))
        known = heads[[f"relative_rotation_{axis}_deg" for axis in _BODY]].to_numpy(np.float64)
        height = images.loc[images["camera"].isin(heads["camera"]), "height_above_ground_m"].mean()
        yield _platform(
            cameras[cameras["camera"] == name], heads, np.deg2rad(known), found,
            np.array([[values[name, head] for name in _INTERIOR] for head in heads["camera"]]) * 1e-3,
            np.deg2rad(np.deg2rad(covariance_of(keys, sigmas, pairs))), float(height),
        )  # fmt: skip


def _platform(
    own: pd.DataFrame,
    heads: pd.DataFrame,
    known: Floats,
    found: Floats,
    interior: Floats,
    covariance: Floats,
    distance: float,
) -> AdjustedPlatform:
    """From roll, pitch, yaw (h, 3) as known and as found, radians, with the covariance of the latter.

    `interior` (h, 3): c, x0, y0 as found, metres.
    """
    (platform,) = frame_cameras(own).values()
    cameras = tuple(frame_cameras(heads).values())
    axes = platform.body_from_camera.T
    mounting = np.stack([camera.body_from_camera for camera in cameras])
    position = heads[[f"relative_position_{axis}_m" for axis in "xyz"]].to_numpy(np.float64) @ axes.T
    given = axes @ rotation.from_roll_pitch_yaw(known) @ mounting
    adjusted = with_mean_rotation(axes @ rotation.from_roll_pitch_yaw(found) @ mounting, given)
    of_small = axes @ rotation.roll_pitch_yaw_jacobian(found)
    count = len(cameras)
    joint = np.einsum("aij,ajbk,blk->aibl", of_small, covariance.reshape(count, 3, count, 3), of_small)
    certified = np.array([[camera.focal_length, *camera.principal_point] for camera in cameras])
    half_format = np.array([camera.half_format for camera in cameras])

    def with_attitudes(turn: Floats, interior: Floats) -> PlatformHeads:
        return PlatformHeads(turn, position, interior, half_format, platform.focal_length)

    return AdjustedPlatform(
        platform.name,
        tuple(camera.name for camera in cameras),
        with_attitudes(given, certified),
        with_attitudes(adjusted, interior),
        np.array(platform.half_format),
        covariance_with_mean_rotation(joint.reshape(3 * count, 3 * count)),
        distance,
    )
