"""DBAT's camera calibration network: its text files, and the block they describe.

What DBAT calls a model: x' = (column · s − px, −row · s − py) in millimetres with the side s of a pixel
along the rows; (px, −py) is printed. So its principal point counts from the corner of the image, and
y is upward as in our image system. ω, φ, κ turn as ours. The control points have no standard deviation.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from adjust.approximate.intersection import intersect
from adjust.arrays import Floats, Ints
from adjust.block import Block
from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.register import additional_parameters
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.camera.interior import FrameCamera
from adjust.geometry.earth import CartesianFrame
from adjust.observations.base import StochasticModel
from adjust.observations.control_point import ControlPoints
from adjust.observations.image_point import ImagePoints
from adjust.parameters import (
    FAMILIES,
    INTERIOR_ORIENTATION,
    State,
    SystemParameters,
    additional_family,
)
from adjust.solve.system import Observations

COLUMNS, ROWS = 2272, 1704
PIXEL_MM = 5.43764 / ROWS
FOCAL_LENGTH_MM = 7.3  # of the picture's header: DBAT's start, and ours
CONTROL_SIGMA_M = 1e-8  # fixed: a thousandth of the last digit printed, and far below what the images know


@dataclass(frozen=True, eq=False)
class Network:
    """The measurements: names, indices of image points sorted by object point, columns and rows."""

    images: tuple[str, ...]
    points: tuple[str, ...]
    image: Ints
    point: Ints
    pixel: Floats
    control: Ints
    control_position: Floats


def read_network(folder: Path) -> Network:
    """The text files of the script."""
    marks = np.loadtxt(folder / "measurements" / "markpts.txt", delimiter=",", comments="#")
    images, image = np.unique(marks[:, 0].astype(int), return_inverse=True)
    points, point = np.unique(marks[:, 1].astype(int), return_inverse=True)
    order = np.lexsort((image, point))
    control = np.loadtxt(
        folder / "reference" / "camcal-fixed.txt", delimiter=",", comments="#", usecols=(0, 2, 3, 4)
    )
    return Network(
        tuple(map(str, images)),
        tuple(map(str, points)),
        image[order].astype(np.int64),
        point[order].astype(np.int64),
        marks[order, 2:4],
        np.searchsorted(points, control[:, 0].astype(int)).astype(np.int64),
        control[:, 1:],
    )


def camera() -> FrameCamera:
    """The Olympus C4040Z before its calibration."""
    pixel = PIXEL_MM * 1e-3
    return FrameCamera("C4040Z", COLUMNS, ROWS, pixel, FOCAL_LENGTH_MM * 1e-3, (0.0, 0.0), "corner", 0)


def block_of(network: Network, selection: str) -> tuple[Block, Observations]:
    """The block with c, x0, y0 and the selected additional parameters free, and its observations."""
    lens = camera()
    n = len(network.images)
    correction = additional_parameters(selection, ImageFormat(*lens.half_format))
    count = len(correction.names)
    interior = np.array([[lens.focal_length, *lens.principal_point]])
    rays = ImagePoints(
        network.image,
        network.point,
        np.zeros(n, dtype=np.int64),
        lens.image_from_pixel(network.pixel),
        np.full((len(network.image), 2), 0.1 * lens.pixel_size),
        np.ones(len(network.image), dtype=bool),
        SelfCalibration(correction.names, (correction,), np.zeros(n, dtype=np.int64)),
    )
    centre, local_from_camera = _resections(network, rays.xy, lens.focal_length)
    system = (
        SystemParameters(FAMILIES[INTERIOR_ORIENTATION], (lens.name,), interior, np.ones((1, 3), dtype=bool)),
        SystemParameters(
            additional_family(correction.names, correction.units),
            (lens.name,),
            np.zeros((1, count)),
            np.ones((1, count), dtype=bool),
        ),
    )
    start = State(
        centre,
        local_from_camera,
        np.zeros((len(network.points), 3)),
        {item.family.name: item.values for item in system},
    )
    object_point = intersect(rays, start, len(network.points)).object_point
    frame = CartesianFrame()
    control = ControlPoints(
        network.control,
        network.control_position,
        network.control_position[:, 2],
        frame,
        StochasticModel.from_sigma(np.full((len(network.control), 3), CONTROL_SIGMA_M)),
    )
    block = Block(
        frame,
        (lens,),
        network.images,
        np.zeros(n, dtype=np.int64),
        ("calibration",),
        np.zeros(n, dtype=np.int64),
        network.points,
        system,
        centre,
        local_from_camera,
        object_point,
    )
    return block, Observations(rays, (control,))


def _resections(network: Network, xy: Floats, focal_length: float) -> tuple[Floats, Floats]:
    """Orientations (n, 3) and (n, 3, 3) from the control points, which lie in the plane z = 0.

    (x/c, y/c, −1) is proportional to M (X, Y, 1) with M = [Rᵀe1, Rᵀe2, −Rᵀ X0].
    """
    centres, rotations = [], []
    for image in range(len(network.images)):
        rows = [np.flatnonzero((network.image == image) & (network.point == k))[0] for k in network.control]
        plane = np.column_stack([network.control_position[:, :2], np.ones(len(rows))])
        equations = []
        for (x, y), ground in zip(xy[rows] / focal_length, plane, strict=True):
            equations += [np.concatenate([ground, np.zeros(3), x * ground])]
            equations += [np.concatenate([np.zeros(3), ground, y * ground])]
        M = np.linalg.svd(np.array(equations))[2][-1].reshape(3, 3)
        M *= -np.sign((plane @ M[2]).sum()) * 2.0 / (np.linalg.norm(M[:, 0]) + np.linalg.norm(M[:, 1]))
        u, _, v = np.linalg.svd(np.column_stack([M[:, 0], M[:, 1], np.cross(M[:, 0], M[:, 1])]))
        local_from_camera = (u @ v).T
        rotations.append(local_from_camera)
        centres.append(-local_from_camera @ M[:, 2])
    return np.array(centres), np.array(rotations)
