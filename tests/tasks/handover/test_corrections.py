"""Corrected image points and distortion grids, read from what is written: the rigorous correction, to the stated misfit."""  # noqa: E501

from __future__ import annotations

import csv
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from adjust.geometry.rotation import from_omega_phi_kappa
from adjust.handover.cartesian_map import EARTH_RADIUS_M, CartesianMap, Pose, projected
from adjust.handover.refit import Freed
from adjust.residual_grid.format_cells import FormatCells, Seams
from adjust.residual_grid.image_correction import CorrectionField
from tasks.coordinates.local_frame import local_from_grid, local_from_map
from tasks.errors import InputError
from tasks.formats.native_csv import read_csv_control
from tasks.handover.block_points import no_points
from tasks.handover.delivery import Delivery
from tasks.handover.distortion_grid import distortion_grids, ideal_points
from tasks.handover.formats.exchange import EXCHANGE, LENS
from tasks.handover.formats.register import REGISTER
from tasks.handover.lens import lens_models
from tasks.handover.receiver import hand_over
from tasks.handover.statement import statement
from tests.tasks.handover.flown_block import Flight, delivered, flown, points_of
from tests.tasks.handover.undistorted.crosses import distorting_camera

DIRECTIONS = ("ideal_from_measured", "measured_from_ideal")


@cache
def with_mean_residuals(case, *, seams=False, unknown=0):
    """The block with mean residuals of some µm in 12 × 12 sub-areas, some of them unknown."""
    results, _ = flown(case)
    rng, cameras = np.random.default_rng(5), []
    for one in results.cameras:
        borders = Seams((-0.01, 0.012), (0.004,)) if seams else Seams()
        cells = FormatCells.of(one.frame.half_format, 12, borders)
        value = rng.normal(0.0, 1.5e-6, (cells.count, 2))
        value[rng.integers(cells.count, size=unknown)] = np.nan
        cameras.append(replace(one, grid=CorrectionField(cells, value)))
    results = replace(results, cameras=tuple(cameras))
    return results, points_of(results)


def of_one_camera(results):
    """The same images, all by the first camera."""
    images = results.images
    first = {name: getattr(images, name)[:1] for name in ("focal_length", "half_format", "pixel_size")}
    return replace(
        results, images=replace(images, camera=0 * images.camera, **first), cameras=results.cameras[:1]
    )


def rows(text):
    return list(csv.DictReader(text.splitlines()))


def numbers(table, *names):
    return np.array([[float(row[name]) for name in names] for row in table])


@pytest.mark.parametrize("corrections", [False, True])
@pytest.mark.parametrize("tilt", [0.0, 45.0])
@pytest.mark.parametrize("world", REGISTER["corrected-csv"].worlds)
def test_a_pinhole_sees_the_points_where_they_are_written(world, tilt, corrections):
    results, points = with_mean_residuals(Flight(1000.0, tilt, refracted=True, corrections=corrections))
    form = REGISTER["corrected-csv"]
    handed = hand_over(results, world, form.freed)
    files = form.write(Delivery(results, handed, points=points))
    orientations, ground = rows(files["exterior_orientations.csv"]), rows(files["object_points.csv"])
    cameras = {row["camera"]: row for row in rows(files["cameras.csv"])}
    seen = rows(files["image_points.csv"])
    xyz = dict(zip((row["point"] for row in ground), numbers(ground, "x", "y", "z"), strict=True))
    away = []
    for row in orientations:
        own = [one for one in seen if one["image"] == row["image"]]
        centre, angles = (numbers([row], *names)[0] for names in (("x", "y", "z"), ("omega", "phi", "kappa")))
        place, turn = np.array([xyz[one["point"]] for one in own]), from_omega_phi_kappa(np.radians(angles))
        if world == "map":
            # Such a program knows the projection and computes with the curved earth.
            images = results.images
            turn = local_from_grid(images.map_frame, images.frame, centre[None])[0] @ turn
            place, centre = (
                local_from_map(images.map_frame, images.frame, one) for one in (place, centre[None])
            )
        c, x0, y0 = 1e-3 * numbers([cameras[row["camera"]]], "focal_length_mm", "x0_mm", "y0_mm")[0]
        model = CartesianMap(EARTH_RADIUS_M if world == "map-cartesian-curved" else None)
        pose = Pose(centre.reshape(1, 3), turn[None], np.array([c]), np.zeros(1))
        expected = 1e3 * (projected(model, pose, place[None])[0] + [x0, y0])
        away.append(np.linalg.norm(numbers(own, "x", "y") - expected, axis=1).max())
    pixel_mm = 1e3 * results.images.pixel_size[0]
    # Coordinates of 0.1 mm are 0.01 µm; refraction is taken before the distortion here and after it there.
    assert max(away) / pixel_mm < 1.05 * handed.misfit_px.max() + 0.02


def gridgroups(text):
    """Camera → columns, rows and (n, 4) of a gridgroup file, by its keywords alone."""
    found = {}
    for group in re.findall(r"begin gridgroup.*?end gridgroup", text, flags=re.DOTALL):
        name = re.search(r'camera_name: "(.*?)"', group)[1]
        columns, count = (int(re.search(rf"{key}: (\d+)", group)[1]) for key in ("columns", "rows"))
        body = group.split("begin gridpoints")[1].split("end gridpoints")[0]
        cells = np.array([[float(cell) for cell in line.split()] for line in body.strip().splitlines()])
        found[name] = (columns, count, cells)
    return found


def interpolated(node, moved, columns, count, at):
    x, y = node[:columns, 0], node[::columns, 1]
    shift = (moved - node).reshape(count, columns, 2)
    return at + RegularGridInterpolator((y, x), shift)(at[:, ::-1])


def tables(files):
    """The same of the plain tables."""
    found = {}
    for direction in DIRECTIONS:
        table = rows(files[f"{direction}.csv"])
        for name in dict.fromkeys(row["camera"] for row in table):
            own = [row for row in table if row["camera"] == name]
            node = numbers(own, "x_mm", "y_mm")
            moved = node + 1e-3 * numbers(own, "dx_um", "dy_um")
            size = (int(own[-1]["column"]) + 1, int(own[-1]["row"]) + 1)
            found[direction, name.replace(" ", "_")] = (*size, np.column_stack([moved, node]))
    return found


@pytest.mark.parametrize(
    ("name", "corrections"),
    [("isat", True), ("catalyst", True), ("distortion-grid", True), ("distortion-grid", False)],
)
def test_a_written_grid_reproduces_the_correction_to_the_stated_misfit(name, corrections):
    results, _ = with_mean_residuals(Flight(corrections=corrections))
    if not corrections:
        # The grid of a strong distortion takes seconds.
        results = of_one_camera(results)
    delivery = delivered(results, no_points(), name)
    files = REGISTER[name].write(delivery)
    if name == "distortion-grid":
        grids = tables(files)
    else:
        grids = {
            (direction, camera): grid
            for direction in DIRECTIONS
            for camera, grid in gridgroups(files[f"{direction}.dat"]).items()
        }
    assert len(grids) == 2 * len(results.cameras)
    rng = np.random.default_rng(3)
    for one, stated in zip(results.cameras, delivery.grids, strict=True):
        measured = rng.uniform(-1.0, 1.0, (4000, 2)) * one.frame.half_format
        ideal = one.corrected(measured) + one.frame.principal_point
        inside = (np.abs(ideal) < one.frame.half_format).all(axis=1)
        moved_um = 1e6 * np.linalg.norm(ideal - measured, axis=1).max()
        for direction, at, expected in (
            ("ideal_from_measured", measured, ideal), ("measured_from_ideal", ideal[inside], measured[inside])
        ):  # fmt: skip
            columns, count, cells = grids[direction, one.frame.name.replace(" ", "_")]
            found = interpolated(cells[:, 2:], cells[:, :2], columns, count, 1e3 * at)
            away_um = 1e3 * np.linalg.norm(found - 1e3 * expected, axis=1).max()
            misfit_um = 1e6 * getattr(stated, direction).misfit
            assert away_um < 1.2 * misfit_um + 2e-3
            # A distortion of 0.5 mm moves the bends of the mean residuals away from the nodes of the inverse.
            assert misfit_um < (0.1 if corrections else 0.25)
            assert moved_um > 40.0


def test_a_grid_states_what_unknown_sub_areas_leave():
    results, _ = with_mean_residuals(Flight(corrections=True), unknown=5)
    grid = distortion_grids(results.cameras[0]).ideal_from_measured
    assert 0.1e-6 < grid.misfit < 5e-6
    assert grid.rms < 0.1 * grid.misfit


def test_a_grid_states_the_jumps_at_seams():
    results, _ = with_mean_residuals(Flight(corrections=True), seams=True)
    delivery = delivered(results, no_points(), "distortion-grid")
    grid = delivery.grids[0].ideal_from_measured
    one = results.cameras[0]
    near = np.column_stack([np.full(2001, 0.012), np.linspace(-0.05, 0.05, 2001)])
    step = np.array([1e-9, 0.0])
    jump = one.mean_residuals(near + step) - one.mean_residuals(near - step)
    assert 0.3e-6 < grid.misfit < 1.2 * np.linalg.norm(jump, axis=1).max() + 2e-6
    assert grid.rms < 0.2 * grid.misfit
    text = " ".join(statement(delivery, REGISTER["distortion-grid"]).split())
    misfit = max(grid.misfit, delivery.grids[0].measured_from_ideal.misfit)
    assert f"reproduces the correction to {1e6 * misfit:.3f}" in text
    assert "a step, a bend, or too strong a curvature" in text
    assert "Cartesian" not in text


def test_the_stated_misfit_is_that_of_any_point():
    """141 nodes, each third of 211 places along a side on one of them."""
    one, rng = flown(Flight(1000.0, 45.0, corrections=True))[0].cameras[0], np.random.default_rng(7)
    cells = FormatCells.of(one.frame.half_format, 70, Seams())
    one = replace(one, grid=CorrectionField(cells, rng.normal(0.0, 1.5e-6, (cells.count, 2))))
    grids = distortion_grids(one)
    measured = rng.uniform(-1.0, 1.0, (100_000, 2)) * one.frame.half_format
    ideal = ideal_points(one, measured)
    inside = (np.abs(ideal) < one.frame.half_format).all(axis=1)
    forth = np.linalg.norm(grids.ideal_from_measured.at(measured) - ideal, axis=1)
    back = np.linalg.norm(grids.measured_from_ideal.at(ideal) - measured, axis=1)[inside]
    for grid, away in ((grids.ideal_from_measured, forth), (grids.measured_from_ideal, back)):
        assert grid.misfit == pytest.approx(away.max(), rel=0.15)
        assert grid.rms == pytest.approx(np.sqrt(np.mean(away**2)), rel=0.05)


@pytest.mark.filterwarnings("ignore:overflow|invalid value:RuntimeWarning")
def test_a_distortion_that_folds_back_has_no_grid():
    camera = distorting_camera()
    folding = np.where([name == "brown:K1" for name in camera.additional.names], -4.5e4, 0.0)
    with pytest.raises(InputError, match="not every ideal point of its format has a measured one"):
        distortion_grids(replace(camera, values=folding, grid=None))


def test_a_camera_without_corrections_has_a_grid_of_zeros_and_no_gridgroup():
    results, _ = flown(Flight())
    plain = replace(
        results,
        cameras=tuple(replace(one, values=np.zeros_like(one.values)) for one in results.cameras),
    )
    assert distortion_grids(plain.cameras[0]).largest < 1e-15
    files = REGISTER["distortion-grid"].write(delivered(plain, no_points(), "distortion-grid"))
    assert {row["dx_um"] for row in rows(files["ideal_from_measured.csv"])} == {"0.0000"}
    names = {"isat_images.csv", "isat_strips.csv"}
    assert set(REGISTER["isat"].write(delivered(plain, no_points(), "isat"))) == {"photo", "camera"} | names


@pytest.mark.parametrize("refracted", [False, True])
def test_mean_residuals_of_the_shape_of_a_lens_are_in_its_coefficients(refracted):
    results, _ = flown(Flight(1000.0, refracted=refracted))
    cameras = []
    for one in results.cameras:
        cells = FormatCells.of(one.frame.half_format, 25, Seams())
        reduced = (cells.middles - np.array(one.frame.principal_point)) / np.hypot(*one.frame.half_format)
        value = 5e-6 * reduced * (reduced**2).sum(axis=1, keepdims=True)
        cameras.append(replace(one, grid=CorrectionField(cells, value)))
    plain, moved = lens_models(results, LENS), lens_models(replace(results, cameras=tuple(cameras)), LENS)
    for k, one in enumerate(cameras):
        assert one.largest_mean_residual > 3e-6
        # Between sub-areas the grid is bilinear, at the borders it is constant.
        assert moved.models[k].misfit_um < plain.models[k].misfit_um + 0.5
        assert abs(moved.models[k].distortion["k1"] - plain.models[k].distortion["k1"]) > 1e-5


def test_the_statement_says_how_many_surveyed_points_the_format_cannot_have():
    """One of three lacks its height; in a local frame it has no place at all."""
    results, points = flown(Flight())
    said = "1 of 3 surveyed points lack a coordinate"
    lack = set()
    for name, form in EXCHANGE.items():
        delivery = delivered(results, points, name)
        if said in " ".join(statement(delivery, form).split()):
            lack.add(name)
    assert lack == {"blocks-exchange", "opensfm", "opf", "openmvg", "bingo"}
    local = replace(delivered(results, points, "corrected-csv"), handed=hand_over(results, "local", Freed()))
    assert said in " ".join(statement(local, EXCHANGE["corrected-csv"]).split())


def test_the_control_points_of_a_local_frame_can_be_read_again(tmp_path):
    results, points = flown(Flight())
    local = replace(delivered(results, points, "corrected-csv"), handed=hand_over(results, "local", Freed()))
    file = tmp_path / "control_points.csv"
    file.write_text(EXCHANGE["corrected-csv"].write(local)["control_points.csv"])
    records = read_csv_control(file)
    assert records.point.to_pylist() == list(points.surveyed.names[:2])
    np.testing.assert_allclose(records.position, points.surveyed.local[:2], rtol=0, atol=1e-4)


def test_the_statement_says_which_lists_of_opendronemap_lack_names_with_blanks():
    results, points = flown(Flight())
    text = " ".join(statement(delivered(results, points, "opensfm"), REGISTER["opensfm"]).split())
    assert "ends the names of images at a blank (1 a.tif): geo.txt is not written" in text
    named = replace(results, images=replace(results.images, names=("1", "2", "3", "4")))
    assert "blank" not in statement(delivered(named, points, "opensfm"), REGISTER["opensfm"])


def test_the_statement_says_where_mean_residuals_and_refraction_are():
    results, points = with_mean_residuals(Flight(refracted=True, corrections=True))
    texts = {
        name: " ".join(statement(delivered(results, points, name), REGISTER[name]).split())
        for name in ("corrected-csv", "patb", "isat", "eo-csv", "rpc", "colmap")
    }
    for name, words in {
        "corrected-csv": "removed from the image points: switch such a correction OFF",
        "patb": "are contained in the image points",
        "isat": "are contained in the distortion grids",
        "eo-csv": "are NOT contained",
        "rpc": "are NOT contained",
        "colmap": "are fitted into the coefficients of the lens; what these cannot take is in its misfit",
    }.items():
        assert words in texts[name], name
    assert "mean residuals" in texts["corrected-csv"]
