"""What the plots aggregate, against brute force on small examples."""

from __future__ import annotations

import math
import re

import numpy as np
import pandas as pd
import pytest

from adjust.camera.interior import FrameCamera
from tasks.document_kit.footprints import footprints, overlap
from tasks.document_kit.map_plot import MapPlot
from tasks.document_kit.raster import Classes, Raster, cells
from tasks.documents.report.block_map import overlap_classes
from tasks.documents.report.correlations import correlation_matrix
from tasks.documents.report.histogram import histogram
from tasks.documents.report.point_precision import height_classes
from tasks.documents.report.residual_field import field_plot, residual_field, with_residuals

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


def _grid(columns: int = 4, rows: int = 3, *, corrected: bool = False) -> pd.DataFrame:
    """Rows of residual_grid.parquet in the order of the file, with a seam before column 3."""
    random = np.random.default_rng(5)
    column, row = (part.ravel() for part in np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij"))
    number = columns * rows
    table = pd.DataFrame(
        {
            "camera": "C",
            "column": column,
            "row": row,
            "x_mm": (column + 0.5) * 20.0 / columns - 10.0,
            "y_mm": (row + 0.5) * 15.0 / rows - 7.5,
            "width_mm": 20.0 / columns,
            "height_mm": 15.0 / rows,
            "tile_x": (column >= 3).astype(int),
            "tile_y": 0,
            "count": random.integers(0, 90, number),
            "mean_vx_um": random.normal(0, 1, number),
            "mean_vy_um": random.normal(0, 1, number),
            "significant": random.uniform(size=number) < 0.5,
            "correction_x_um": random.normal(0, 1, number) if corrected else np.nan,
            "correction_y_um": random.normal(0, 1, number) if corrected else np.nan,
        }
    )
    return table.assign(mean_vx_um=table["mean_vx_um"].where(table["column"] != 1))


def test_the_field_of_a_camera_holds_the_rows_of_the_table_in_their_places() -> None:
    table = _grid()
    points = pd.DataFrame({"vx_um": [1.0, -2.0, 2.0], "vy_um": [0.0, 3.0, 4.0]})
    field = residual_field(CAMERA, table, points)
    assert field.mean.x_um.shape == (3, 4)
    for item in table.to_dict("records"):
        place = (item["row"], item["column"])
        assert field.x_mm[item["column"]] == item["x_mm"]
        assert field.y_mm[item["row"]] == item["y_mm"]
        assert field.mean.x_um[place] == pytest.approx(item["mean_vx_um"], nan_ok=True)
        assert field.mean.y_um[place] == item["mean_vy_um"]
        assert field.significant[place] == item["significant"]
    assert field.seams_x_mm.tolist() == [5.0]
    assert field.seams_y_mm.tolist() == []
    assert field.correction is None
    assert field.image_points == 3
    assert field.rms_um == pytest.approx((math.sqrt(3.0), math.sqrt(25.0 / 3.0)))
    lengths = np.hypot(table["mean_vx_um"].fillna(0.0), table["mean_vy_um"])
    assert field.mean.largest_um == pytest.approx(lengths.max())


def test_other_residuals_are_averaged_in_the_same_sub_areas() -> None:
    random = np.random.default_rng(9)
    table = _grid()
    points = pd.DataFrame(
        {
            "x_mm": random.uniform(-10, 10, 600),
            "y_mm": random.uniform(-7.5, 7.5, 600),
            "vx_um": random.normal(0.5, 1, 600),
            "vy_um": random.normal(0, 1, 600),
            "shows_x": random.uniform(size=600) < 0.8,
            "shows_y": True,
        }
    )
    field = with_residuals(residual_field(CAMERA, table, points), table, points, 0.95)
    for item in table.to_dict("records"):
        own = points[
            (points["x_mm"] - item["x_mm"]).abs().lt(0.5 * item["width_mm"])
            & (points["y_mm"] - item["y_mm"]).abs().lt(0.5 * item["height_mm"])
        ]
        place = (item["row"], item["column"])
        assert field.mean.x_um[place] == pytest.approx(own.loc[own["shows_x"], "vx_um"].mean())
        assert field.mean.y_um[place] == pytest.approx(own["vy_um"].mean())
    assert field.significant.mean() > 0.3
    assert field.rms_um[0] == pytest.approx(np.sqrt((points["vx_um"] ** 2).mean()))


def test_means_and_corrections_are_drawn_at_the_same_scale() -> None:
    field = residual_field(CAMERA, _grid(corrected=True), pd.DataFrame({"vx_um": [1.0], "vy_um": [1.0]}))
    assert field.correction is not None
    assert field.longest_um == max(field.mean.largest_um, field.correction.largest_um)
    scales = [
        re.search(r">([\d.]+) µm<", field_plot(field, vectors, "Vectors"))
        for vectors in (field.mean, field.correction)
    ]
    assert scales[0] is not None
    assert scales[1] is not None
    assert scales[0][1] == scales[1][1]


def test_every_vector_is_drawn_dark_or_weak_and_every_seam_as_a_line() -> None:
    field = residual_field(CAMERA, _grid(), pd.DataFrame({"vx_um": [1.0], "vy_um": [1.0]}))
    drawing = field_plot(field, field.mean, "Mean residuals")
    weak, dark = (re.search(rf'<path class="{css}" d="([^"]*)"', drawing) for css in ("mean weak", "mean"))
    assert weak is not None
    assert dark is not None
    # An arrow begins twice: its shaft, and its head.
    assert weak[1].count("M") == 2 * int((~field.significant).sum())
    assert dark[1].count("M") == 2 * int(field.significant.sum())
    seams = re.search(r'<g class="seams">(.*?)</g>', drawing)
    assert seams is not None
    assert seams[1].count("<line") == 1


def test_a_camera_whose_points_were_all_rejected_has_no_rms() -> None:
    field = residual_field(CAMERA, _grid(), pd.DataFrame({"vx_um": [], "vy_um": []}))
    assert np.isnan(field.rms_um).all()


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
    assert list(matrix.index) == [("u", "C"), ("v", "C"), ("w x", "1")]
    assert matrix.to_numpy() == pytest.approx(np.array([[1, 0.5, -0.25], [0.5, 1, 0.125], [-0.25, 0.125, 1]]))
