"""Bundler ``bundle.out`` 0.3: orientations and image points of a local frame.

A camera looks along −z, x to the right, y up: its rotation is camera from world in our axes. Images go by
their numbers, 0 for the first, as the file has no names. Image points are pixels from the middle of the
image, y up: declare unit = "centred-px".
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from tasks.errors import Location
from tasks.formats.long_columns import LongRows, table_of
from tasks.formats.plain_records import (
    LOCAL,
    image_points_of,
    names_of_numbers,
    numbers_of,
)
from tasks.formats.records import AngleOrder, ExposureRecords, ImagePointRecords
from tasks.formats.text_lines import DeliveredLines, numbered_lines


def read_bundler_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read the oriented images; one with all zeros is not oriented.

    Raises
    ------
    InputError
        With file and line: another version of the file, numbers missing.
    """
    rows, cameras, _ = _opened(path)
    images = LongRows("rotation", "shift")
    for number in range(cameras):
        lens = array("d")
        for place, line in islice(rows, 5):
            lens.extend(numbers_of(path, line.split(), 3, place, "three numbers of a camera"))
        if any(lens[:3]):
            images.append(str(number), lens[3:12], lens[12:], line=3 + 5 * number)
    world_from_camera = np.swapaxes(images["rotation"], 1, 2)
    centre = -np.einsum("nij,nj->ni", world_from_camera, images["shift"])
    return images.exposures(path, LOCAL, position=centre, rotation=world_from_camera)


def read_bundler_image_points(path: Path) -> ImagePointRecords:
    """Read the image points of all points; points are named by their numbers, from 0.

    Raises
    ------
    InputError
        With file and line: another version of the file, numbers missing.
    """
    rows, cameras, points = _opened(path)
    views, counts, at = array("d"), array("q"), array("q")
    for place, line in islice(rows, 5 * cameras + 2, 5 * cameras + 3 * points, 3):
        words = line.split()
        count = int(numbers_of(path, words, 1, place, "the number of views")[0])
        if count < 0:
            raise Location(path, place).error("The number of views is negative.", "Deliver the file again.")
        views.extend(numbers_of(path, words[1:], 4 * count, place, "camera, key, x, y of each view"))
        counts.append(count)
        at.append(place)
    table = table_of(views, 4)
    point = np.repeat(np.arange(len(counts)), counts)
    image = names_of_numbers(table[:, 0].astype(np.int64))
    return image_points_of(path, image, names_of_numbers(point), table[:, 2:], np.repeat(at, counts))


def _opened(path: Path) -> tuple[Iterator[tuple[int, str]], int, int]:
    """Lines from the first camera on, number of cameras, number of points."""
    rows = numbered_lines(path)
    if not next(rows)[1].startswith("# Bundle file v0.3"):
        raise Location(path, 1).error(
            "The file does not begin with '# Bundle file v0.3'.", "Check that it is bundle.out."
        )
    cameras, points = numbers_of(path, next(rows, (2, ""))[1].split(), 2, 2, "numbers of cameras and points")
    count = DeliveredLines.of(path, lone_return=b"").lines
    if min(cameras, points) < 0 or 2 + 5 * cameras + 3 * points > count:
        raise Location(path, 2).error(
            f"The file has {count} lines, too few for {cameras:g} cameras and {points:g} points.",
            "It may have been cut off: deliver it again.",
        )
    return rows, int(cameras), int(points)
