"""A block as plain arrays: where both sides of a comparison start from."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.block import Block
from adjust.camera.interior import FrameCamera
from adjust.geometry.earth import CartesianFrame
from adjust.observations.base import StochasticModel
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.image_point import ImagePoints
from adjust.parameters import (
    BORESIGHT,
    FAMILIES,
    GNSS_SHIFT,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    State,
    SystemParameters,
)
from adjust.solve.system import Observations


@dataclass(frozen=True, eq=False)
class Problem:
    """Image points and GNSS positions of one distortion-free camera; metres and radians.

    Attributes
    ----------
    interior : (3,) c, x0, y0.
    projection_centre, local_from_camera, object_point : (n, 3), (n, 3, 3), (m, 3) start values.
    image, point : (r,) indices of every image point, sorted by point.
    xy : (r, 2) image system.
    sigma_image : (1,) standard deviation of an image coordinate.
    position : (n, 3) observed projection centres, local frame.
    position_sigma : (n, 3) standard deviations of east, north, up.
    local_from_enu : (n, 3, 3) axes of these.
    """

    interior: Floats
    projection_centre: Floats
    local_from_camera: Floats
    object_point: Floats
    image: Ints
    point: Ints
    xy: Floats
    sigma_image: Floats
    position: Floats
    position_sigma: Floats
    local_from_enu: Floats

    def write(self, path: Path) -> None:
        """Write all arrays into one file."""
        with path.open("wb") as file:
            np.savez(file, **{item.name: getattr(self, item.name) for item in fields(self)})

    @classmethod
    def read(cls, path: Path) -> Problem:
        """Read what :meth:`write` has written."""
        with np.load(path) as arrays:
            return cls(**{item.name: arrays[item.name] for item in fields(cls)})

    @property
    def position_covariance(self) -> Floats:
        """(n, 3, 3) covariance matrices of the observed positions, local frame, m²."""
        scaled = self.local_from_enu * self.position_sigma[:, None, :]
        covariance: Floats = scaled @ np.swapaxes(scaled, 1, 2)
        return covariance

    @property
    def start(self) -> Solution:
        """The start values."""
        return Solution(self.projection_centre, self.local_from_camera, self.object_point)


@dataclass(frozen=True, eq=False)
class Solution:
    """Adjusted values; shapes and frames as in :class:`Problem`."""

    projection_centre: Floats
    local_from_camera: Floats
    object_point: Floats

    def write(self, path: Path) -> None:
        """Write all arrays into one file."""
        with path.open("wb") as file:
            np.savez(file, **{item.name: getattr(self, item.name) for item in fields(self)})

    @classmethod
    def read(cls, path: Path) -> Solution:
        """Read what :meth:`write` has written."""
        with np.load(path) as arrays:
            return cls(**{item.name: arrays[item.name] for item in fields(cls)})


def block_of(problem: Problem) -> tuple[Block, Observations]:
    """The problem as ``adjust`` takes it; every system parameter is held."""
    n = len(problem.projection_centre)
    c, x0, y0 = (float(value) for value in problem.interior)
    # The format is not used in an adjustment; any that holds all image points will do.
    camera = FrameCamera("camera", 10_000, 10_000, 1e-5, c, (x0, y0), "corner", 0)
    held = np.zeros((1, 3), dtype=bool)
    system = tuple(
        SystemParameters(
            FAMILIES[name],
            (entity,),
            problem.interior[None] if name == INTERIOR_ORIENTATION else 0.0 * held,
            held,
        )
        for name, entity in (
            (INTERIOR_ORIENTATION, camera.name),
            (BORESIGHT, camera.name),
            (LEVER_ARM, camera.name),
            (GNSS_SHIFT, "flight"),
        )
    )
    zeros = np.zeros(n, dtype=np.int64)
    block = Block(
        CartesianFrame(),
        (camera,),
        tuple(map(str, range(n))),
        zeros,
        ("flight",),
        zeros,
        tuple(map(str, range(len(problem.object_point)))),
        system,
        problem.projection_centre,
        problem.local_from_camera,
        problem.object_point,
    )
    rays = len(problem.image)
    image_points = ImagePoints(
        problem.image,
        problem.point,
        zeros,
        problem.xy,
        np.full((rays, 2), problem.sigma_image[0]),
        np.ones(rays, dtype=bool),
    )
    positions = GnssPositions(
        np.arange(n),
        zeros,
        zeros,
        problem.position,
        problem.local_from_enu,
        block.body_from_camera,
        StochasticModel.from_sigma(problem.position_sigma),
    )
    return block, Observations(image_points, (positions,))


def cost(problem: Problem, solution: Solution) -> float:
    """vᵀPv of a solution, whoever found it, in plain array arithmetic and not by the kernels.

    The one function by which both sides are judged: Σ |v|²/σ² over the image points plus
    Σ vᵀ C⁻¹ v over the positions.
    """
    arm = solution.object_point[problem.point] - solution.projection_centre[problem.image]
    in_camera = np.einsum("rji,rj->ri", solution.local_from_camera[problem.image], arm)
    c, principal_point = problem.interior[0], problem.interior[1:]
    computed = principal_point - c * in_camera[:, :2] / in_camera[:, 2:]
    of_rays = np.sum((computed - problem.xy) ** 2) / problem.sigma_image[0] ** 2
    off = solution.projection_centre - problem.position
    in_enu = np.einsum("nji,nj->ni", problem.local_from_enu, off)
    return float(of_rays + np.sum((in_enu / problem.position_sigma) ** 2))


def solution_of(state: State) -> Solution:
    """The adjusted values of a state."""
    return Solution(state.projection_centre, state.local_from_camera, state.object_point)
