"""Image points of a camera without distortion, and the correction as grids for programs that use grids.

Distortion is additional parameters and mean residuals. All are points in the image system, from the centre of
the format. A program interpolates bilinearly between the nodes of a grid. What that leaves of the rigorous
correction is the misfit; at seams of composed images, where the correction jumps, it is as large as the jump.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.correction import measured_from_ideal
from tasks.errors import InputError
from tasks.handover.results import CalibratedCamera

# Intervals along each side that are tried, and the misfit that is small enough, metres.
_INTERVALS = (16, 32, 64, 128)
_ENOUGH = 0.05e-6
# Places in each interval where the misfit is taken, one of them its middle; and along a side.
_CHECKED, _LEAST_CHECKED = 5, 211
# What no digit shows is not a correction, metres.
_LEAST = 1e-9


def ideal_points(camera: CalibratedCamera, measured: Floats) -> Floats:
    """Ideal points (n, 2) of measured ones (n, 2), metres."""
    return np.asarray(camera.corrected(measured) + np.array(camera.frame.principal_point))


def measured_points(camera: CalibratedCamera, ideal: Floats) -> Floats:
    """Measured points (n, 2) of ideal ones (n, 2), metres; at a seam, a nearby one."""
    x0 = np.array(camera.frame.principal_point)
    found, _ = measured_from_ideal(
        camera.additional, camera.values, ideal - x0, lambda reduced: camera.mean_residuals(reduced + x0)
    )
    return np.asarray(found + x0)


@dataclass(frozen=True, eq=False)
class DistortionGrid:
    """Regular nodes over the format of a camera and their corrected positions; image system.

    Attributes
    ----------
    x, y : (k,), (l,) of the nodes, ascending, metres.
    moved : (l, k, 2) metres.
    misfit, rms : largest and root mean square difference to the rigorous correction, metres.
    """

    x: Floats
    y: Floats
    moved: Floats
    misfit: float = 0.0
    rms: float = 0.0

    @property
    def nodes(self) -> Floats:
        """(l, k, 2) the nodes themselves."""
        return np.stack(np.meshgrid(self.x, self.y), axis=-1)

    def at(self, xy: Floats) -> Floats:
        """Points (n, 2) moved, bilinearly between the nodes."""
        column, u = _interval(self.x, xy[:, 0])
        row, v = _interval(self.y, xy[:, 1])
        u, v = u[:, None], v[:, None]
        shift = self.moved - self.nodes
        lower = (1.0 - u) * shift[row, column] + u * shift[row, column + 1]
        upper = (1.0 - u) * shift[row + 1, column] + u * shift[row + 1, column + 1]
        return np.asarray(xy + (1.0 - v) * lower + v * upper)


@dataclass(frozen=True, eq=False)
class CameraGrids:
    """Both directions of one camera.

    Attributes
    ----------
    camera : its name.
    ideal_from_measured : nodes are measured, moved to where they would be without distortion.
    measured_from_ideal : the inverse.
    """

    camera: str
    ideal_from_measured: DistortionGrid
    measured_from_ideal: DistortionGrid

    @property
    def moves(self) -> bool:
        """Whether there is any correction as large as the last digit."""
        return self.largest > _LEAST

    @property
    def largest(self) -> float:
        """Largest shift of a node, metres; zero for a camera without corrections."""
        grid = self.ideal_from_measured
        return float(np.linalg.norm(grid.moved - grid.nodes, axis=-1).max())


def distortion_grids(camera: CalibratedCamera) -> CameraGrids:
    """Grids of additional parameters and mean residuals, as fine as their misfit needs.

    Raises
    ------
    InputError
        If a node has no measured point, as where a distortion folds back.
    """
    for least in _INTERVALS:
        columns, rows = _sides(camera, least)
        nodes = _spread(camera, np.linspace(-1.0, 1.0, columns), np.linspace(-1.0, 1.0, rows))
        measured = _spread(camera, _between(columns), _between(rows)).reshape(-1, 2)
        ideal = ideal_points(camera, measured)
        inside = (np.abs(ideal) <= camera.frame.half_format).all(axis=1)
        x, y, flat = nodes[0, :, 0], nodes[:, 0, 1], nodes.reshape(-1, 2)
        forth = DistortionGrid(x, y, ideal_points(camera, flat).reshape(nodes.shape))
        back = DistortionGrid(x, y, measured_points(camera, flat).reshape(nodes.shape))
        forth = _with_misfit(forth, measured, ideal)
        back = _with_misfit(back, ideal[inside], measured[inside])
        if not np.isfinite(back.moved).all():
            raise InputError(
                "Its distortion is so large that not every ideal point of its format has a measured one, so "
                "there is no distortion grid.",
                "Use corrected image points (--to corrected-csv) or aerocal undistort.",
                entity=f"camera {camera.frame.name}",
            )
        if max(forth.misfit, back.misfit) < _ENOUGH:
            break
    return CameraGrids(camera.frame.name, forth, back)


def _sides(camera: CalibratedCamera, least: int) -> tuple[int, int]:
    """Nodes along x and y, with this many intervals at least, and one at each middle of equal sub-areas."""
    steps = (1, 1) if camera.grid is None else (2 * camera.grid.cells.columns, 2 * camera.grid.cells.rows)
    return -(-least // steps[0]) * steps[0] + 1, -(-least // steps[1]) * steps[1] + 1


def _with_misfit(grid: DistortionGrid, xy: Floats, moved: Floats) -> DistortionGrid:
    """The grid with its differences from the exact corrected positions of points (n, 2)."""
    away = np.linalg.norm(grid.at(xy) - moved, axis=1)
    return replace(grid, misfit=float(away.max()), rms=float(np.sqrt(np.mean(away**2))))


def _between(nodes: int) -> Floats:
    """Places between nodes, alike in every interval; the outermost nodes are at -1 and 1."""
    number = max(_CHECKED, -(-_LEAST_CHECKED // (nodes - 1)) // 2 * 2 + 1)
    parts = (np.arange(number) + 0.5) / number
    return np.asarray(2.0 * (np.arange(nodes - 1)[:, None] + parts).ravel() / (nodes - 1) - 1.0)


def _spread(camera: CalibratedCamera, x: Floats, y: Floats) -> Floats:
    """(l, k, 2) points over the format at places (k,) along x and (l,) along y; the borders are -1 and 1."""
    half_x, half_y = camera.frame.half_format
    return np.stack(np.meshgrid(half_x * x, half_y * y), axis=-1)


def _interval(nodes: Floats, values: Floats) -> tuple[np.ndarray, Floats]:
    """Number (n,) of the interval of each value, and the part of it below; the outermost are continued."""
    index = np.clip(np.searchsorted(nodes, values, side="right") - 1, 0, len(nodes) - 2)
    return index, (values - nodes[index]) / (nodes[index + 1] - nodes[index])
