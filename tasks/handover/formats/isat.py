"""ImageStation (ISAT): the files ``photo`` and ``camera``, ω, φ, κ in degrees, and distortion grids.

Names end at a blank, which becomes "_"; tables say which photo and which strip is which.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.grid_text import camera_words, gridgroups
from tasks.handover.formats.numbers import ANGLES, METRES, fixed, orientations
from tasks.handover.formats.short_names import renamed, without_blanks
from tasks.handover.results import CalibratedCamera


def write_isat(delivery: Delivery) -> Files:
    """``photo``, ``camera``, grids of cameras with corrections; standard deviations of the adjustment."""
    cells, sigmas = orientations(delivery), delivery.sigmas.to_numpy(float)
    images, cameras = without_blanks(delivery.names), camera_words(delivery)
    strips = list(dict.fromkeys(strip for strip in delivery.results.strips if strip))
    short = without_blanks(strips)
    strip_of = {"": _another(short), **dict(zip(strips, short, strict=True))}
    photos = []
    for k, name in enumerate(delivery.names):
        photos += [
            f"begin photo_parameters {images[k]} strip_id {strip_of[delivery.results.strips[k]]}",
            f" camera_name: {cameras[delivery.results.images.camera[k]]}",
            f" image_id: {name}",
            f" EO_parameters: {' '.join(cells[k])}",
            f" COMPUTED_std_devs: {' '.join([*fixed(sigmas[k, :3], METRES), *fixed(sigmas[k, 3:], ANGLES)])}",
            "end photo_parameters",
        ]
    focal = dict(zip(delivery.camera_names, delivery.handed.pose.focal_length, strict=True))
    listed = [
        line
        for item, name in zip(delivery.results.cameras, cameras, strict=True)
        for line in _camera(item, name, float(focal[item.frame.name]))
    ]
    return {
        "photo": "\n".join(photos) + "\n",
        "camera": "\n".join(listed) + "\n",
        **gridgroups(delivery),
        **renamed("isat_images.csv", "image", images, delivery.names),
        **renamed("isat_strips.csv", "strip", short, strips),
    }


def _another(strips: Sequence[str]) -> str:
    """The strip of photos without any: a number that no other strip has."""
    return next(number for number in map(str, count(1)) if number not in strips)


def _camera(camera: CalibratedCamera, name: str, focal_length: float) -> list[str]:
    frame = camera.frame
    x0, y0 = fixed([1e3 * value for value in frame.principal_point], 6)
    return [
        f"begin camera_parameters {name}",
        f" focal_length: {1e3 * focal_length:.6f}",
        f" ppac: {x0} {y0}",
        f" pixel_size: {1e6 * frame.pixel_size:.6f}",
        f" image_size_in_pixels: {frame.columns} {frame.rows}",
        " camera_type: frame",
        " media_type: digital",
        " lens_distortion_flag: off",
        "end camera_parameters",
    ]
