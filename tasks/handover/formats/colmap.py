"""COLMAP text model: ``cameras.txt``, ``images.txt``, ``points3D.txt``; ``points.csv`` names the points.

Numbers count from 1 in the order of the results. FULL_OPENCV is written where k3 is needed, else OPENCV. The error of a point is
the mean length of its residuals in pixels, as COLMAP has it. ``rigs.txt`` and ``frames.txt`` (COLMAP 3.12 and later) are written where heads of
a rig sit beside their reference head alike in all events.
"""  # noqa: E501

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.camera_axes import camera_from_world, exact, pixels, quaternions
from tasks.handover.formats.numbers import METRES, fixed, table
from tasks.handover.formats.rigs import written_rigs
from tasks.handover.formats.short_names import renamed, without_blanks
from tasks.handover.lens import LensModel, seen_pixels

_GREY = "128 128 128"
# By their first words COLMAP's own files are known, too.
_RIGS = (
    "# Rig calib list with one line of data per calib: RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID, "
    "SENSORS[] as (SENSOR_TYPE, SENSOR_ID, HAS_POSE, [QW, QX, QY, QZ, TX, TY, TZ])"
)
_FRAMES = (
    "# Frame list with one line of data per frame: FRAME_ID, RIG_ID, RIG_FROM_WORLD[QW, QX, QY, QZ, TX, TY, "
    "TZ], NUM_DATA_IDS, DATA_IDS[] as (SENSOR_TYPE, SENSOR_ID, DATA_ID)"
)
_PIXEL_DECIMALS = 4


def write_colmap(delivery: Delivery) -> Files:
    """The model."""
    names = without_blanks(delivery.names)
    cameras = [_camera(k, model) for k, model in enumerate(delivery.lenses.models, start=1)]
    return {
        "cameras.txt": "\n".join(["# CAMERA_ID MODEL WIDTH HEIGHT PARAMS", *cameras]) + "\n",
        "images.txt": _images(delivery, names),
        "points3D.txt": _points(delivery),
        "points.csv": table(["POINT3D_ID", "point", "role"], delivery.points.numbered(first=1)),
        **renamed("images.csv", "image", names, delivery.names),
        **_rigs(delivery),
    }


def _rigs(delivery: Delivery) -> Files:
    """Rigs and frames of a block whose heads have the same relative pose in all events."""
    found = written_rigs(delivery)
    if found is None:
        return {}
    rigs, frames = [_RIGS], [_FRAMES]
    pose = np.hstack([quaternions(found.turn), found.shift])
    references = np.unique(found.reference)
    for number, one in enumerate(references, start=1):
        others = np.flatnonzero((found.reference == one) & (np.arange(len(found.reference)) != one))
        sensors = [f"CAMERA {head + 1} 1 {' '.join(map(exact, pose[head]))}" for head in others]
        rigs.append(" ".join([f"{number} {len(others) + 1} CAMERA {one + 1}", *sensors]))
    of_rig = np.hstack([quaternions(found.rig_turn), found.rig_shift])
    for number, images in enumerate(found.events, start=1):
        rig = int(np.searchsorted(references, found.reference[found.camera[images[0]]])) + 1
        taken = [f"CAMERA {found.camera[k] + 1} {k + 1}" for k in images]
        values = " ".join(map(exact, of_rig[images[0]]))
        frames.append(f"{number} {rig} {values} {len(images)} {' '.join(taken)}")
    return {"rigs.txt": "\n".join(rigs) + "\n", "frames.txt": "\n".join(frames) + "\n"}


def _camera(number: int, model: LensModel) -> str:
    (fx, fy), (cx, cy), lens = model.focal, model.principal_point, model.distortion
    values = [fx, fy, cx, cy, lens["k1"], lens["k2"], lens["p1"], lens["p2"]]
    name = "OPENCV"
    if lens["k3"]:
        name, values = "FULL_OPENCV", [*values, lens["k3"], 0.0, 0.0, 0.0]
    return f"{number} {name} {model.columns} {model.rows} {' '.join(map(exact, values))}"


def _images(delivery: Delivery, names: list[str]) -> str:
    rotation, translation = camera_from_world(delivery)
    points, camera = delivery.points, delivery.results.images.camera
    measured, turns = pixels(delivery), quaternions(rotation)
    lines = ["# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then X Y POINT3D_ID of its points"]
    ends = np.searchsorted(points.image, np.arange(len(names) + 1))
    for k, name in enumerate(names):
        pose = " ".join(map(exact, [*turns[k], *translation[k]]))
        lines.append(f"{k + 1} {pose} {camera[k] + 1} {name}")
        of_image = slice(ends[k], ends[k + 1])
        lines.append(
            " ".join(
                f"{column:.{_PIXEL_DECIMALS}f} {row:.{_PIXEL_DECIMALS}f} {point + 1}"
                for (column, row), point in zip(measured[of_image], points.point[of_image], strict=True)
            )
        )
    return "\n".join(lines) + "\n"


def _points(delivery: Delivery) -> str:
    points = delivery.points
    # Place of every image point in its image.
    first = np.searchsorted(points.image, points.image)
    place = np.arange(len(points.image)) - first
    error = _errors(delivery)
    lines = ["# POINT3D_ID X Y Z R G B ERROR, then IMAGE_ID POINT2D_IDX of its track"]
    for k, (position, rays) in enumerate(zip(points.local, points.rays_of_points, strict=True)):
        track = " ".join(f"{points.image[ray] + 1} {place[ray]}" for ray in rays)
        mean = float(error[rays].mean()) if len(rays) else 0.0
        lines.append(f"{k + 1} {' '.join(fixed(position, METRES + 2))} {_GREY} {mean:.4f} {track}".rstrip())
    return "\n".join(lines) + "\n"


def _errors(delivery: Delivery) -> Floats:
    """(m,) length of the residual of every image point in the model that is written, pixels."""
    rotation, translation = camera_from_world(delivery)
    points = delivery.points
    in_camera = np.einsum("mij,mj->mi", rotation[points.image], points.local[points.point])
    computed = seen_pixels(
        delivery.lenses, delivery.results.images.camera[points.image], in_camera + translation[points.image]
    )
    return np.asarray(np.linalg.norm(pixels(delivery) - computed, axis=1))
