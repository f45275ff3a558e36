"""GeoPackage for QGIS, ArcGIS and every GIS: the block as layers.

| layer | geometry |
|---|---|
| ``cameras`` | projection centres with angles and standard deviations |
| ``footprints`` | corners of the images on the ground at middle height below each, through the curved earth |
| ``tie_points`` | adjusted object points |
| ``control_points``, ``check_points`` | as surveyed, with adjusted − surveyed; a coordinate that was not surveyed is the adjusted one |
| ``residual_vectors`` | from each of these to where it was adjusted, enlarged as ``enlarged`` says |
"""  # noqa: E501

from __future__ import annotations

import numpy as np

from adjust.arrays import Bools, Floats
from tasks.handover.delivery import Angles, Delivery, Files
from tasks.handover.footprint import footprints
from tasks.handover.formats.geopackage_file import Cell, Layer, geopackage
from tasks.handover.formats.numbers import in_angles

# Largest residual vector as part of the block.
_LONGEST = 0.05
_SIGMAS = {"sigma_x_m": float, "sigma_y_m": float, "sigma_z_m": float}
_DIFFERENCES = {"dx_m": float, "dy_m": float, "dz_m": float}


def write_geopackage(delivery: Delivery) -> Files:
    """``block.gpkg``."""
    surveyed = delivery.points.surveyed
    layers = [
        _cameras(delivery),
        _footprints(delivery),
        _tie_points(delivery),
        _surveyed(delivery, "control_points", ~surveyed.check),
        _surveyed(delivery, "check_points", surveyed.check),
        _vectors(delivery),
    ]
    place = delivery.results.images.map_frame
    return {"block.gpkg": geopackage(place, delivery.results.name, layers)}


def _cameras(delivery: Delivery) -> Layer:
    pose = delivery.handed.pose
    angles, sigmas = in_angles(pose.map_from_camera, Angles()), delivery.sigmas
    rows: list[list[Cell]] = [
        [name, delivery.camera_names[k], delivery.results.strips[k], *angles[k].tolist(), *sigma]
        for k, (name, sigma) in enumerate(zip(delivery.names, sigmas.to_numpy(float).tolist(), strict=True))
    ]
    columns = dict.fromkeys(("image", "camera", "strip"), str)
    numbers = dict.fromkeys(("omega_deg", "phi_deg", "kappa_deg", *sigmas.columns), float)
    text = "Adjusted projection centres; angles from grid north"
    return Layer("cameras", text, "POINT", pose.centre[:, None], {**columns, **numbers}, rows)


def _footprints(delivery: Delivery) -> Layer:
    corners, below = footprints(delivery.results)
    rows: list[list[Cell]] = [
        [delivery.names[k], delivery.camera_names[k], delivery.results.strips[k], float(corners[k, 0, 2])]
        for k in np.flatnonzero(below)
    ]
    columns = {"image": str, "camera": str, "strip": str, "ground_m": float}
    text = "Images on the ground at the middle height of their tie points"
    return Layer("footprints", text, "POLYGON", list(corners[below]), columns, rows)


def _tie_points(delivery: Delivery) -> Layer:
    points = delivery.points
    kept = np.flatnonzero(~points.is_surveyed)
    rays = points.rays
    rows: list[list[Cell]] = [[points.names[k], int(rays[k]), *points.sigma[k].tolist()] for k in kept]
    columns = {"point": str, "rays": int, **_SIGMAS}
    return Layer("tie_points", "Adjusted object points", "POINT", points.in_map[kept, None], columns, rows)


def _surveyed(delivery: Delivery, name: str, kept: Bools) -> Layer:
    surveyed, place = delivery.points.surveyed, _places(delivery)
    kept = kept & np.isfinite(place).all(axis=1)
    rows: list[list[Cell]] = [
        [surveyed.names[k], *surveyed.sigma[k].tolist(), *surveyed.difference[k].tolist()]
        for k in np.flatnonzero(kept)
    ]
    columns = {"point": str, **_SIGMAS, **_DIFFERENCES}
    text = "Surveyed points, with adjusted minus surveyed coordinates"
    return Layer(name, text, "POINT", place[kept, None], columns, rows)


def _vectors(delivery: Delivery) -> Layer:
    """Lines in plan and height; zero for a coordinate that was not surveyed."""
    surveyed, place = delivery.points.surveyed, _places(delivery)
    difference = np.nan_to_num(surveyed.difference)
    kept = np.isfinite(place).all(axis=1) & np.isfinite(surveyed.difference).any(axis=1)
    enlarged = _enlargement(delivery, difference[kept])
    rows: list[list[Cell]] = [
        [
            surveyed.names[k],
            "check" if surveyed.check[k] else "control",
            *surveyed.difference[k].tolist(),
            float(np.hypot(*difference[k, :2])),
            enlarged,
        ]
        for k in np.flatnonzero(kept)
    ]
    columns = {"point": str, "role": str, **_DIFFERENCES, "plan_m": float, "enlarged": float}
    ends = place + enlarged * difference
    lines = np.stack([place, ends], axis=1)[kept]
    text = "Adjusted minus surveyed, enlarged by the factor in the column enlarged"
    return Layer("residual_vectors", text, "LINESTRING", list(lines), columns, rows)


def _places(delivery: Delivery) -> Floats:
    """(s, 3) surveyed coordinates, completed by adjusted ones."""
    points = delivery.points
    adjusted = dict(zip(points.names, points.in_map, strict=True))
    missing = np.full(3, np.nan)
    found = np.array([adjusted.get(name, missing) for name in points.surveyed.names]).reshape(-1, 3)
    return np.where(np.isfinite(points.surveyed.in_map), points.surveyed.in_map, found)


def _enlargement(delivery: Delivery, difference: Floats) -> float:
    """1, 2 or 5 times a power of ten that makes the largest vector in plan a small part of the block."""
    longest = float(np.linalg.norm(difference[:, :2], axis=1).max(initial=0.0))
    centre = delivery.handed.pose.centre
    extent = float(np.linalg.norm(np.ptp(centre[:, :2], axis=0)))
    if longest == 0.0 or extent == 0.0:
        return 1.0
    wanted = _LONGEST * extent / longest
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(power * step for step in (1.0, 2.0, 5.0) if power * step <= wanted * (1.0 + 1e-9)))
