"""Mean residuals in sub-areas of the images, and correlated neighbours, in words."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import sqrt

import numpy as np
import pandas as pd

from tasks.quantities import entity_words
from tasks.results.figures import (
    CameraGridFigure,
    CorrectionErrorsFigure,
    GridIterationFigure,
    ResidualGridFigure,
    WithinCellsFigure,
)

# Chance makes the share of significant sub-areas scatter; beyond so many of its σ it is not chance.
_NOT_BY_CHANCE = 4.0
# Standard deviations of heights with what corrections leave, over those without: worth another method.
_MUCH = 1.5
# Correlations of neighbours up to this distance are what the model should have taken out.
_NEIGHBOURS_MM = 4.0
# Weaker ones are of no consequence.
_LEAST_CORRELATION = 0.05
# So many times as large, standard deviations deserve a word where nothing was corrected.
_LEAST_GROWTH = 1.05
_REASONS = {
    "nothing_to_model": "chance alone explains the mean residuals",
    "cross_validation": "another correction would have increased the mean residuals of the images left out",
    "settled": "another correction would have changed nothing",
    "limit": "the maximum number of corrections was reached",
}


def stopped_because(iteration: GridIterationFigure) -> str:
    """Why there was no further correction."""
    return _REASONS[iteration.reason]


def residual_grid_sentences(grid: ResidualGridFigure, autocorrelation: pd.DataFrame) -> Iterator[str]:
    """What was corrected, what is left, and correlated neighbours.

    Parameters
    ----------
    autocorrelation : residual_autocorrelation.parquet.
    """
    is_by_means = grid.iteration is not None and grid.iteration.method == "means"
    if grid.iteration is not None:
        yield _corrected(grid.iteration)
    if grid.remaining is not None:
        yield from _remaining(grid.remaining, grid.cameras, grid.iteration)
        if grid.remaining.heights > _MUCH and is_by_means:
            yield (
                "Corrections that are estimated through the normal equations usually leave much less: set "
                'adjustment.residual_grid.method = "collocation".'
            )
    elif grid.iteration is not None and grid.iteration.taken:
        yield (
            "The standard deviations take the corrections by mean residuals as exact: for so many sub-areas "
            "it is not computed what they leave of the image errors in the adjusted values."
        )
    of_camera = {figure.camera: figure for figure in grid.cameras}
    for figure in grid.cameras:
        if figure.within is not None and figure.within.significant:
            yield _too_coarse(figure, figure.within)
    for camera in dict.fromkeys((*of_camera, *autocorrelation["camera"])):
        if camera in of_camera:
            yield from _systematic(of_camera[camera])
        yield from _correlated(camera, autocorrelation[autocorrelation["camera"] == camera])


def _corrected(iteration: GridIterationFigure) -> str:
    reason = stopped_because(iteration)
    if iteration.taken == 0:
        return f"The image coordinates were not corrected by their mean residuals: {reason}."
    first, last = iteration.steps[0], iteration.steps[-1]
    times = "once" if iteration.taken == 1 else f"{iteration.taken} times"
    way = (
        "by their mean residuals" if iteration.method == "means" else "by collocation of their mean residuals"
    )
    return (
        f"The image coordinates were corrected {times} {way}, which changed σ0 from "
        f"{first.sigma0:.3f} to {last.sigma0:.3f}; {reason}."
    )


def _remaining(
    figure: CorrectionErrorsFigure, cameras: Iterable[CameraGridFigure], iteration: GridIterationFigure | None
) -> Iterator[str]:
    corrected = iteration is None or iteration.taken > 0
    if not corrected and max(figure.heights, figure.factor or 1.0) < _LEAST_GROWTH:
        return
    assumed = " and ".join(
        f"{camera.image_error_um:.1f} µm (camera {camera.camera})"
        for camera in cameras
        if camera.image_error_um is not None
    )
    parameter = ""
    if figure.factor is not None:
        named = entity_words(figure.parameter, figure.entity)
        parameter = f"; of the parameters that of {named} has grown most: {figure.factor:.1f} times"
    if corrected:
        included = (
            "The standard deviations include what the corrections by mean residuals leave in the adjusted "
            f"values of image errors of {assumed}, which the mean residuals indicate"
        )
    else:
        included = (
            f"All mean residuals together indicate image errors of {assumed}, and the standard deviations "
            "include what these do to the adjusted values"
        )
    yield (
        f"{included}: those of heights of object points are {figure.heights:.1f} times as large as "
        f"without{parameter}."
    )


def _too_coarse(grid: CameraGridFigure, within: WithinCellsFigure) -> str:
    if within.enough is None:
        remedy = (
            "More sub-areas would have too few image points or change nothing: enter the seams between CCD "
            "images (tiles of the camera), or estimate additional parameters."
        )
    else:
        remedy = (
            f"Within {within.enough} × {within.enough} sub-areas the residuals show no such errors: set "
            f"adjustment.residual_grid.cells to {within.enough} where the corrections are computed."
        )
    contained = "" if (grid.parts or 1) > 1 else "The standard deviations do not include them. "
    return (
        f"The {grid.columns} × {grid.rows} sub-areas are too coarse for the image errors of camera "
        f"{grid.camera}: within them the residuals show errors of {within.rms_um:.2f} µm (RMS), which no "
        f"corrections of these sub-areas take away. {contained}{remedy}"
    )


def _systematic(grid: CameraGridFigure) -> Iterator[str]:
    by_chance = grid.expected_by_chance + _NOT_BY_CHANCE * sqrt(grid.expected_by_chance * grid.confidence)
    if grid.significant > by_chance and grid.known > 0:
        share, expected = 100 * grid.significant / grid.known, 100 * (1 - grid.confidence)
        yield (
            f"Systematic image residuals of camera {grid.camera}: up to {grid.largest_um:.1f} µm in "
            f"sub-areas of the image, significant in {share:.0f} % of {grid.known} (by chance: "
            f"{expected:.0f} %)."
        )


def _correlated(camera: str, rows: pd.DataFrame) -> Iterator[str]:
    near = rows[rows["correlated"] & (rows["distance_to_mm"] <= _NEIGHBOURS_MM)]
    correlation = near["correlation"].to_numpy(np.float64)
    # The estimate from a few pairs may be more than one.
    strongest = min(float(correlation.max(initial=0.0)), 1.0)
    if strongest >= _LEAST_CORRELATION:
        reach = near["distance_to_mm"].to_numpy(np.float64)[np.argmax(correlation)]
        yield (
            f"Residuals of neighbouring image points of camera {camera} are correlated (up to "
            f"{strongest:.2f} below {reach:g} mm). Their common errors are not modelled, and the standard "
            "deviations are too small."
        )
