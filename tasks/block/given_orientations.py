"""Given orientations: exposures as positions and rotations in the local frame of the adjustment.

A delivery of ω, φ, κ describes the camera with its nominal mounting T, so R_INS = R_ωφκ Tᵀ; a delivery of
heading, pitch, roll describes the body itself. In both cases R_camera = R_INS R_B(b) T with the boresight b
that is known beforehand, and the projection centre lies at A − R_INS l with the known lever arm l.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Literal, Self

import numpy as np
import pandas as pd

from adjust.arrays import Bools, Floats, Ints
from adjust.camera.interior import FrameCamera
from adjust.geometry import rotation
from tasks.block.strip_names import strip_names
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, local_from_grid, local_from_map
from tasks.deliveries.cameras import frame_cameras
from tasks.errors import InputError
from tasks.tables.number_columns import numbers_of

_BODY = ("roll", "pitch", "yaw")
AngleOrder = Literal["omega-phi-kappa", "phi-omega-kappa"]


@dataclass(frozen=True, eq=False)
class Mountings:
    """How the cameras sit in the aircraft, as known beforehand; one row for each camera.

    Attributes
    ----------
    cameras : the cameras.
    lever_arm : (c, 3) metres, body axes.
    reduced_by : (c, 3) that with which delivered projection centres were reduced, metres, body axes.
    boresight : (c, 3) roll, pitch, yaw, radians.
    reference : (c,) reference head of the rig of each camera; a camera alone is its own.
    relative_position, relative_rotation : (c, 3) against it: metres, and roll, pitch, yaw in radians.
    synchronisation_offset : (c, 1) seconds after the moment of the event.
    """

    cameras: tuple[FrameCamera, ...]
    lever_arm: Floats
    reduced_by: Floats
    boresight: Floats
    reference: Ints
    relative_position: Floats
    relative_rotation: Floats
    synchronisation_offset: Floats

    @classmethod
    def from_table(cls, table: pd.DataFrame) -> Self:
        """From cameras.parquet; only the cameras that are used need to be in it."""
        cameras = tuple(frame_cameras(table).values())
        lever_arm, reduced_by = (
            numbers_of(table, [f"{name}_{axis}_m" for axis in "xyz"]) for name in ("lever_arm", "reduced_by")
        )
        boresight = numbers_of(table, [f"boresight_{name}_deg" for name in ("roll", "pitch", "yaw")])
        names = pd.Index([camera.name for camera in cameras])
        of_itself = np.where(table["head_of"].notna(), table["head_of"], table["camera"])
        return cls(
            cameras,
            lever_arm,
            reduced_by,
            np.deg2rad(boresight),
            names.get_indexer(pd.Index(of_itself)).astype(np.int64),
            np.nan_to_num(numbers_of(table, [f"relative_position_{axis}_m" for axis in "xyz"])),
            np.deg2rad(np.nan_to_num(numbers_of(table, [f"relative_rotation_{name}_deg" for name in _BODY]))),
            np.nan_to_num(numbers_of(table, ["synchronisation_offset_s"])),
        )

    @property
    def has_heads(self) -> bool:
        """Whether any camera is a head of a rig."""
        return bool(np.any(self.reference != np.arange(len(self.reference))))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cameras."""
        return tuple(camera.name for camera in self.cameras)

    @cached_property
    def body_from_camera(self) -> Floats:
        """Nominal mountings T, (c, 3, 3)."""
        return np.stack([camera.body_from_camera for camera in self.cameras])

    @property
    def nominal_from_camera(self) -> Floats:
        """Tᵀ R_B(b)ᵀ T (c, 3, 3): an image turned by it has the angles of its camera mounted nominally."""
        mounting, boresight = self.body_from_camera, rotation.from_roll_pitch_yaw(self.boresight)
        return np.asarray(np.swapaxes(mounting, 1, 2) @ np.swapaxes(boresight, 1, 2) @ mounting)

    @property
    def up_in_camera(self) -> Floats:
        """(c, 3) direction upwards while the body is level."""
        mounting, boresight = self.body_from_camera, rotation.from_roll_pitch_yaw(self.boresight)
        return np.asarray(-(boresight @ mounting)[:, 2, :])


def of_another_camera(angles: Floats, body_from_camera: Floats, one: Ints, other: Ints) -> Floats:
    """ω, φ, κ (k, 3) of cameras (k,) as others (k,) on the same body would have them, all mounted nominally.

    Parameters
    ----------
    body_from_camera : (c, 3, 3) nominal mountings of all cameras.
    """
    turn = np.swapaxes(body_from_camera[one], 1, 2) @ body_from_camera[other]
    turned = rotation.to_omega_phi_kappa(rotation.from_omega_phi_kappa(angles) @ turn)
    return np.where((one == other)[:, None], angles, turned)


@dataclass(frozen=True, eq=False)
class GivenOrientations:
    """Positions and attitudes of n images as delivered, in the local frame.

    Attributes
    ----------
    image : names, ascending.
    camera : (n,) index into ``mountings``.
    flight, strip : names, empty where not known.
    time_s : (n,) NaN where not known.
    x_in_map : (n, 3) position as delivered, in the project's CRS.
    observed : (n, 3) the same in the local frame.
    position_sigma : (n, 3) along grid east, grid north, up, metres; NaN where no position was delivered.
    local_from_grid : (n, 3, 3) at each position.
    local_from_enu : (n, 3, 3) likewise, true north.
    angles : (n, 3) radians: ω, φ, κ of the camera against the grid, or heading, pitch, roll of the body.
    angle_sigma : (n, 3) radians.
    is_heading : (n,) which of the two.
    rates : (n, 3) of the body about its axes forward, right, down, rad/s; NaN where not delivered.
    velocity : (n, 3) in the local frame, m/s; NaN where not delivered.
    position_observed : (n,) whether the position was delivered; else it is approximate.
    attitude_observed : (n,) whether the angles were delivered; else they are approximate at best.
    event : delivered names of the events of rigs, empty where not known.
    """

    mountings: Mountings
    image: tuple[str, ...]
    camera: Ints
    flight: tuple[str, ...]
    strip: tuple[str, ...]
    time_s: Floats
    x_in_map: Floats
    observed: Floats
    position_sigma: Floats
    local_from_grid: Floats
    local_from_enu: Floats
    angles: Floats
    angle_sigma: Floats
    is_heading: Bools
    rates: Floats
    velocity: Floats
    position_observed: Bools
    attitude_observed: Bools
    event: tuple[str, ...]

    @classmethod
    def from_tables(
        cls, exposures: pd.DataFrame, mountings: Mountings, map_frame: MapFrame, frame: AdjustmentFrame
    ) -> Self:
        """From exposures.parquet; the rows must be the images wanted, all with a position.

        What has no standard deviation is not an observation but an approximate value.
        Positions that were reduced to the projection centre get back what their lever arm took off, so that
        all of them are observations of the antenna.
        """
        x_in_map = numbers_of(exposures, ["x_m", "y_m", "z_m"])
        observed = local_from_map(map_frame, frame, x_in_map)
        heading_columns = ["heading_deg", "pitch_deg", "roll_deg"]
        heading = numbers_of(exposures, heading_columns)
        grid = numbers_of(exposures, ["omega_deg", "phi_deg", "kappa_deg"])
        is_heading = np.asarray(np.isfinite(heading).all(axis=1))
        choose = is_heading[:, None]
        sigma_heading = numbers_of(exposures, [f"sigma_{name}" for name in heading_columns])
        sigma_grid = numbers_of(exposures, ["sigma_omega_deg", "sigma_phi_deg", "sigma_kappa_deg"])
        sigma_position = numbers_of(exposures, ["sigma_x_m", "sigma_y_m", "sigma_z_m"])
        local_from_enu = np.array(frame.local_from_enu(observed))
        velocity = numbers_of(exposures, [f"velocity_{way}_m_s" for way in ("east", "north", "up")])
        angles, sigma = np.where(choose, heading, grid), np.where(choose, sigma_heading, sigma_grid)
        delivered = cls(
            mountings,
            tuple(exposures["image"]),
            pd.Index(mountings.names).get_indexer(pd.Index(exposures["camera"])).astype(np.int64),
            tuple(exposures["flight"].fillna("")),
            tuple(exposures["strip"].fillna("")),
            exposures["time_s"].to_numpy(np.float64),
            x_in_map,
            observed,
            sigma_position,
            local_from_grid(map_frame, frame, x_in_map),
            local_from_enu,
            np.deg2rad(angles),
            np.deg2rad(sigma),
            is_heading,
            np.deg2rad(numbers_of(exposures, [f"rate_{name}_deg_s" for name in _BODY])),
            np.einsum("nij,nj->ni", local_from_enu, velocity),
            np.asarray(np.isfinite(sigma_position).all(axis=1)),
            np.asarray(np.isfinite(angles + sigma).all(axis=1)),
            tuple(exposures["event"].fillna("")),
        )
        return delivered._at_the_antenna((exposures["position"] == "projection_centre").to_numpy())

    def _at_the_antenna(self, reduced: Bools) -> Self:
        """The same with the lever arms added to the positions (n,) that were reduced by them.

        Delivered velocities become those of the antenna, which turns around the projection centre.
        Approximate positions without attitude are left as they are.

        Raises
        ------
        InputError
            If such a position has no attitude, with which it was reduced.
        """
        reduced = reduced & (self.position_observed | self.has_attitude)
        arm = np.where(reduced[:, None], self.mountings.reduced_by[self.camera], 0.0)
        if not arm.any():
            return self
        unknown = arm.any(axis=1) & self.position_observed & ~self.attitude_observed
        if unknown.any():
            raise InputError(
                "The position was reduced to the projection centre, and there is no attitude to undo this.",
                'Deliver the attitude, or the position of the antenna (position = "antenna"), or give no '
                "lever_arm_m.",
                entity=f"image {self.image[int(np.argmax(unknown))]}",
            )
        turning = np.cross(np.nan_to_num(self.rates), arm)
        back, faster = np.einsum("nij,knj->kni", self.local_from_body(), np.stack([arm, turning]))
        return replace(
            self,
            observed=self.observed + np.where(reduced[:, None], back, 0.0),
            velocity=self.velocity + np.where(reduced[:, None], faster, 0.0),
        )

    @property
    def flights(self) -> tuple[str, ...]:
        """Names of the flights, ascending; one without a name if none is known."""
        return tuple(sorted(set(self.flight)))

    @property
    def flight_of_image(self) -> Ints:
        """(n,) index into ``flights``."""
        return pd.Index(self.flights).get_indexer(pd.Index(self.flight)).astype(np.int64)

    @cached_property
    def strip_names(self) -> tuple[str, ...]:
        """(n,) names that differ between flights, too; empty where not known."""
        return tuple(strip_names(self.flight, self.strip))

    @property
    def strips(self) -> tuple[str, ...]:
        """Names of the strips, ascending; one without a name if none is known."""
        return tuple(sorted(set(self.strip_names)))

    @cached_property
    def strip_of_image(self) -> Ints:
        """(n,) index into ``strips``."""
        return pd.Index(self.strips).get_indexer(pd.Index(self.strip_names)).astype(np.int64)

    @property
    def has_attitude(self) -> Bools:
        """(n,) whether all three angles are known."""
        return np.asarray(np.isfinite(self.angles).all(axis=1))

    @property
    def body_from_camera(self) -> Floats:
        """Nominal mounting T of each image, (n, 3, 3)."""
        return np.asarray(self.mountings.body_from_camera[self.camera])

    @property
    def pixel_size(self) -> Floats:
        """(n,) metres, of the camera of each image."""
        return np.array([camera.pixel_size for camera in self.mountings.cameras])[self.camera]

    def angles_of(self, rows: Ints, camera: Ints) -> Floats:
        """Angles (k, 3) of images (k,) as they would be of other cameras (k,) on the same body, radians."""
        angles, own = self.angles[rows], self.camera[rows]
        turned = of_another_camera(angles, self.mountings.body_from_camera, own, camera)
        return np.where(self.is_heading[rows, None], angles, turned)

    def local_from_body(self, order: AngleOrder = "omega-phi-kappa") -> Floats:
        """Attitude of the body, R_INS (n, 3, 3); ``order`` is the order of ω, φ, κ."""
        read = rotation.from_omega_phi_kappa if order == "omega-phi-kappa" else rotation.from_phi_omega_kappa
        of_camera = self.local_from_grid @ read(self.angles) @ np.swapaxes(self.body_from_camera, 1, 2)
        of_body = self.local_from_enu @ rotation.ENU_FROM_NED @ rotation.ned_from_body(self.angles)
        return np.where(self.is_heading[:, None, None], of_body, of_camera)

    def attitude_covariance(self) -> Floats:
        """Covariance (n, 3, 3) of a small rotation of the body, in body axes, rad²."""
        camera = self.body_from_camera @ rotation.omega_phi_kappa_jacobian(self.angles)
        body = rotation.heading_pitch_roll_jacobian(self.angles)
        spread = np.where(self.is_heading[:, None, None], body, camera) * self.angle_sigma[:, None, :]
        return spread @ np.swapaxes(spread, 1, 2)

    def orientations(self, order: AngleOrder = "omega-phi-kappa") -> tuple[Floats, Floats]:
        """Projection centres (n, 3) and rotations local from camera (n, 3, 3) with the known mounting."""
        local_from_body = self.local_from_body(order)
        boresight = rotation.from_roll_pitch_yaw(self.mountings.boresight)[self.camera]
        arm = np.einsum("nij,nj->ni", local_from_body, self.mountings.lever_arm[self.camera])
        return self.observed - arm, local_from_body @ boresight @ self.body_from_camera

    def with_boresight(self, approximate: pd.DataFrame) -> Self:
        """The same with the boresight of approximate_boresight.parquet in the place of the given one."""
        rows = approximate.set_index("camera").loc[list(self.mountings.names)]
        return self.turned(np.deg2rad(numbers_of(rows, ["roll_deg", "pitch_deg", "yaw_deg"])))

    def turned(self, boresight: Floats) -> Self:
        """The same with another boresight (c, 3); attitudes that were found for images stay as they are."""
        changed = replace(self, mountings=replace(self.mountings, boresight=boresight))
        of_images = ~self.attitude_observed & ~self.is_heading & self.has_attitude
        if not of_images.any():
            return changed
        before, after = self.mountings.nominal_from_camera, changed.mountings.nominal_from_camera
        turn = (np.swapaxes(before, 1, 2) @ after)[self.camera[of_images]]
        angles = self.angles.copy()
        nominal = rotation.from_omega_phi_kappa(angles[of_images]) @ turn
        angles[of_images] = rotation.to_omega_phi_kappa(nominal)
        return replace(changed, angles=angles)

    def headings(self) -> Floats:
        """Heading of the body (n,), radians clockwise from true north."""
        forward = np.einsum("nji,nj->ni", self.local_from_enu, self.local_from_body()[:, :, 0])
        return np.asarray(np.arctan2(forward[:, 0], forward[:, 1]))

    def only(self, kept: Bools) -> Self:
        """The images (n,) that are kept."""
        index = np.flatnonzero(kept)
        names = [item.name for item in fields(self) if item.name != "mountings"]
        return replace(self, **{name: _rows(getattr(self, name), index) for name in names})


def _rows(values: Any, index: Ints) -> Any:
    """Rows of an array, or of a tuple of names."""
    return tuple(values[i] for i in index) if isinstance(values, tuple) else values[index]
