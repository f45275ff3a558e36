"""What the plots aggregate, against brute force on small examples."""

from __future__ import annotations

import math
import re

import numpy as np
import pandas as pd
import pytest

from adjust.camera.interior import FrameCamera
from tasks.report.block_map import overlap_classes
from tasks.report.footprints import footprints, overlap
from tasks.report.histogram import histogram
from tasks.report.map_plot import MapPlot
from tasks.report.point_precision import height_classes
from tasks.report.raster import Classes, Raster, cells
from tasks.report.residual_field import LEAST_IN_CELL, residual_field
from tasks.report.system_parameters import correlation_matrix

CAMERA = FrameCamera("C", 4000, 3000, 5e-6, 0.05, (1e-4, -2e-4), "corner", 0)


def _images(number: int) -> pd.DataFrame:
    random = np.random.default_rng(3)
    return pd.DataFrame(
        {
            "image": [f"i{k}" for k in range(number)],
            "camera": "C",
            "x_m": random.uniform(0, 500, number),
            "y_m": random.uniform(0, 400, number),
            "z_m": random.uniform(980, 1020, number),
            "omega_deg": random.normal(0, 2, number),
            "phi_deg": random.normal(0, 2, number),
            "kappa_deg": random.uniform(-180, 180, number),
            "ground_m": random.uniform(90, 110, number),
        }
    )


def test_corners_of_a_vertical_image_are_the_format_times_the_scale() -> None:
    images = _images(1).assign(
        x_m=10.0, y_m=20.0, z_m=1100.0, omega_deg=0.0, phi_deg=0.0, kappa_deg=0.0, ground_m=100.0
    )
    corners = footprints(images, {"C": CAMERA})[0]
    # Scale 1 : 20,000; the principal point (0.1, −0.2) mm lies over (10, 20).
    assert corners == pytest.approx(np.array([[-192, -126], [208, -126], [208, 174], [-192, 174]]) + 0.0)


def test_a_corner_maps_back_to_the_corner_of_the_image() -> None:
    images = _images(6)
    for row, corners in zip(images.to_dict("records"), footprints(images, {"C": CAMERA}), strict=True):
        so, sp, sk = (math.sin(math.radians(row[f"{n}_deg"])) for n in ("omega", "phi", "kappa"))
        co, cp, ck = (math.cos(math.radians(row[f"{n}_deg"])) for n in ("omega", "phi", "kappa"))
        about_x = np.array([[1, 0, 0], [0, co, -so], [0, so, co]])
        about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        about_z = np.array([[ck, -sk, 0], [sk, ck, 0], [0, 0, 1]])
        centre = np.array([row["x_m"], row["y_m"], row["z_m"]])
        seen = []
        for x, y in corners:
            u, v, w = (np.array([x, y, row["ground_m"]]) - centre) @ (about_x @ about_y @ about_z)
            seen.append((-50.0 * u / w + 0.1, -50.0 * v / w - 0.2))
        assert np.array(seen) == pytest.approx(np.array([(-10, -7.5), (10, -7.5), (10, 7.5), (-10, 7.5)]))


def test_a_corner_above_the_horizon_has_no_place() -> None:
    corners = footprints(_images(1).assign(omega_deg=85.0), {"C": CAMERA})
    assert np.isnan(corners).any()


def test_overlap_counts_the_formats_that_cover_the_middle_of_a_cell() -> None:
    corners = footprints(_images(9), {"C": CAMERA})
    raster = Raster.over(corners[:, :, 0].ravel(), corners[:, :, 1].ravel(), 25)
    count = overlap(corners, raster)
    x, y = raster.centres
    for row, column in np.ndindex(raster.rows, raster.columns):
        assert count[row, column] == sum(_inside(polygon, x[column], y[row]) for polygon in corners)
    assert count.max() > 2


def _inside(polygon: np.ndarray, x: float, y: float) -> bool:
    """Crossing-number test, independent of the sides' orientation."""
    inside = False
    for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
            inside = not inside
    return inside


def test_every_point_lies_in_one_cell_and_the_median_is_that_of_its_points() -> None:
    random = np.random.default_rng(8)
    x, y, values = random.uniform(-70, 30, 400), random.uniform(5, 45, 400), random.normal(size=400)
    raster = Raster.over(x, y, 7)
    median = raster.median(x, y, values)
    covered = 0
    for row, column in np.ndindex(raster.rows, raster.columns):
        west, south = raster.west + column * raster.size, raster.south + row * raster.size
        inside = (x >= west) & (x < west + raster.size) & (y >= south) & (y < south + raster.size)
        covered += int(inside.sum())
        if inside.any():
            assert median[row, column] == np.median(values[inside])
        else:
            assert np.isnan(median[row, column])
    assert covered == 400


def test_drawn_cells_cover_exactly_the_cells_of_their_class() -> None:
    classes = np.random.default_rng(2).integers(-1, 3, (6, 9))
    raster = Raster(0.0, 0.0, 10.0, 6, 9)
    plot = MapPlot.over(np.array([0.0, 90.0]), np.array([0.0, 60.0]))
    drawn = cells(raster, plot, classes, ("#a", "#b", "#c"), ("first", "second", "third"))
    for index, colour in enumerate(("#a", "#b", "#c")):
        data = re.search(rf'fill="{colour}" d="([^"]*)"', drawn)
        assert data is not None
        boxes = re.findall(r"M([\d.]+),([\d.]+)V([\d.]+)H([\d.]+)", data[1])
        area = sum((float(x2) - float(x1)) * (float(y1) - float(y2)) for x1, y1, y2, x2 in boxes)
        expected = (classes == index).sum() * (10.0 * plot.unit) ** 2
        assert area == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("most", [1, 2, 5, 8, 9, 14, 60])
def test_classes_of_overlap_hold_every_count(most: int) -> None:
    classes = overlap_classes(most)
    counts = np.arange(1, most + 1)
    found = classes.of(counts.astype(np.float64))
    assert len(classes.words) == len(classes.bounds) + 1
    for count, index in zip(counts, found, strict=True):
        first, _, last = classes.words[index].replace(" and more", "–999").partition("–")
        assert int(first) <= count <= int(last or first)
    assert found[0] == 0
    assert set(found) == set(range(len(classes.words)))


def test_classes_of_heights_are_round_and_open_at_both_ends() -> None:
    values = np.random.default_rng(1).uniform(0.11, 0.39, 500)
    classes = height_classes(values)
    assert classes.words[0] == f"< {classes.bounds[0]:.2f}"
    assert classes.words[-1] == f"≥ {classes.bounds[-1]:.2f}"
    assert 3 <= len(classes.words) <= 9
    assert set(classes.of(values)) == set(range(len(classes.words)))
    assert Classes((1.0,), ("a", "b")).of(np.array([0.5, 1.0, np.nan])).tolist() == [0, 1, -1]


def test_one_value_everywhere_still_has_classes() -> None:
    assert len(height_classes(np.full(10, 0.25)).words) >= 2


def _residuals(number: int) -> pd.DataFrame:
    random = np.random.default_rng(5)
    # Points on and beyond the border of the format, as lens distortion and rounding bring them.
    x, y = random.uniform(-10.01, 10.01, number), random.uniform(-7.51, 7.51, number)
    noise = random.normal(0, 1.0, (2, number))
    return pd.DataFrame({"x_mm": x, "y_mm": y, "vx_um": noise[0] + (x > 5), "vy_um": noise[1]})


@pytest.mark.parametrize("number", [1, 24, 130, 2000])
def test_means_in_sub_areas_are_those_of_their_points(number: int) -> None:
    table = _residuals(number)
    field = residual_field(CAMERA, table)
    side = len(field.x_mm)
    assert side == min(25, max(1, int(math.sqrt(number / 25))))
    assert field.count.sum() == number
    square = (table["vx_um"] ** 2).mean(), (table["vy_um"] ** 2).mean()
    assert field.rms_um == pytest.approx(tuple(math.sqrt(s) for s in square))
    inner_x, inner_y = np.linspace(-10, 10, side + 1)[1:-1], np.linspace(-7.5, 7.5, side + 1)[1:-1]
    column = [sum(x >= edge for edge in inner_x) for x in table["x_mm"]]
    row = [sum(y >= edge for edge in inner_y) for y in table["y_mm"]]
    for r, c in np.ndindex(side, side):
        own = table[(np.array(row) == r) & (np.array(column) == c)]
        assert field.count[r, c] == len(own)
        if len(own) < LEAST_IN_CELL:
            assert not field.drawn[r, c]
            continue
        means = own["vx_um"].mean(), own["vy_um"].mean()
        assert (field.vx_um[r, c], field.vy_um[r, c]) == pytest.approx(means)
        statistic = len(own) * (means[0] ** 2 / square[0] + means[1] ** 2 / square[1])
        assert field.significant[r, c] == (statistic > 5.991)


def test_noise_alone_is_called_significant_in_one_sub_area_of_twenty() -> None:
    random = np.random.default_rng(11)
    number = 60_000
    table = pd.DataFrame(
        {
            "x_mm": random.uniform(-10, 10, number),
            "y_mm": random.uniform(-7.5, 7.5, number),
            "vx_um": random.normal(0, 0.7, number),
            "vy_um": random.normal(0, 1.1, number),
        }
    )
    field = residual_field(CAMERA, table)
    # 625 sub-areas: a standard deviation of 0.9 % about 5 %.
    assert 0.02 < field.significant.mean() < 0.08


def test_a_histogram_loses_nothing() -> None:
    values = np.array([-7.0, -5.0, -0.01, 0.01, 0.19, 4.99, 5.0, 8.0])
    counts, beyond = histogram(values)
    assert counts.sum() == len(values)
    assert beyond == 2
    assert (counts[0], counts[24], counts[25], counts[-1]) == (2, 1, 2, 3)


def test_the_correlation_matrix_is_symmetric_with_ones_on_its_diagonal() -> None:
    pairs = pd.DataFrame(
        {
            "parameter_a": ["u", "u", "v"],
            "entity_a": ["C", "C", "C"],
            "parameter_b": ["v", "w_x", "w_x"],
            "entity_b": ["C", "1", "1"],
            "correlation": [0.5, -0.25, 0.125],
        }
    )
    matrix = correlation_matrix(pairs)
    assert list(matrix.index) == ["u of C", "v of C", "w x of 1"]
    assert matrix.to_numpy() == pytest.approx(np.array([[1, 0.5, -0.25], [0.5, 1, 0.125], [-0.25, 0.125, 1]]))
