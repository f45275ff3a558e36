"""Lines of edges: their normals, and what they show."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.image_quality.edge_samples import EdgeLine


@pytest.mark.parametrize("ends", [(0.0, 0.0, 10.0, 2.0), (3.0, 8.0, 1.0, -20.0), (5.0, 1.0, -4.0, 7.0)])
def test_the_normal_between_two_ends_is_across_the_way_from_one_to_the_other(
    ends: tuple[float, float, float, float],
) -> None:
    line = EdgeLine.between(np.array(ends))
    way = np.array([ends[2] - ends[0], ends[3] - ends[1]])
    assert way @ [np.cos(line.angle), np.sin(line.angle)] == pytest.approx(0.0, abs=1e-12)
    assert line.length == pytest.approx(np.linalg.norm(way))
    assert (line.column, line.row) == (0.5 * (ends[0] + ends[2]), 0.5 * (ends[1] + ends[3]))


@pytest.mark.parametrize(
    ("angle_deg", "columns", "slant_deg"),
    [(5.0, True, 5.0), (-40.0, True, 40.0), (50.0, False, 40.0), (95.0, False, 5.0), (170.0, True, 10.0)],
)
def test_an_edge_shows_the_resolution_along_that_axis_which_its_normal_is_nearer_to(
    angle_deg: float, slant_deg: float, *, columns: bool
) -> None:
    line = EdgeLine(0.0, 0.0, float(np.deg2rad(angle_deg)), 20.0)
    assert line.crosses_columns is columns
    assert np.rad2deg(line.slant) == pytest.approx(slant_deg)
