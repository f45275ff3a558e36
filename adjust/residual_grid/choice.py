"""Number of sub-areas and amount of smoothing: every choice is judged by data not used in it.

Many cells follow the errors closely and their own noise as well; few or smoothed ones miss what changes
quickly, such as steps at seams. The residuals of the adjustment itself always prefer more cells. Two
judges do not: check points, and the images that were not used in their correction (cross-validation).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.block import Block
from adjust.observations.image_point import ImagePoints
from adjust.options import AdjustmentOptions
from adjust.parameters import State
from adjust.residual_grid.format_cells import FormatCells, Seams
from adjust.residual_grid.image_sets import GridRule
from adjust.residual_grid.iteration import iterate_grid
from adjust.residual_grid.smoothing import Smoothing
from adjust.result import AdjustmentResult


@dataclass(frozen=True, eq=False)
class CheckCoordinates:
    """Surveyed coordinates that are not used in the adjustment.

    Attributes
    ----------
    point : (k,) indices of object points.
    x_in_local : (k, 3) metres.
    """

    point: Ints
    x_in_local: Floats


@dataclass(frozen=True)
class GridCandidate:
    """`cells` × `cells` sub-areas with a smoothing."""

    cells: int
    smoothing: Smoothing = field(default_factory=Smoothing)


@dataclass(frozen=True)
class GridOutcome:
    """Result of a candidate.

    Attributes
    ----------
    candidate : None: without correction.
    steps : iterations the cross-validation allowed.
    sigma0 : of the adjustment with the corrections.
    gain : part of vᵀPv that it takes from images that were not used in it, see :class:`GridIteration`.
    check_rms : root mean square differences east, north, up at the check points, metres; None without any.
    """

    candidate: GridCandidate | None
    steps: int
    sigma0: float
    gain: float
    check_rms: tuple[float, float, float] | None


def cells_of_cameras(
    block: Block, rays: ImagePoints, cells: int, seams: Sequence[Seams] | None = None
) -> tuple[FormatCells | None, ...]:
    """`cells` × `cells` sub-areas for every camera; None for a camera without image points.

    Parameters
    ----------
    seams : of each camera; None: no camera has any.
    """
    used = np.bincount(block.camera_of_image[rays.image], minlength=len(block.cameras))
    of_camera = seams or (Seams(),) * len(block.cameras)
    return tuple(
        FormatCells.of(camera.half_format, cells, own) if count else None
        for camera, own, count in zip(block.cameras, of_camera, used, strict=True)
    )


def try_candidates(
    block: Block,
    result: AdjustmentResult,
    candidates: Sequence[GridCandidate],
    rule: GridRule | None = None,
    options: AdjustmentOptions | None = None,
    seams: Sequence[Seams] | None = None,
    check: CheckCoordinates | None = None,
) -> tuple[GridOutcome, ...]:
    """The outcome without correction, then that of every candidate.

    Parameters
    ----------
    result : of the block, without corrections.
    rule : how each is iterated; its smoothing is not used.
    seams : of each camera.
    """
    rule = rule or GridRule()
    rays = result.groups[0].group
    assert isinstance(rays, ImagePoints)  # the first group of every result
    outcomes = [GridOutcome(None, 0, result.test.sigma0, 0.0, _rms(block, result.state, check))]
    for candidate in candidates:
        cells = cells_of_cameras(block, rays, candidate.cells, seams)
        own = replace(rule, smoothing=candidate.smoothing, cross_validate=True)
        found = iterate_grid(block, result, cells, block.camera_of_image, own, options)
        outcomes.append(
            GridOutcome(
                candidate,
                found.taken,
                found.steps[-1].sigma0,
                found.gain,
                _rms(block, found.state, check),
            )
        )
    return tuple(outcomes)


def best_outcome(outcomes: Sequence[GridOutcome]) -> GridOutcome:
    """The outcome with the largest gain; on a tie, and where nothing gains, the one with fewer cells."""
    return max(
        outcomes,
        key=lambda item: (
            item.gain if np.isfinite(item.gain) else -np.inf,
            0 if item.candidate is None else -item.candidate.cells,
        ),
    )


def _rms(block: Block, state: State, check: CheckCoordinates | None) -> tuple[float, float, float] | None:
    if check is None or len(check.point) == 0:
        return None
    axes = np.asarray(block.frame.local_from_enu(check.x_in_local))
    difference = np.einsum("nji,nj->ni", axes, state.object_point[check.point] - check.x_in_local)
    east, north, up = np.sqrt(np.mean(difference**2, axis=0))
    return float(east), float(north), float(up)
