"""A delivered block and its observation equations, from the text files and docs/conventions.md alone.

Nothing of the package is used. The equations are functions of complex numbers, so that a step along the
imaginary axis gives their derivatives to all digits (Squire and Trapp 1998).
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyproj
import scipy.linalg

from tests.golden.delivered_refraction import Array, Refraction, coefficient, intersections

STEP = 1e-30
ANGLES = ("omega_deg", "phi_deg", "kappa_deg")
PLACE = ("x_m", "y_m", "z_m")
DEGREE = np.pi / 180.0
# SI of one unit of the tables; others have none.
UNITS = {"1e-6": 1e-6, "mm": 1e-3, "um": 1e-6, "deg": DEGREE, "deg/s": DEGREE}


def about(axis: int, angle: Array) -> Array:
    """Rotation matrices (…, 3, 3) about an axis, active and right-handed."""
    one, nil, c, s = np.ones_like(angle), np.zeros_like(angle), np.cos(angle), np.sin(angle)
    rows = {
        0: [[one, nil, nil], [nil, c, -s], [nil, s, c]],
        1: [[c, nil, s], [nil, one, nil], [-s, nil, c]],
        2: [[c, -s, nil], [s, c, nil], [nil, nil, one]],
    }[axis]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def opk(angle: Array) -> Array:
    """R_x(ω) R_y(φ) R_z(κ) of angles (…, 3)."""
    return about(0, angle[..., 0]) @ about(1, angle[..., 1]) @ about(2, angle[..., 2])


def angles_of(r: Array) -> Array:
    """ω, φ, κ of matrices (n, 3, 3)."""
    omega, phi = np.arctan2(-r[:, 1, 2], r[:, 2, 2]), np.arcsin(r[:, 0, 2])
    return np.column_stack([omega, phi, np.arctan2(-r[:, 0, 1], r[:, 0, 0])])


def rpy(angle: Array) -> Array:
    """R_z(yaw) R_y(pitch) R_x(roll) of roll, pitch, yaw (…, 3)."""
    return about(2, angle[..., 2]) @ about(1, angle[..., 1]) @ about(0, angle[..., 0])


def small_log(r: Array) -> Array:
    """The rotation vector (…, 3) of a small rotation matrix, also complex."""
    axial = 0.5 * np.stack(
        [r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]], axis=-1
    )
    square = np.sum(axial * axial, axis=-1, keepdims=True)
    # asin(s)/s in powers of s² = sin², to 1e-16 for some degrees.
    factor = 1.0 + square * (1 / 6 + square * (3 / 40 + square * (15 / 336 + square * 105 / 3456)))
    return axial * factor


def mounting(degrees: float) -> Array:
    """T = diag(1, −1, −1) R_z(κ_mount), body from camera."""
    return np.diag([1.0, -1.0, -1.0]) @ about(2, np.array(np.radians(degrees)))


BROWN = ("K1", "K2", "K3", "P1", "P2", "B1", "B2")


def brown(xy: Array) -> Array:
    """What Brown's parameters, per metre, add to measured coordinates (n, 2): (n, 2, 7)."""
    x, y = xy.T
    r2, nil = x * x + y * y, np.zeros_like(x)
    radial = [r2, r2**2, r2**3]
    of_x = [*(x * r for r in radial), r2 + 2 * x * x, 2 * x * y, x, y]
    of_y = [*(y * r for r in radial), 2 * x * y, r2 + 2 * y * y, nil, nil]
    return np.stack([np.stack(of_x, axis=-1), np.stack(of_y, axis=-1)], axis=1)


def turned(r: Array, v: Array) -> Array:
    return np.einsum("...ij,...j->...i", r, v)


@dataclass(frozen=True, eq=False)
class Results:
    """A results folder: every table by its name, and the figures."""

    folder: Path

    def table(self, name: str) -> pd.DataFrame:
        return pd.read_parquet(self.folder / f"{name}.parquet")

    @property
    def summary(self) -> Mapping[str, Any]:
        return dict(json.loads((self.folder / "summary.json").read_text()))


@dataclass(frozen=True)
class Applied(Results):
    """Results with tables of other orientations, points and parameters, of the stated weights."""

    tables: Mapping[str, pd.DataFrame]

    def table(self, name: str) -> pd.DataFrame:
        return self.tables[name]

    @property
    def summary(self) -> Mapping[str, Any]:
        return {"variance_components": None}


class LocalFrame:
    """crs = "local": the axes of the project are those of the adjustment."""

    def local(self, in_map: Array) -> Array:
        return in_map

    def grid(self, in_map: Array) -> Array:
        """local_from_grid (n, 3, 3)."""
        return np.broadcast_to(np.eye(3), (len(in_map), 3, 3))

    enu = grid

    def height(self, local: Array) -> Array:
        return np.asarray(local[:, 2])


class ProjectedFrame:
    """A projected CRS: east, north, up at the mean of the exposures on the ellipsoid."""

    def __init__(self, crs: str, exposures: Array) -> None:
        self.ellipsoid = pyproj.CRS(crs).ellipsoid
        self.to_geographic = pyproj.Transformer.from_crs(crs, pyproj.CRS(crs).geodetic_crs, always_xy=True)
        at = self.geodetic(exposures).mean(axis=0) * [1, 1, 0]
        self.origin, self.axes = self.ecef(at[None])[0], self.ecef_from_enu(at[None])[0]

    def geodetic(self, in_map: Array) -> Array:
        """Longitude, latitude in radians, height."""
        longitude, latitude = self.to_geographic.transform(in_map[:, 0], in_map[:, 1])
        return np.column_stack([np.radians(longitude), np.radians(latitude), in_map[:, 2]])

    def ecef(self, at: Array) -> Array:
        a, b = self.ellipsoid.semi_major_metre, self.ellipsoid.semi_minor_metre
        e2 = 1.0 - (b / a) ** 2
        longitude, latitude, h = at.T
        n = a / np.sqrt(1.0 - e2 * np.sin(latitude) ** 2)
        x = (n + h) * np.cos(latitude)
        return np.column_stack(
            [x * np.cos(longitude), x * np.sin(longitude), (n * (1 - e2) + h) * np.sin(latitude)]
        )

    @staticmethod
    def ecef_from_enu(at: Array) -> Array:
        longitude, latitude, _ = at.T
        (sl, cl), (sb, cb) = (np.sin(longitude), np.cos(longitude)), (np.sin(latitude), np.cos(latitude))
        east = np.column_stack([-sl, cl, np.zeros_like(sl)])
        north = np.column_stack([-sb * cl, -sb * sl, cb])
        up = np.column_stack([cb * cl, cb * sl, sb])
        return np.stack([east, north, up], axis=-1)

    def local(self, in_map: Array) -> Array:
        return (self.ecef(self.geodetic(in_map)) - self.origin) @ self.axes

    def height(self, local: Array) -> Array:
        """Ellipsoidal heights (n,) of places in the frame of the adjustment."""
        to_geodetic = pyproj.Transformer.from_pipeline(f"+proj=cart +inv {self.ellipsoid_in_words}")
        return np.asarray(to_geodetic.transform(*(self.origin + local @ self.axes.T).T)[2])

    @property
    def ellipsoid_in_words(self) -> str:
        return f"+a={self.ellipsoid.semi_major_metre} +b={self.ellipsoid.semi_minor_metre!r}"

    def enu(self, in_map: Array) -> Array:
        """local_from_enu (n, 3, 3)."""
        return np.einsum("ji,njk->nik", self.axes, self.ecef_from_enu(self.geodetic(in_map)))

    def grid(self, in_map: Array) -> Array:
        """local_from_grid (n, 3, 3): grid north is where the northing grows, on the ellipsoid."""
        step = 10.0
        ahead, behind = (self.local(in_map * [1, 1, 0] + [0, s, 0]) for s in (step, -step))
        enu = self.enu(in_map)
        north = np.einsum("nji,nj->ni", enu, ahead - behind)
        turn = np.arctan2(north[:, 0], north[:, 1])
        return enu @ about(2, -turn)


@dataclass(frozen=True, eq=False)
class Group:
    """Scalars of one kind of observation: what they are called, v (n,) and their covariance (n, n)."""

    name: str
    keys: list[tuple[str, str, str, str]]
    covariance: Array


class Delivered:
    """The observation equations of a project at the adjusted values of its results.

    Attributes
    ----------
    exposure : (n, 6) d in grid axes, m, and ω, φ, κ in rad; point : (m, 3) d in grid axes, m.
    g : (k,) system parameters in SI; parameters : their rows in the table.
    """

    def __init__(self, project: Path, results: Results) -> None:
        self.project = tomllib.loads(project.read_text())
        self.folder, self.results = project.parent, results
        inputs = self.project["inputs"]
        self.settings = self.project["adjustment"]
        read = {"dtype": {"image": str, "point": str, "strip": str, "flight": str, "camera": str}}
        self.rays = pd.read_csv(self.folder / inputs["image_points"]["file"], **read)
        self.given = pd.read_csv(self.folder / inputs["exposures"]["file"], **read).set_index("image")
        self.control = pd.read_csv(self.folder / inputs["control"]["file"], **read).set_index("point")
        orientations = results.table("exterior_orientations").set_index("image")
        # Exposures have unknowns; several images of a rig have the pose of one.
        of_image = self.exposure_of(list(orientations.index))
        self.images, self.points = list(dict.fromkeys(of_image.values())), []
        orientations, self.camera_of_image = orientations.loc[self.images], self.given["camera"].to_dict()
        self.given = self.given.loc[self.images]
        objects = results.table("object_points").set_index("point")
        self.points = list(objects.index)
        crs = self.project["project"]["crs"]
        given = self.given[["x", "y", "z"]].to_numpy()
        self.frame = LocalFrame() if crs == "local" else ProjectedFrame(crs, given)
        self.map_of_image = orientations[list(PLACE)].to_numpy()
        self.centre, self.image_axes = self.both(self.map_of_image)
        self.angles = np.radians(orientations[list(ANGLES)].to_numpy())
        self.map_of_point = objects[list(PLACE)].to_numpy()
        self.place, self.point_axes = self.both(self.map_of_point)
        self.parameters = results.table("parameters")
        self.number = {(p, e): k for k, (p, e) in enumerate(named(self.parameters))}
        self.factor = self.parameters.unit.map(lambda unit: UNITS.get(unit, 1.0)).to_numpy()
        self.g = self.parameters.value.to_numpy() * self.factor
        self.free = ~self.parameters.status.isin(["fixed", "considered", "eliminated"]).to_numpy()
        used = self.rays.image.isin(list(of_image)) & self.rays.point.isin(self.points)
        self.rays = self.rays[used].reset_index(drop=True)
        number = {name: k for k, name in enumerate(self.images)}
        self.image_number = {image: number[exposure] for image, exposure in of_image.items()}
        self.ray_image = self.rays.image.map(self.image_number).to_numpy()
        self.point_number = {name: k for k, name in enumerate(self.points)}
        self.ray_point = self.rays.point.map(self.point_number).to_numpy()
        self.camera = self.given["camera"].tolist()
        self.strip = self.given["strip"].tolist()
        self.flight = (
            self.given["flight"].fillna("").tolist() if "flight" in self.given else [""] * len(self.given)
        )
        self.ray_camera = self.rays.image.map(self.camera_of_image).tolist()
        self.places: dict[Any, Any] = {}
        self.series: dict[str, Array] = {}
        self.mounting = np.stack([mounting(self.project["cameras"][c]["mount_deg"]) for c in self.camera])
        self._observations()
        self.speed = self.velocity()

    def exposure_of(self, images: list[str]) -> dict[str, str]:
        """The exposure whose pose each image has: its own."""
        return {name: name for name in images}

    def both(self, in_map: Array) -> tuple[Array, Array]:
        return self.frame.local(in_map), self.frame.grid(in_map)

    # -- observations ---------------------------------------------------------------------------------

    def _observations(self) -> None:
        inputs, observe = self.project["inputs"], self.settings.get("observe", ["gnss", "ins", "control"])
        unit = 1e-3
        sigma = np.broadcast_to(np.array(inputs["image_points"]["sigma"], dtype=float), (2,)) * unit
        self.xy = self.rays[["x", "y"]].to_numpy() * unit
        own = np.broadcast_to(sigma, self.xy.shape)
        if "sx" in self.rays:
            own = self.rays[["sx", "sy"]].to_numpy() * unit
        groups = [
            Group(
                "image_points",
                [
                    ("image_points", i, p, c)
                    for i, p in zip(self.rays.image, self.rays.point, strict=True)
                    for c in ("x", "y")
                ],
                np.diag(own.ravel() ** 2),
            )
        ]
        role = self.control["role"].fillna("control") if "role" in self.control else "control"
        chosen = (role == "control") & self.control.index.isin(self.points)
        self.surveyed = self.control[chosen] if "control" in observe else self.control[:0]
        self.survey_sigma = self._sigma(self.control, inputs["control"].get("sigma_m"))
        if len(self.surveyed):
            at = self.surveyed[["x", "y", "z"]].to_numpy()
            known = np.isfinite(at)
            self.survey_map = np.where(known, at, np.nan_to_num(at))
            self.survey_known = known
            self.survey_point = np.array([self.point_number[p] for p in self.surveyed.index])
            # The vertical of a height control point is that of the adjusted one.
            whole = np.where(known, at, self.map_of_point[self.survey_point])
            self.survey_local, self.survey_axes = self.frame.local(whole), self.frame.enu(whole)
            s = self.survey_sigma.loc[self.surveyed.index].to_numpy()
            # Stated along the grid, differences are along true east and north.
            turn = np.swapaxes(self.survey_axes, 1, 2) @ self.frame.grid(whole)
            covariance = np.einsum("nij,nj,nkj->nik", turn, s**2, turn)
            groups.append(
                Group(
                    "control_points",
                    [
                        ("control_points", "", p, "xyz"[k])
                        for n, p in enumerate(self.surveyed.index)
                        for k in range(3)
                        if known[n, k]
                    ],
                    block_diagonal(covariance)[np.ix_(known.ravel(), known.ravel())],
                )
            )
        self.measured = self._distances()
        if len(self.measured):
            names = zip(self.measured["other_point"], self.measured["point"], strict=True)
            keys = [(f"distances:{other}", "", point, "distance") for other, point in names]
            groups.append(Group("distances", keys, np.diag(self.measured["sigma"] ** 2)))
        sigma = inputs["exposures"].get("sigma", {})
        self.antenna = self.frame.local(self.given[["x", "y", "z"]].to_numpy())
        self.antenna_axes = self.frame.grid(self.given[["x", "y", "z"]].to_numpy())
        self.local_from_body = self._delivered_attitudes()
        time = self.given["time"].to_numpy() if "time" in self.given else np.zeros(len(self.given))
        self.since_mid = np.zeros(len(self.given))
        for strip in set(zip(self.flight, self.strip, strict=True)):
            own_rows = np.array([pair == strip for pair in zip(self.flight, self.strip, strict=True)])
            self.since_mid[own_rows] = time[own_rows] - 0.5 * (time[own_rows].min() + time[own_rows].max())
        self.time = time
        if "gnss" in observe:
            s = self._sigma(self.given, sigma["position_m"]).to_numpy()
            covariance = np.einsum("ni,ij->nij", s**2, np.eye(3))
            groups.append(
                Group(
                    "gnss_positions",
                    [("gnss_positions", i, "", c) for i in self.images for c in "xyz"],
                    self.over_time("gnss_positions", covariance),
                )
            )
        if "ins" in observe:
            groups.append(
                Group(
                    "ins_attitudes",
                    [("ins_attitudes", i, "", c) for i in self.images for c in ("roll", "pitch", "yaw")],
                    self.over_time("ins_attitudes", self._attitude_covariance()),
                )
            )
        priors = self.parameters[self.free & self.parameters.sigma_prior.notna()]
        self.prior = np.array([self.number[p, e] for p, e in named(priors)], dtype=int)
        self.prior_value = (priors.value - priors.change).to_numpy() * self.factor[self.prior]
        if len(priors):
            groups.append(
                Group(
                    "priors",
                    [
                        (f"prior:{_family(p)}:{e}", "", "", p)
                        for p, e in zip(priors.parameter, priors.entity, strict=True)
                    ],
                    np.diag((self._prior_sigma(priors)) ** 2),
                )
            )
        self.groups = groups
        if self.settings.get("refraction", "standard") == "standard":
            self.xy = self.refraction.straight(self.xy)

    @cached_property
    def refraction(self) -> Refraction:
        """Of the image points, at the orientations and with the cameras that are delivered."""
        stated = [self.project["cameras"][name] for name in self.ray_camera]
        given = [[camera["focal_length_mm"], *camera["principal_point_mm"]] for camera in stated]
        interior = np.array(given) * 1e-3
        at = (self.parameters["value"] - self.parameters["change"]).to_numpy() * self.factor
        attitude = (self.local_from_body @ self.mounting)[self.ray_image]
        centre, attitude = self.pose_of_rays(self.antenna[self.ray_image], attitude, at)
        sigma = np.sqrt(np.diagonal(self.groups[0].covariance)).reshape(-1, 2)
        xy, c = self.xy - interior[:, 1:], interior[:, 0]
        places = intersections(centre, attitude, xy, c, self.ray_point, sigma)
        up = self.frame.enu(self.given[["x", "y", "z"]].to_numpy())[self.ray_image, :, 2]
        down = -turned(np.swapaxes(attitude, 1, 2), up)
        height = self.frame.height(centre)
        k = coefficient(height, self.frame.height(places)[self.ray_point])
        return Refraction(interior, down, height, k)

    def _sigma(self, table: pd.DataFrame, common: Any) -> pd.DataFrame:
        values = np.broadcast_to(
            np.array(np.nan if common is None else common, dtype=float), (len(table), 3)
        ).copy()
        for k, name in enumerate(("sx", "sy", "sz")):
            if name in table:
                own = table[name].to_numpy()
                values[:, k] = np.where(np.isfinite(own), own, values[:, k])
        return pd.DataFrame(values, index=table.index)

    def _distances(self) -> pd.DataFrame:
        """Distances between points of the block, m, control and check."""
        stated = self.project["inputs"].get("distances")
        if stated is None:
            return pd.DataFrame()
        table = pd.read_csv(self.folder / stated["file"], dtype={"point": str, "other_point": str})
        table = table[table["point"].isin(self.points) & table["other_point"].isin(self.points)]
        unit = {"m": 1.0, "mm": 1e-3}[stated["unit"]]
        sigma = table["sigma"].fillna(stated.get("sigma", np.nan))
        return table.assign(distance=table["distance"] * unit, sigma=sigma * unit)

    def _prior_sigma(self, priors: pd.DataFrame) -> Array:
        """As the project states them, in SI."""
        stated = self.settings.get("priors", {})
        found = []
        for name in priors.parameter:
            family = _family(name)
            key = next(key for key in stated if key.startswith(family + "_"))
            values = np.broadcast_to(np.array(stated[key], dtype=float), (3,))
            unit = {"deg": DEGREE, "mm": 1e-3, "deg_s": DEGREE}.get(key[len(family) + 1 :], 1.0)
            axis = {"x": 0, "y": 1, "z": 2, "roll": 0, "pitch": 1, "yaw": 2}.get(name[len(family) + 1 :], 0)
            found.append(values[axis] * unit)
        return np.array(found)

    def _delivered_attitudes(self) -> Array:
        """R_INS local from body."""
        at = self.given[["x", "y", "z"]].to_numpy()
        order = self.project["inputs"]["exposures"]["angles"]["order"]
        if order == "heading-pitch-roll":
            ned = rpy(np.radians(self.given[["roll", "pitch", "heading"]].to_numpy()))
            enu_from_ned = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
            return self.frame.enu(at) @ enu_from_ned @ ned
        r = opk(np.radians(self.given[["omega", "phi", "kappa"]].to_numpy()))
        return self.frame.grid(at) @ r @ np.swapaxes(self.mounting, 1, 2)

    def _attitude_covariance(self) -> Array:
        """Covariances (n, 3, 3) of rotations of the body about its axes."""
        inputs = self.project["inputs"]["exposures"]
        stated = np.broadcast_to(np.array(inputs["sigma"]["attitude_deg"], dtype=float), (3,))
        if inputs["angles"]["order"] == "heading-pitch-roll":
            names, angles = ("roll", "pitch", "heading"), self.given[["roll", "pitch", "heading"]].to_numpy()
            matrix = rpy
        else:
            names, angles = ("omega", "phi", "kappa"), self.given[["omega", "phi", "kappa"]].to_numpy()
            matrix = opk
        own = np.broadcast_to(stated, angles.shape).copy()
        for k, name in enumerate(names):
            if f"s{name}" in self.given:
                own[:, k] = self.given[f"s{name}"]
        angles, own = np.radians(angles), np.radians(own)
        columns = []
        for k in range(3):
            moved = angles.astype(complex)
            moved[:, k] += 1j * STEP
            change = np.swapaxes(matrix(angles), 1, 2) @ matrix(moved).imag / STEP
            columns.append(np.stack([change[:, 2, 1], change[:, 0, 2], change[:, 1, 0]], axis=-1))
        e = np.stack(columns, axis=-1)
        if matrix is opk:
            e = self.mounting @ e
        return np.einsum("nij,nj,nkj->nik", e, own**2, e)

    def correlation_time(self, group: str) -> float | None:
        """As estimated, or as stated; s."""
        for figure in self.results.summary.get("correlation_times") or ():
            if figure["group"] == group:
                return float(figure["correlation_s"])
        stated = self.settings.get(f"{group.split('_')[0]}_correlation_s")
        return None if stated is None else float(stated)

    def over_time(self, group: str, covariance: Array, step: complex = 0.0) -> Array:
        """(3 n, 3 n): errors L_i e_i with e of two exposures of a strip correlated by exp(−Δt/τ).

        A step is added to τ; ``series`` keeps the covariances (n, 3, 3) of single exposures.
        """
        self.series[group], tau = covariance, self.correlation_time(group)
        n = len(covariance)
        correlation = np.eye(n)
        if tau is not None:
            key = list(zip(self.flight, self.strip, strict=True))
            same = np.array([[a == b for b in key] for a in key])
            correlation = np.where(
                same, np.exp(-np.abs(np.subtract.outer(self.time, self.time)) / (tau + step)), 0.0
            )
        root = np.linalg.cholesky(covariance)
        return np.einsum("ij,iac,jbc->iajb", correlation, root, root).reshape(3 * n, 3 * n)

    # -- equations ------------------------------------------------------------------------------------

    def of(self, g: Array, names: tuple[str, ...], entities: list[str]) -> Array:
        """(n, len(names)) values of parameters for entities; zero where there are none."""
        padded = np.concatenate([g, [0.0]])
        key = names, id(entities)
        if key not in self.places:
            place = [[self.number.get((name, entity), -1) for name in names] for entity in entities]
            self.places[key] = np.array(place), entities
        return padded[self.places[key][0]]

    def body(self, exposure: Array, g: Array) -> tuple[Array, Array, Array]:
        """Projection centres, local_from_camera, local_from_body by the boresight."""
        centre = self.centre + turned(self.image_axes, exposure[:, :3])
        r = self.image_axes @ opk(exposure[:, 3:])
        boresight = rpy(self.of(g, ("boresight_roll", "boresight_pitch", "boresight_yaw"), self.camera))
        return centre, r, r @ np.swapaxes(self.mounting, 1, 2) @ np.swapaxes(boresight, 1, 2)

    def residuals(self, exposure: Array, point: Array, g: Array) -> list[Array]:
        """v = adjusted − observed of every group, in its order."""
        centre, r, body = self.body(exposure, g)
        place = self.place + turned(self.point_axes, point)
        found = [self._of_image_points(centre, r, place, g)]
        names = [group.name for group in self.groups]
        if "control_points" in names:
            apart = place[self.survey_point] - self.survey_local
            along = turned(np.swapaxes(self.survey_axes, 1, 2), apart)
            found.append(along[self.survey_known])
        if "distances" in names:
            ends = [self.measured[end].map(self.point_number).to_numpy() for end in ("point", "other_point")]
            between = place[ends[1]] - place[ends[0]]
            found.append(np.sqrt(np.sum(between * between, axis=1)) - self.measured["distance"].to_numpy())
        if "gnss_positions" in names:
            lever = turned(body, self.of(g, tuple(f"lever_arm_{c}" for c in "xyz"), self.camera))
            shift = self.of(g, tuple(f"gnss_shift_{c}" for c in "xyz"), self.flight)
            bias = self.of(g, tuple(f"gnss_strip_bias_{c}" for c in "xyz"), self.strip)
            drift = self.of(g, tuple(f"gnss_drift_{c}" for c in "xyz"), self.strip)
            offset = self.of(g, ("time_offset",), self.flight)
            v = centre + lever + shift + bias + drift * self.since_mid[:, None] - self.antenna
            v = v + self.speed * offset
            found.append(turned(np.swapaxes(self.antenna_axes, 1, 2), v).ravel())
        if "ins_attitudes" in names:
            axes = ("roll", "pitch", "yaw")
            bias = self.of(g, tuple(f"ins_strip_bias_{c}" for c in axes), self.strip)
            drift = self.of(g, tuple(f"ins_drift_{c}" for c in axes), self.strip)
            v = small_log(np.swapaxes(self.local_from_body, 1, 2) @ body)
            found.append((v + bias + drift * self.since_mid[:, None]).ravel())
        if "priors" in names:
            found.append(g[self.prior] - self.prior_value)
        return found

    def velocity(self) -> Array:
        v = np.zeros((len(self.images), 3))
        key = list(zip(self.flight, self.strip, strict=True))
        for strip in set(key):
            rows = np.flatnonzero([k == strip for k in key])
            rows = rows[np.argsort(self.time[rows])]
            if len(rows) > 1:
                v[rows] = np.gradient(self.antenna[rows], self.time[rows], axis=0)
        return v

    def _of_image_points(self, centre: Array, r: Array, place: Array, g: Array) -> Array:
        centre, r = self.pose_of_rays(centre[self.ray_image], r[self.ray_image], g)
        p = turned(np.swapaxes(r, 1, 2), place[self.ray_point] - centre)
        camera = self.ray_camera
        c = self.of(g, ("focal_length",), camera)
        x0 = self.of(g, ("principal_point_x", "principal_point_y"), camera)
        ideal = -c * p[:, :2] / p[:, 2:]
        return (ideal + x0 - self.correction(self.xy - x0, g, camera) - self.xy).ravel()

    def pose_of_rays(self, centre: Array, r: Array, _: Array) -> tuple[Array, Array]:
        """Projection centres and local_from_camera of the rays, from those of their exposures and from g."""
        return centre, r

    def correction(self, xy: Array, g: Array, camera: list[str]) -> Array:
        """Δ of Brown's parameters in metres."""
        values = self.of(g, tuple(f"brown:{name}" for name in BROWN), camera)
        return np.asarray(np.einsum("nik,nk->ni", brown(xy), values))


def block_diagonal(of: Array) -> Array:
    """A block-diagonal matrix (3 n, 3 n)."""
    n = len(of)
    return np.einsum("nij,nm->nimj", of, np.eye(n)).reshape(3 * n, 3 * n)


def named(table: pd.DataFrame, which: str = "") -> list[tuple[str, str]]:
    """Parameter and entity of the rows of a table."""
    return list(zip(table[f"parameter{which}"], table[f"entity{which}"], strict=True))


def _family(parameter: str) -> str:
    for ending in ("_x", "_y", "_z", "_roll", "_pitch", "_yaw"):
        if parameter.endswith(ending):
            return parameter[: -len(ending)]
    return parameter


def part_of(key: tuple[str, str, str, str]) -> str:
    """The part of the observations with one variance component that a scalar belongs to."""
    group, _, _, component = key
    if group in ("control_points", "gnss_positions"):
        return f"{group} {'height' if component == 'z' else 'plan'}"
    if group == "ins_attitudes":
        return f"{group} {'yaw' if component == 'yaw' else 'roll and pitch'}"
    return family_of(group)


def family_of(group: str) -> str:
    """The name of a group without entity or other end."""
    return ":".join(group.split(":")[: 2 if group.startswith("prior") else 1])


class Solved:
    """v, A, P, N and Q at the adjusted values, dense."""

    def __init__(self, delivered: Delivered, used: Callable[[tuple[str, str, str, str]], bool]) -> None:
        d = self.d = delivered
        self.keys = [key for group in d.groups for key in group.keys]
        self.used = np.array([used(key) for key in self.keys])
        n, m = len(d.images), len(d.points)
        self.x0 = np.concatenate([np.hstack([np.zeros((n, 3)), d.angles]).ravel(), np.zeros(3 * m), d.g])
        columns = [*range(6 * n + 3 * m), *(6 * n + 3 * m + np.flatnonzero(d.free))]
        self.columns = np.array(columns)
        self.all_v = self.v_at(self.x0)
        self.all_a = np.zeros((len(self.keys), len(columns)))
        # An observation belongs to one exposure and one point at most, so all of them move at once.
        for first, width, of in ((0, 6, self.image_of_row()), (6 * n, 3, self.point_of_row())):
            rows = np.flatnonzero(of >= 0)
            for k in range(width):
                every = first + k + width * np.arange(n if width == 6 else m)
                self.all_a[rows, first + k + width * of[rows]] = self.derivative(every)[rows]
        joined = [k for k, key in enumerate(self.keys) if key[0].startswith("distances:")]
        for k in joined:
            for point in (self.keys[k][2], self.keys[k][0].removeprefix("distances:")):
                for column in 6 * n + 3 * d.point_number[point] + np.arange(3):
                    self.all_a[k, column] = self.derivative(column)[k]
        for k in range(6 * n + 3 * m, len(columns)):
            self.all_a[:, k] = self.derivative(columns[k])
        covariance = scipy.linalg.block_diag(*(group.covariance for group in d.groups))
        components = delivered.results.summary["variance_components"]
        parts = {part["part"]: part["factor"] for part in components["components"]} if components else {}
        factor = np.array([parts.get(part_of(key), 1.0) for key in self.keys])
        covariance *= np.outer(factor, factor)
        self.sigma = np.sqrt(np.diagonal(covariance))
        keep = np.ix_(self.used, self.used)
        self.covariance = covariance[keep]
        self.p = np.linalg.inv(self.covariance)
        self.v, self.a = self.all_v[self.used], self.all_a[self.used]
        self.n = self.a.T @ self.p @ self.a
        self.q = inverse(self.n)

    def v_at(self, x: Array) -> Array:
        n, m = len(self.d.images), len(self.d.points)
        e, p, g = np.split(x, [6 * n, 6 * n + 3 * m])
        return np.concatenate(self.d.residuals(e.reshape(n, 6), p.reshape(m, 3), g))

    def image_of_row(self) -> Array:
        return np.array([self.d.image_number.get(key[1], -1) for key in self.keys])

    def point_of_row(self) -> Array:
        one = [key[2] if not key[0].startswith("distances:") else "" for key in self.keys]
        return np.array([self.d.point_number.get(point, -1) for point in one])

    def derivative(self, k: Any) -> Array:
        x = self.x0.astype(complex)
        x[k] += 1j * STEP
        return self.v_at(x).imag / STEP

    @property
    def redundancy(self) -> int:
        return len(self.v) - len(self.columns)

    @property
    def sigma0(self) -> float:
        return float(np.sqrt(self.v @ self.p @ self.v / self.redundancy))


def inverse(n: Array) -> Array:
    scale = 1.0 / np.sqrt(np.diagonal(n))
    return np.asarray(scale[:, None] * np.linalg.inv(n * np.outer(scale, scale)) * scale)
