"""Bundler ``bundle.out`` 0.3: orientations and image points of a local frame.

A camera looks along −z, x to the right, y up: its rotation is camera from world in our axes. Images go by
their numbers, 0 for the first, as the file has no names. Image points are pixels from the middle of the
image, y up: declare unit = "centred-px".
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tasks.errors import InputError
from tasks.formats.plain_lines import lines
from tasks.formats.plain_records import degrees_of_rotations, exposures_of, image_points_of, numbers_of
from tasks.formats.records import AngleOrder, ExposureRecords, FileStatement, ImagePointRecords


def read_bundler_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read the oriented images; all zeros are one that is not.

    Raises
    ------
    InputError
        With file and line: another version of the file, numbers missing.
    """
    rows, cameras, _ = _opened(path)
    image, rotation, shift, at = [], [], [], []
    for number in range(cameras):
        begin = 2 + 5 * number
        values = [numbers_of(path, _row(rows, begin + k), 3, begin + k + 1, "three numbers of a camera")
                  for k in range(5)]  # fmt: skip
        if not any(values[0]):
            continue
        image.append(str(number))
        rotation.append(values[1:4])
        shift.append(values[4])
        at.append(begin + 1)
    world_from_camera = np.array(rotation).reshape(-1, 3, 3).transpose(0, 2, 1)
    angles = degrees_of_rotations(path, world_from_camera, image, at)
    centre = -np.einsum("nij,nj->ni", world_from_camera, np.array(shift).reshape(-1, 3))
    states = FileStatement(crs="local", order="omega-phi-kappa")
    return exposures_of(path, image, centre, angles, at, unit="deg", states=states)


def read_bundler_image_points(path: Path) -> ImagePointRecords:
    """Read the image points of all points; points go by their numbers, 0 for the first.

    Raises
    ------
    InputError
        With file and line: another version of the file, numbers missing.
    """
    rows, cameras, points = _opened(path)
    image, point, xy, at = [], [], [], []
    for number in range(points):
        place = 2 + 5 * cameras + 3 * number + 2
        views = _row(rows, place)
        count = int(numbers_of(path, views, 1, place + 1, "the number of views")[0])
        if count < 0:
            raise InputError("The number of views is negative.", "Deliver the file again.", path, place + 1)
        values = numbers_of(path, views[1:], 4 * count, place + 1, "camera, key, x, y of each view")
        for view in range(count):
            camera, _, x, y = values[4 * view : 4 * view + 4]
            image.append(str(int(camera)))
            point.append(str(number))
            xy.append([x, y])
            at.append(place + 1)
    return image_points_of(path, image, point, xy, at)


def _opened(path: Path) -> tuple[list[str], int, int]:
    """Lines, number of cameras, number of points."""
    rows = lines(path)
    if not rows[0].startswith("# Bundle file v0.3"):
        raise InputError(
            "The file does not begin with '# Bundle file v0.3'.", "Check that it is bundle.out.", path, 1
        )
    cameras, points = numbers_of(path, _row(rows, 1), 2, 2, "numbers of cameras and points")
    if min(cameras, points) < 0 or 2 + 5 * cameras + 3 * points > len(rows):
        raise InputError(
            f"The file has {len(rows)} lines, too few for {cameras:g} cameras and {points:g} points.",
            "It may have been cut off: deliver it again.",
            file=path,
            line=2,
        )
    return rows, int(cameras), int(points)


def _row(rows: list[str], index: int) -> list[str]:
    return rows[index].split() if index < len(rows) else []
