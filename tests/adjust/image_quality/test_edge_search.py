"""Edges found over a whole image: those that are there, none on texture."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.image_quality.edge_finder import candidates, line_at
from adjust.image_quality.edge_measurement import measured_edge
from adjust.image_quality.edge_model import resolution_factor
from adjust.image_quality.edge_search import EdgeSearch
from adjust.image_quality.edge_statistics import edge_statistics
from adjust.image_quality.noise import noise_of
from tests.adjust.image_quality.synthetic_edges import scene, texture


@pytest.mark.parametrize("noise", [1.0, pytest.param(3.0, marks=pytest.mark.slow), 5.0])
def test_edges_of_squares_are_found_over_the_whole_format(noise: float) -> None:
    image = scene(0.5, noise, np.random.default_rng(11))
    assert noise_of(image) == pytest.approx(noise, rel=0.03)
    search = EdgeSearch(*image.shape)
    search.search(image, noise_of(image))
    # Nine squares of four sides of 60 px.
    assert len(search.edges) > 25
    cells = {(int(one.line.row // 160), int(one.line.column // 160)) for one in search.edges}
    assert len(cells) == 9
    found = edge_statistics(search.edges)
    assert found.factor == pytest.approx(resolution_factor(np.array([0.5]))[0], abs=0.02)
    assert found.scatter == pytest.approx(found.stated, rel=0.35)
    assert found.method == "model"


def test_no_edge_is_found_on_texture() -> None:
    image = texture(np.random.default_rng(12))
    assert [
        one
        for one in candidates(image, noise_of(image))
        if not isinstance(measured_edge(image, line_at(image, one)), str)
    ] == []


def test_strips_of_an_image_give_the_edges_of_the_whole() -> None:
    image = scene(0.5, 2.0, np.random.default_rng(13), size=320)
    whole, strips = EdgeSearch(*image.shape), EdgeSearch(*image.shape)
    whole.search(image, 2.0)
    for first in range(0, 320, 160):
        strips.search(image[max(first - 32, 0) : first + 192], 2.0, max(first - 32, 0))
    together = edge_statistics(whole.edges), edge_statistics(strips.edges)
    assert together[0].factor == pytest.approx(together[1].factor, abs=0.02)
    places = np.array([[one.line.column, one.line.row] for one in strips.edges])
    apart = np.hypot(*(places[:, None] - places[None]).T) + 1e3 * np.eye(len(places))
    assert apart.min() > 25.0


def test_a_soft_edge_among_sharp_ones_is_left_out_of_the_mean() -> None:
    sharp, soft = EdgeSearch(480, 480), EdgeSearch(160, 160)
    sharp.search(scene(0.5, 1.0, np.random.default_rng(1)), 1.0)
    soft.search(scene(1.2, 1.0, np.random.default_rng(2), size=160), 1.0)
    assert len(soft.edges) >= 4
    found = edge_statistics([*sharp.edges[:24], *soft.edges[:4]])
    assert found.left_out == 4
    assert found.factor == pytest.approx(resolution_factor(np.array([0.5]))[0], abs=0.02)
