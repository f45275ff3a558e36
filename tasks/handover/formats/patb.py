"""PATB: orientations, image points and control in its three files.

| file | content |
|---|---|
| ``patb.ori`` | positions and rotation matrices, image → object, in fixed columns (4F16, 5F16.12, 4F16.12) |
| ``patb.im`` | lists of image points to −99, µm from the principal point, corrected by the additional parameters |
| ``patb.con``, ``patb_check.con`` | control and check points: a list of X, Y and one of Z, each to −99 |

Photos and points are numbers; where names are not, tables say which is which.
"""  # noqa: E501

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.numbers import METRES, ROTATION, fixed, table
from tasks.handover.formats.world_points import corrected_image_points, image_lists, surveyed_points

_DIGITS = 15
_DECIMALS_UM = 4


def write_patb(delivery: Delivery) -> Files:
    """The three files, ``patb_images.csv`` and ``patb_points.csv`` where names had to be numbered."""
    photos, renamed = numbers_of_names(delivery.names)
    files: dict[str, str] = {"patb.ori": _orientations(delivery, photos)}
    if renamed:
        files["patb_images.csv"] = table(["photo", "image"], list(zip(photos, delivery.names, strict=True)))
    names = tuple(dict.fromkeys((*delivery.points.names, *delivery.points.surveyed.names)))
    if not names:
        return files
    numbers, renamed = numbers_of_names(names)
    number_of = dict(zip(names, numbers, strict=True))
    files["patb.im"] = _image_points(delivery, photos, number_of)
    for file, check in (("patb.con", False), ("patb_check.con", True)):
        chosen = np.flatnonzero(delivery.points.surveyed.check == check)
        if len(chosen):
            files[file] = _control(delivery, chosen.tolist(), number_of)
    if renamed:
        files["patb_points.csv"] = table(["number", "point"], list(zip(numbers, names, strict=True)))
    return files


def _orientations(delivery: Delivery, photos: Sequence[str]) -> str:
    pose, lines = delivery.handed.pose, []
    for number, centre, rotation in zip(photos, pose.centre, pose.map_from_camera, strict=True):
        elements = fixed(rotation.ravel(), ROTATION)
        records = ([number, "0.00000000", *fixed(centre, 5)], elements[:5], elements[5:])
        lines += ["".join(f"{cell:>16}" for cell in record) for record in records]
    return "\n".join(lines) + "\n"


def _image_points(delivery: Delivery, photos: Sequence[str], number_of: dict[str, str]) -> str:
    points, images = delivery.points, delivery.results.images
    xy, lines = corrected_image_points(delivery) * 1e6, []
    for k, rows in image_lists(delivery):
        lines.append(f"{photos[k]:>16} {images.focal_length[images.camera[k]] * 1e6:.3f}")
        for point, place in zip(points.point[rows], xy[rows], strict=True):
            x, y = fixed(place, _DECIMALS_UM)
            lines.append(f"{number_of[points.names[point]]:>16} {x:>15} {y:>15}")
        lines.append(f"{-99:>16}")
    return "\n".join(lines) + "\n"


def _control(delivery: Delivery, chosen: Sequence[int], number_of: dict[str, str]) -> str:
    place, names, lines = surveyed_points(delivery), delivery.points.surveyed.names, []
    for coordinates in (slice(0, 2), slice(2, 3)):
        for k in chosen:
            values = place[k, coordinates]
            if np.isfinite(values).all():
                cells = "".join(f"{cell:>16}" for cell in fixed(values, METRES))
                lines.append(f"{number_of[names[k]]:>16}{cells}")
        lines.append(f"{-99:>16}")
    return "\n".join(lines) + "\n"


def numbers_of_names(names: Sequence[str]) -> tuple[list[str], bool]:
    """Numbers of photos or points, and whether they differ from the names."""
    plain = all(name.isascii() and name.isdigit() and len(name) <= _DIGITS for name in names)
    if plain and not any(name.startswith("0") for name in names):
        return list(names), False
    return [str(number) for number in range(1, len(names) + 1)], True
