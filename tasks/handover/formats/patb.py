"""PATB: orientations with rotation matrices in fixed columns (4F16, 5F16.12, 4F16.12).

The matrix is image → object, row by row. Photo numbers are digits; where names are not, a table says which is
which.
"""

from __future__ import annotations

from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.numbers import ROTATION, fixed, table

_DIGITS = 15


def write_patb(delivery: Delivery) -> Files:
    """``patb.ori``, and ``patb_images.csv`` where photos had to be numbered."""
    numbers, renamed = photo_numbers(delivery.names)
    pose = delivery.handed.pose
    lines = []
    for number, centre, rotation in zip(numbers, pose.centre, pose.map_from_camera, strict=True):
        elements = fixed(rotation.ravel(), ROTATION)
        records = ([number, "0.00000000", *fixed(centre, 5)], elements[:5], elements[5:])
        lines += ["".join(f"{cell:>16}" for cell in record) for record in records]
    files = {"patb.ori": "\n".join(lines) + "\n"}
    if renamed:
        files["patb_images.csv"] = table(["photo", "image"], list(zip(numbers, delivery.names, strict=True)))
    return files


def photo_numbers(names: tuple[str, ...]) -> tuple[list[str], bool]:
    """Numbers of photos, and whether they are not the names themselves."""
    plain = all(name.isascii() and name.isdigit() and len(name) <= _DIGITS for name in names)
    if plain and not any(name.startswith("0") for name in names):
        return list(names), False
    return [str(number) for number in range(1, len(names) + 1)], True
