"""A network: where exposures, points and rays are and how well they are observed, without any measurement.

Standard deviations before an adjustment depend on nothing else: N = AᵀPA is known from the geometry and the
weights alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.camera.additional.base import ImageFormat
from adjust.camera.interior import FrameCamera
from adjust.geometry import rotation
from adjust.geometry.earth import LocalFrame
from adjust.parameters import BORESIGHT, INTERIOR_ORIENTATION, LEVER_ARM, State
from adjust.rig import Rig


@dataclass(frozen=True, eq=False)
class PlannedExposures:
    """n exposures and how well their positions and attitudes are observed.

    Those of a rig are its events, and their camera is the reference head.

    Attributes
    ----------
    camera, flight, strip : (n,) indices.
    time : (n,) seconds.
    velocity : (n, 3) m/s, local frame.
    rate : (n, 3) rad/s about the body axes; zero where not known.
    projection_centre : (n, 3) metres, local frame.
    local_from_camera : (n, 3, 3).
    position_sigma : (n, 3) metres, along the axes below; NaN where no position is observed.
    local_from_axes : (n, 3, 3) axes in which the positions are weighted.
    attitude_covariance : (n, 3, 3) in body axes, rad².
    attitude_observed : (n,) whether there is an attitude.
    """

    camera: Ints
    flight: Ints
    strip: Ints
    time: Floats
    velocity: Floats
    rate: Floats
    projection_centre: Floats
    local_from_camera: Floats
    position_sigma: Floats
    local_from_axes: Floats
    attitude_covariance: Floats
    attitude_observed: Bools

    def __len__(self) -> int:
        return len(self.camera)

    def joined(self, other: PlannedExposures) -> PlannedExposures:
        """These exposures and others after them."""
        names = self.__dataclass_fields__
        return PlannedExposures(
            **{name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in names}
        )


@dataclass(frozen=True, eq=False)
class PlannedControl:
    """k control points.

    Attributes
    ----------
    point : (k,) index of the object point.
    covariance : (k, 3, 3) along east, north, up, m².
    present : (k, 3) which of the three are known.
    """

    point: Ints
    covariance: Floats
    present: Bools


@dataclass(frozen=True, eq=False)
class PlannedDistances:
    """k distances between object points.

    Attributes
    ----------
    point, other_point : (k,) indices of the object points.
    sigma : (k,) metres.
    """

    point: Ints
    other_point: Ints
    sigma: Floats


@dataclass(frozen=True, eq=False)
class PlannedRays:
    """r rays, sorted by object point, then image.

    Attributes
    ----------
    image, point : (r,) indices; without a rig every exposure is one image.
    sigma : (r, 2) metres.
    """

    image: Ints
    point: Ints
    sigma: Floats


@dataclass(frozen=True, eq=False)
class PlannedNetwork:
    """The network.

    Attributes
    ----------
    frame : the local frame.
    cameras : the cameras.
    flights, strips : names.
    exposures, rays, control, distances : what is observed.
    object_point : (m, 3) metres, local frame.
    system : values of the interior orientation, boresight and lever arm of every camera, with a rig also
        relative positions and rotations and synchronisation offsets of the heads, SI and radians.
    formats, calibration_axes_deg : image of every camera in calibration axes, and these from image axes.
    """

    frame: LocalFrame
    cameras: tuple[FrameCamera, ...]
    flights: tuple[str, ...]
    strips: tuple[str, ...]
    exposures: PlannedExposures
    object_point: Floats
    rays: PlannedRays
    control: PlannedControl
    system: Mapping[str, Floats]
    formats: tuple[ImageFormat, ...]
    calibration_axes_deg: tuple[int, ...]
    distances: PlannedDistances | None = None
    rig: Rig | None = None

    @property
    def event_of_image(self) -> Ints:
        """(i,) exposure of every image."""
        return np.arange(len(self.exposures)) if self.rig is None else self.rig.event_of_image

    @property
    def camera_of_image(self) -> Ints:
        """(i,) camera that takes every image."""
        return self.exposures.camera if self.rig is None else self.rig.camera_of_image

    @property
    def state(self) -> State:
        """The geometry as values of the unknowns."""
        exposures = self.exposures
        return State(
            exposures.projection_centre,
            exposures.local_from_camera,
            self.object_point,
            self.system,
            self.rig,
        )

    @property
    def joined_heads(self) -> tuple[str, ...]:
        """Cameras that take images together with other heads of a rig."""
        if self.rig is None:
            return ()
        return tuple(self.cameras[k].name for k in np.flatnonzero(self.rig.joined_heads))

    @property
    def has_positions(self) -> bool:
        """Whether GNSS positions are observed."""
        return bool(np.isfinite(self.exposures.position_sigma).any())

    @property
    def body_from_camera(self) -> Floats:
        """Nominal mounting T of the camera of each exposure, (n, 3, 3)."""
        return np.stack([camera.body_from_camera for camera in self.cameras])[self.exposures.camera]

    @property
    def local_from_body(self) -> Floats:
        """Attitude of the inertial unit at each exposure, R_c Tᵀ R_Bᵀ, (n, 3, 3)."""
        boresight = rotation.from_roll_pitch_yaw(self.system[BORESIGHT])[self.exposures.camera]
        return np.asarray(
            self.exposures.local_from_camera @ np.swapaxes(boresight @ self.body_from_camera, 1, 2)
        )

    @property
    def antenna(self) -> Floats:
        """Positions (n, 3) of the antenna, X0 + R_b l, local frame."""
        arm = self.system[LEVER_ARM][self.exposures.camera]
        in_local = np.einsum("nij,nj->ni", self.local_from_body, arm)
        return np.asarray(self.exposures.projection_centre + in_local)

    @property
    def heading(self) -> Floats:
        """(n,) radians, clockwise from north."""
        forward = self.local_from_body[:, :, 0]
        axes = np.asarray(self.frame.local_from_enu(self.exposures.projection_centre))
        enu = np.einsum("nji,nj->ni", axes, forward)
        return np.asarray(np.arctan2(enu[:, 0], enu[:, 1]))

    @property
    def ground(self) -> Floats:
        """(n,) mean height of the object points that each exposure sees, metres; their mean where none."""
        height = self.frame.height(self.object_point)
        n, exposure = len(self.exposures), self.event_of_image[self.rays.image]
        count = np.bincount(exposure, minlength=n)
        total = np.bincount(exposure, height[self.rays.point], n)
        return np.asarray(np.where(count > 0, total / np.maximum(count, 1), height.mean()))

    @property
    def height_above_ground(self) -> Floats:
        """(n,) metres."""
        return np.asarray(self.frame.height(self.exposures.projection_centre) - self.ground)

    @property
    def image_coordinates(self) -> Floats:
        """(r, 2) where the rays meet the images, metres."""
        rays, pictures = self.rays, self.state.pictures
        ray = self.object_point[rays.point] - pictures.projection_centre[rays.image]
        p = np.einsum("nji,nj->ni", pictures.local_from_camera[rays.image], ray)
        interior = self.system[INTERIOR_ORIENTATION][self.camera_of_image[rays.image]]
        return np.asarray(interior[:, 1:] - interior[:, :1] * p[:, :2] / p[:, 2:])

    def with_control(self, control: PlannedControl) -> PlannedNetwork:
        """The same network with other control points."""
        return replace(self, control=control)

    def with_intersecting_rays(self, least_angle: float) -> PlannedNetwork:
        """Without the rays of points whose rays all have nearly the same direction.

        A line flown there and back exactly over itself sees points twice from one place, which determines
        nothing, and so do the heads of one exposure; control points are known without.

        Parameters
        ----------
        least_angle : of the outermost ray of a point from their mean direction, radians.
        """
        rays, m = self.rays, len(self.object_point)
        ray = self.object_point[rays.point] - self.state.pictures.projection_centre[rays.image]
        ray = ray / np.linalg.norm(ray, axis=1, keepdims=True)
        mean = np.stack([np.bincount(rays.point, ray[:, axis], m) for axis in range(3)], -1)
        mean = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), np.finfo(float).tiny)
        away = np.linalg.norm(np.cross(ray, mean[rays.point]), axis=1)
        widest = np.zeros(m)
        np.maximum.at(widest, rays.point, away)
        widest[self.control.point[self.control.present.all(axis=1)]] = 1.0
        kept = (widest >= np.sin(least_angle))[rays.point]
        return replace(self, rays=PlannedRays(rays.image[kept], rays.point[kept], rays.sigma[kept]))
