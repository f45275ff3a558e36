"""BINGO: ``image.dat``, ``geoin.dat`` and ``itera.dat``.

Image points are in mm from the principal point, corrected by the additional parameters; φ, ω, κ of R = R_y(φ) R_x(ω) R_z(κ) are in gon.
Control and check points without one of their coordinates are left out. Names end at a blank, which becomes "_", as "#" does, which
begins a comment; tables say which is which.
"""  # noqa: E501

from __future__ import annotations

import numpy as np

from tasks.handover.delivery import Angles, Delivery, Files
from tasks.handover.formats.numbers import METRES, fixed, orientations
from tasks.handover.formats.short_names import renamed, without_blanks
from tasks.handover.formats.world_points import (
    corrected_image_points,
    image_lists,
    object_points,
    surveyed_points,
)

_DECIMALS_MM = 7
_COMMENT = "#"


def write_bingo(delivery: Delivery) -> Files:
    """The three files, and tables of the names that had to be changed."""
    images = without_blanks(delivery.names, _COMMENT)
    all_points = list(dict.fromkeys((*delivery.points.names, *delivery.points.surveyed.names)))
    short = without_blanks(all_points, _COMMENT)
    points = dict(zip(all_points, short, strict=True))
    cameras = without_blanks([camera.frame.name for camera in delivery.results.cameras], _COMMENT)
    return {
        "image.dat": _image_points(delivery, images, cameras, points),
        "geoin.dat": _control(delivery, cameras, points),
        "itera.dat": _orientations(delivery, images, cameras, points),
        **renamed("bingo_images.csv", "image", images, delivery.names),
        **renamed("bingo_points.csv", "point", short, all_points),
    }


def _image_points(delivery: Delivery, images: list[str], cameras: list[str], points: dict[str, str]) -> str:
    given, camera = delivery.points, delivery.results.images.camera
    xy, lines = corrected_image_points(delivery) * 1e3, []
    for k, rows in image_lists(delivery):
        lines.append(f"{images[k]} {cameras[camera[k]]}")
        for point, place in zip(given.point[rows], xy[rows], strict=True):
            lines.append(f"{points[given.names[point]]} {' '.join(fixed(place, _DECIMALS_MM))}")
        lines.append("-99")
    return "\n".join(lines) + "\n"


def _control(delivery: Delivery, cameras: list[str], points: dict[str, str]) -> str:
    focal = delivery.results.images.focal_length
    lines = [f"CAPA {name} 0 {focal[k] * 1e3:.6f} 0.0 0.0" for k, name in enumerate(cameras)]
    surveyed, place = delivery.points.surveyed, surveyed_points(delivery)
    for k in np.flatnonzero(np.isfinite(place).all(axis=1)):
        word = "CHCK" if surveyed.check[k] else "CONT"
        lines.append(f"{word} {points[surveyed.names[k]]} {' '.join(fixed(place[k], METRES))}")
    return "\n".join(lines) + "\n"


def _orientations(delivery: Delivery, images: list[str], cameras: list[str], points: dict[str, str]) -> str:
    camera, cells = delivery.results.images.camera, orientations(delivery, Angles("phi-omega-kappa", "gon"))
    lines = [" ".join(["ORIA", name, *cells[k], cameras[camera[k]]]) for k, name in enumerate(images)]
    for name, place in zip(delivery.points.names, object_points(delivery), strict=True):
        lines.append(f"CORD {points[name]} {' '.join(fixed(place, METRES))}")
    return "\n".join(lines) + "\n"
