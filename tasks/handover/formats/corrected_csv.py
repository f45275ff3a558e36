"""A block without systematic errors as tables, for programs that know a focal length and a principal point only.

| file | columns |
|---|---|
| ``image_points.csv`` | image, point, x, y, sx, sy: mm in the image system, corrected by additional parameters, mean residuals and refraction |
| ``exterior_orientations.csv`` | image, camera, strip, x, y, z, omega, phi, kappa and their standard deviations: metres, degrees |
| ``cameras.csv`` | camera, columns, rows, pixel_um, focal_length_mm, x0_mm, y0_mm |
| ``object_points.csv`` | point, x, y, z and their standard deviations: adjusted, metres |
| ``control_points.csv`` | point, x, y, z, standard deviations, role: surveyed, metres |

Refraction stays in the image points where it is contained in the orientations (``map-cartesian``).
"""  # noqa: E501

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from adjust.arrays import Floats
from adjust.camera.interior import FrameCamera
from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.numbers import ANGLES, METRES, fixed, fixed_rows, known, orientations, table
from tasks.handover.formats.world_points import object_points, straight_image_points, surveyed_points

_XYZ = ("x", "y", "z")
_SIGMA_XYZ = ("sx", "sy", "sz")
_ANGLES = ("omega", "phi", "kappa")
_DECIMALS_MM = 7


def write_corrected_csv(delivery: Delivery) -> Files:
    """The five tables; without points only orientations and cameras."""
    files = {"exterior_orientations.csv": _orientations(delivery), "cameras.csv": cameras_csv(delivery)}
    if delivery.points.names:
        files["image_points.csv"] = _image_points(delivery)
        files["object_points.csv"] = _points(
            delivery.points.names, object_points(delivery), delivery.points.sigma
        )
    surveyed = delivery.points.surveyed
    if surveyed.names:
        place = surveyed_points(delivery)
        # In a local frame a point that lacks a coordinate has none.
        placed = np.flatnonzero(np.isfinite(place).any(axis=1))
        files["control_points.csv"] = _points(
            [surveyed.names[k] for k in placed],
            place[placed],
            surveyed.sigma[placed],
            ["check" if check else "control" for check in surveyed.check[placed]],
        )
    return files


def cameras_csv(delivery: Delivery) -> str:
    """The cameras with focal lengths for the delivered orientations and principal points; no distortion."""
    focal = dict(zip(delivery.camera_names, delivery.handed.pose.focal_length, strict=True))
    frames = [camera.frame for camera in delivery.results.cameras]
    return ideal_cameras([replace(frame, focal_length=float(focal[frame.name])) for frame in frames])


def ideal_cameras(frames: Iterable[FrameCamera]) -> str:
    """The table of cameras without distortion."""
    rows = []
    for frame in frames:
        lengths = [1e3 * frame.focal_length, *(1e3 * value for value in frame.principal_point)]
        pixel = f"{1e6 * frame.pixel_size:.6f}"
        rows.append([frame.name, frame.columns, frame.rows, pixel, *fixed(lengths, _DECIMALS_MM)])
    head = ["camera", "columns", "rows", "pixel_um", "focal_length_mm", "x0_mm", "y0_mm"]
    return table(head, rows)


def _image_points(delivery: Delivery) -> str:
    points, images = delivery.points, delivery.results.images
    x0 = np.array([camera.frame.principal_point for camera in delivery.results.cameras])
    xy = 1e3 * (straight_image_points(delivery) + x0[images.camera[points.image]])
    numbers = fixed_rows(np.column_stack([xy, 1e3 * points.sigma_xy]), _DECIMALS_MM)
    rows = (
        [images.names[image], points.names[point], *cells]
        for image, point, cells in zip(points.image, points.point, numbers, strict=True)
    )
    return table(["image", "point", "x", "y", "sx", "sy"], rows)


def _orientations(delivery: Delivery) -> str:
    strips, sigmas = delivery.results.strips, delivery.sigmas.to_numpy(np.float64)
    named = zip(delivery.names, delivery.camera_names, strips, orientations(delivery), sigmas, strict=True)
    rows = (
        [name, camera, strip, *cells, *known(sigma[:3], METRES), *known(sigma[3:], ANGLES)]
        for name, camera, strip, cells, sigma in named
    )
    head = ["image", "camera", "strip", *_XYZ, *_ANGLES, *_SIGMA_XYZ, *(f"s{name}" for name in _ANGLES)]
    return table(head, rows)


def _points(names: Sequence[str], place: Floats, sigma: Floats, role: Sequence[str] = ()) -> str:
    rows = [
        [name, *known(place[k], METRES), *known(sigma[k], METRES), *role[k : k + 1]]
        for k, name in enumerate(names)
    ]
    return table(["point", *_XYZ, *_SIGMA_XYZ, *(["role"] if role else [])], rows)
