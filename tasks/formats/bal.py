"""BAL, "bundle adjustment in the large": orientations and image points of problems for solvers.

First the numbers of cameras, points and observations; then ``camera point x y``, pixels from the middle of the image, y up
(unit = "centred-px"); then nine numbers of each camera, one a line: rotation vector (camera from world), translation, f, k1, k2; then the
coordinates of the points. A camera looks along −z, which are our axes. Images and points go by their numbers, 0 for the
first. Every image has a camera of its own, without a size: write the cameras into the project file.
"""  # noqa: E501

from __future__ import annotations

from itertools import chain
from pathlib import Path

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.rotation import exp
from tasks.errors import Location
from tasks.formats.plain_records import (
    LOCAL,
    degrees_of_rotations,
    exposures_of,
    image_points_of,
    names_of_numbers,
)
from tasks.formats.records import AngleOrder, ExposureRecords, ImagePointRecords
from tasks.formats.text_lines import DeliveredLines

_OF_CAMERA, _OF_POINT, _OF_OBSERVATION = 9, 3, 4


def read_bal_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read the orientations.

    Raises
    ------
    InputError
        If the file is cut off, or has something else than numbers.
    """
    observations, cameras = _opened(path)
    names = [str(number) for number in range(len(cameras))]
    at = [2 + len(observations) + _OF_CAMERA * number for number in range(len(cameras))]
    if (np.abs(cameras[:, :3]) > 1e3).any():
        raise Location(path).error("A rotation vector is longer than a full turn.", "Deliver the file again.")
    world_from_camera = np.swapaxes(exp(cameras[:, :3]), 1, 2)
    centre = -np.einsum("nij,nj->ni", world_from_camera, cameras[:, 3:6])
    angles = degrees_of_rotations(path, world_from_camera, names, at)
    return exposures_of(path, names, centre, angles, at, unit="deg", states=LOCAL)


def read_bal_image_points(path: Path) -> ImagePointRecords:
    """Read the observations.

    Raises
    ------
    InputError
        As `read_bal_exposures`.
    """
    observations, _ = _opened(path)
    image, point = (names_of_numbers(observations[:, column].astype(np.int64)) for column in (0, 1))
    return image_points_of(path, image, point, observations[:, 2:], range(2, 2 + len(observations)))


def _opened(path: Path) -> tuple[Floats, Floats]:
    """Observations (m, 4) and cameras (n, 9)."""
    text = DeliveredLines.of(path, lone_return=b"")
    pieces = text.pieces()
    first, _, rest = next(pieces).partition(b"\n")
    counts = first.split()
    if len(counts) != 3 or not all(one.isdigit() and len(one) < 10 for one in counts):
        raise Location(path, 1).error(
            "The first line is not the three numbers of cameras, points and observations.",
            "Check that it is a BAL problem, unpacked.",
        )
    cameras, points, observations = (int(one) for one in counts)
    needed = _OF_OBSERVATION * observations + _OF_CAMERA * cameras + _OF_POINT * points
    values, found, strange = np.empty(min(needed, text.size)), 0, None
    for piece in chain([rest], pieces):
        words = piece.split()
        begin, found = found, found + len(words)
        try:
            values[begin:found] = np.array(words[: max(len(values) - begin, 0)], dtype=np.float64)
        except ValueError as error:
            strange = error
    if found != needed:
        raise Location(path).error(
            f"The file has {found} numbers after the first line, and {needed} are announced.",
            "It may have been cut off: deliver it again.",
        )
    if strange is not None:
        raise Location(path).error(
            "The file contains text where a number is expected.", "Deliver it again."
        ) from strange
    table = values[: _OF_OBSERVATION * observations].reshape(-1, _OF_OBSERVATION)
    index = table[:, :2]
    if not ((index >= 0) & (index < [cameras, points]) & (index == np.round(index))).all():
        raise Location(path).error("An observation names no camera or point.", "Deliver it again.")
    if not np.isfinite(values).all():
        raise Location(path).error("The file contains a number that is not finite.", "Deliver it again.")
    begin = _OF_OBSERVATION * observations
    return table, values[begin : begin + _OF_CAMERA * cameras].reshape(-1, _OF_CAMERA)
