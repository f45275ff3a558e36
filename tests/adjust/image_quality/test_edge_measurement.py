"""Why an edge is not one to measure with."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.image_quality.edge_measurement import MeasuredEdge, measured_edge
from adjust.image_quality.edge_samples import EdgeLine
from tests.adjust.image_quality.synthetic_edges import Kind, blurred_step

SIZE, ANGLE = 72, float(np.deg2rad(6.0))
LINE = EdgeLine(35.5, 35.5, ANGLE, 32.0)


def distances(angle: float) -> tuple[Floats, Floats]:
    """Distances of all pixels from an edge through the middle, and their places along it."""
    row, column = np.mgrid[:SIZE, :SIZE] - 35.5
    return (
        column * np.cos(angle) + row * np.sin(angle),
        row * np.cos(angle) - column * np.sin(angle),
    )


def image(angle: float = ANGLE, blur: float = 0.6, bend: float = 0.0, textured: float = 0.0) -> Floats:
    """An edge of 120 grey values, bent in its middle, with texture on its bright side from 6.5 px on."""
    across, along = distances(angle)
    kind, random = Kind(blur, 6.0, 0.3), np.random.default_rng(4)
    grey = 80.0 + 120.0 * blurred_step(across - bend * (along / 16.0) ** 2, kind, angle)
    grey += random.normal(0.0, 0.3, grey.shape)
    return np.asarray(grey + np.where(across > 6.5, textured * random.normal(size=grey.shape), 0.0))


def test_a_straight_sharp_edge_is_taken() -> None:
    assert isinstance(measured_edge(image(), LINE), MeasuredEdge)


@pytest.mark.parametrize("slant_deg", [0.5, 44.0])
def test_one_along_the_pixels_or_their_diagonal_is_not(slant_deg: float) -> None:
    angle = float(np.deg2rad(slant_deg))
    assert measured_edge(image(angle), EdgeLine(35.5, 35.5, angle, 32.0)) == "slant"


def test_one_whose_level_has_a_pattern_on_one_side_is_not() -> None:
    assert measured_edge(image(textured=30.0), LINE) == "texture"


def test_one_that_is_bent_by_a_third_of_a_pixel_is_not() -> None:
    """Its root mean square is that of the straight ones."""
    assert measured_edge(image(bend=0.3), LINE) == "not straight"


def test_a_soft_one_is_not() -> None:
    assert measured_edge(image(blur=2.8), LINE) == "soft"
