"""``aerocal image-quality``: from image files to tables, page and summary."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from tasks.image_files.image_reader import raster_environment
from tasks.image_quality.scenes import examined_scene
from tasks.results.publish import OF_EVERY_EXAMINATION
from tests.adjust.image_quality.synthetic_edges import scene
from tests.command_line import aerocal
from tests.flows.refused_at_start import require_refused_at_start

BLURS = (0.4, 0.6)
FACTORS = (1.208, 1.583)


def write_image(path: Path, seed: int, size: int = 480) -> Path:
    """Two bands of different blur, noise of 3 grey values, a border without data at the left."""
    bands = [scene(blur, 3.0, np.random.default_rng([seed, k]), size) for k, blur in enumerate(BLURS)]
    pixels = np.clip(np.rint(bands), 1, 254).astype(np.uint8)
    pixels[:, :, :10] = 0
    with (
        raster_environment() as rasterio,
        rasterio.open(
            path, "w", driver="GTiff", width=size, height=size, count=len(BLURS), dtype="uint8"
        ) as file,
    ):
        file.write(pixels)
    return path


def changed_image(image: Path, path: Path, change: Callable[[NDArray[Any]], NDArray[Any]]) -> Path:
    """Another image with the pixels of this one, changed."""
    with raster_environment() as rasterio:
        with rasterio.open(image) as file:
            pixels = change(file.read())
        _, rows, columns = pixels.shape
        with rasterio.open(
            path, "w", driver="GTiff", width=columns, height=rows, count=len(pixels), dtype=pixels.dtype.name
        ) as file:
            file.write(pixels)
    return path


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("quality")
    images = [write_image(folder / f"{k}.tif", k).name for k in range(2)]
    project = folder / "quality.toml"
    listed = ", ".join(f'"{name}"' for name in images)
    project.write_text(f'version = 1\n[image_quality]\nname = "Two"\nimages = [{listed}]\ngsd_m = 0.1\n')
    assert aerocal("image-quality", project, "--out", folder / "out").returncode == 0
    return folder / "out"


@pytest.fixture(scope="module")
def small(results: Path) -> Path:
    """Four of the nine squares of the first image, where the number of edges is not the point."""
    return changed_image(results.parent / "0.tif", results.parent / "small.tif", lambda p: p[:, :320, :320])


def test_the_factors_of_the_bands_are_those_of_their_blur(results: Path) -> None:
    means = pd.read_parquet(results / "edge_means.parquet").set_index(["band", "direction", "zone"])
    for band, factor in enumerate(FACTORS, start=1):
        whole = means.loc[(band, "all", "all")]
        assert whole["edges"] >= 40
        assert whole["factor"] == pytest.approx(factor, abs=0.02)
        assert whole["effective_gsd_m"] == pytest.approx(0.1 * whole["factor"])
        assert not whole["sharpened"]
        for direction in ("columns", "rows"):
            assert means.loc[(band, direction, "all"), "factor"] == pytest.approx(factor, abs=0.03)


def test_no_edge_is_that_of_the_border_without_data(results: Path) -> None:
    edges = pd.read_parquet(results / "edges.parquet")
    assert edges["column_px"].min() > 20.0
    assert set(edges["image"]) == {"0.tif", "1.tif"}


def test_the_noise_is_that_of_the_images(results: Path) -> None:
    noise = pd.read_parquet(results / "noise_levels.parquet")
    # Rounding to whole grey values adds 1/12.
    np.testing.assert_allclose(noise["noise"], np.sqrt(9.0 + 1.0 / 12.0), rtol=0.05)
    np.testing.assert_allclose(noise["signal_to_noise"], noise["level"] / noise["noise"])


def test_page_summary_and_tables_say_the_same(results: Path) -> None:
    summary = json.loads((results / "summary.json").read_text())
    means = pd.read_parquet(results / "edge_means.parquet")
    whole = means[(means["direction"] == "all") & (means["zone"] == "all")]
    assert [band["factor"] for band in summary["image_quality"]["bands"]] == list(whole["factor"])
    page = (results / "image_quality.html").read_text()
    assert all(f'data-value="{factor!r}"' in page for factor in means["factor"].tolist())
    assert all(f": {one['factor']:.3f} ± {one['sigma_factor']:.3f}" in page for _, one in whole.iterrows())
    assert set(json.loads((results / "manifest.json").read_text())["artifacts"]) == {
        "edges", "edge_means", "edge_responses", "noise_levels", "smears", "image_quality",
    }  # fmt: skip


def test_an_edited_page_is_refused_before_anything_is_computed(results: Path, tmp_path: Path) -> None:
    out = shutil.copytree(results, tmp_path / "results")
    require_refused_at_start(
        out, "image_quality.html", OF_EVERY_EXAMINATION,
        lambda: aerocal("image-quality", results.parent / "quality.toml", "--out", out),
    )  # fmt: skip


def test_one_and_two_threads_find_the_same(small: Path) -> None:
    one, two = (examined_scene(small, threads=threads) for threads in (1, 2))
    for here, there in zip(one.bands, two.bands, strict=True):
        assert here.edges.edges
        assert [edge.line for edge in here.edges.edges] == [edge.line for edge in there.edges.edges]
        for a, b in zip(here.edges.edges, there.edges.edges, strict=True):
            assert a.fit.values.tobytes() == b.fit.values.tobytes()
        assert here.levels.noise.tobytes() == there.levels.noise.tobytes()
        assert here.edges.refused == there.edges.refused


def test_one_image_needs_no_project_file(tmp_path: Path) -> None:
    image = write_image(tmp_path / "one.tif", 5, size=160)
    outcome = aerocal("image-quality", image, "--json")
    assert outcome.returncode == 0
    assert json.loads(outcome.stdout)["image_quality"]["images"] == 1
    assert (tmp_path / "image-quality" / "image_quality.html").is_file()


def test_what_cannot_be_examined_is_refused_with_the_reason(tmp_path: Path) -> None:
    (tmp_path / "text.tif").write_text("no image")
    outcome = aerocal("image-quality", tmp_path / "text.tif")
    assert outcome.returncode == 2
    assert "This image cannot be read" in outcome.stderr
    write_image(tmp_path / "a.tif", 1, 320)
    write_image(tmp_path / "b.tif", 2, 480)
    project = tmp_path / "q.toml"
    project.write_text('version = 1\n[image_quality]\nimages = ["a.tif", "b.tif"]\n')
    outcome = aerocal("image-quality", project)
    assert outcome.returncode == 2
    assert "480 × 480 pixels" in outcome.stderr
    project.write_text("version = 1\n[image_quality]\nimages = []\n")
    assert "no image to examine" in aerocal("image-quality", project).stderr


def test_edges_are_measured_where_they_are_given_and_near_points(results: Path, tmp_path: Path) -> None:
    image = results.parent / "0.tif"
    found = pd.read_parquet(results / "edges.parquet").query("image == '0.tif' and band == 1").iloc[0]
    column, row, normal = found["column_px"], found["row_px"], np.deg2rad(found["normal_deg"])
    along = 14.0 * np.array([-np.sin(normal), np.cos(normal)])
    ends = [column - along[0], row - along[1], column + along[0], row + along[1]]
    places = {"points_px": [[column + 8.0, row - 8.0]], "edges_px": [ends]}
    for name, value in places.items():
        out = tmp_path / name
        given = f"image_quality.{name}={json.dumps(np.asarray(value).tolist())}"
        assert aerocal("image-quality", image, "--out", out, "--set", given).returncode == 0
        (edge,) = pd.read_parquet(out / "edges.parquet").query("band == 1").itertuples()
        assert np.hypot(edge.column_px - column, edge.row_px - row) < 40.0
        assert edge.factor == pytest.approx(FACTORS[0], abs=0.1)
    outcome = aerocal("image-quality", image, "--set", "image_quality.edges_px=[[1.0, 1.0, 5.0, 5.0]]")
    assert outcome.returncode == 2
    assert "at least 20 px" in outcome.stderr


def test_a_camera_that_has_become_softer_has_drifted_and_another_has_not(
    results: Path, tmp_path: Path
) -> None:
    same = write_image(tmp_path / "same.tif", 8, 320)
    # The softer band takes the place of the sharper one.
    softer = changed_image(same, tmp_path / "softer.tif", lambda bands: bands[[1, 1]])
    for image, drifted in ((same, [False, False]), (softer, [True, False])):
        out = tmp_path / image.stem
        given = f"image_quality.earlier={results}"
        assert aerocal("image-quality", image, "--out", out, "--set", given).returncode == 0
        drift = pd.read_parquet(out / "edge_drift.parquet")
        whole = drift[(drift["direction"] == "all") & (drift["zone"] == "all")]
        assert whole["drifted"].tolist() == drifted
        np.testing.assert_allclose(whole["change"], whole["factor"] - whole["earlier"])
        summary = json.loads((out / "summary.json").read_text())
        assert any("has changed by +0.3" in sentence for sentence in summary["problems"]) == any(drifted)
        assert "Change of the factors since the earlier date" in (out / "image_quality.html").read_text()
        noise = pd.read_parquet(out / "quality_drift.parquet").query("quantity == 'noise'")
        assert noise["band"].tolist() == [1, 2]
        assert not noise["drifted"].any()
    outcome = aerocal("image-quality", same, "--set", f"image_quality.earlier={tmp_path}")
    assert outcome.returncode == 2
    assert "manifest.json" in outcome.stderr


def test_images_of_which_nothing_can_be_examined_are_refused(small: Path, tmp_path: Path) -> None:
    for change, words in (
        (np.zeros_like, "are without data or 0"),
        (lambda pixels: np.full_like(pixels, 255), "have the largest value 255"),
        (lambda pixels: np.full(pixels.shape, np.nan, dtype=np.float32), "are without data or 0"),
    ):
        outcome = aerocal("image-quality", changed_image(small, tmp_path / "a.tif", change))
        assert outcome.returncode == 2
        assert words in outcome.stderr
    wrong = aerocal("image-quality", small, "--set", "image_quality.bands=[3]")
    assert wrong.returncode == 2
    assert "Band 3 cannot be examined: the image has 2 bands" in wrong.stderr


def of_twelve_bits(pixels: NDArray[Any]) -> NDArray[Any]:
    """Overexposed by half of the contrast, in a file that does not say how many of its 16 bits are used."""
    random = np.random.default_rng(3).normal(0.0, 10.0, pixels.shape)
    exposed = np.rint(30.0 * pixels.astype(np.float64) + random)
    return np.clip(exposed, 0, 4095).astype(np.uint16)


def test_edges_that_a_sensor_of_fewer_bits_has_clipped_are_not_used(results: Path, tmp_path: Path) -> None:
    """Clipped edges are narrower: of a blur of 0.4 px, 1.208 px wide, 1.02 to 1.10 px would be left."""
    image = changed_image(results.parent / "0.tif", tmp_path / "twelve.tif", of_twelve_bits)
    (band,) = examined_scene(image, chosen=(1,)).bands
    assert not band.edges.edges
    assert "of the pixels have the largest value 4095: it is overexposed" in " ".join(
        band.values.sentences(1)
    )
    sound = pd.read_parquet(results / "edges.parquet").query("image == '0.tif' and band == 1")
    assert len(sound) > 20


def test_overexposed_and_scaled_images_are_remarked_on(small: Path, tmp_path: Path) -> None:
    def overexposed(pixels: NDArray[Any]) -> NDArray[Any]:
        return np.where(np.arange(pixels.shape[2]) > 270, 255, pixels).astype(np.uint8)

    for change, words in (
        (overexposed, "of the pixels have the largest value 255: it is overexposed"),
        (lambda pixels: pixels.astype(np.uint16) * 257, "was scaled from 8 bits"),
    ):
        image = changed_image(small, tmp_path / "b.tif", change)
        outcome = aerocal("image-quality", image, "--json", "--set", "image_quality.bands=[2]")
        assert outcome.returncode == 0
        summary = json.loads(outcome.stdout)
        assert any(words in sentence for sentence in summary["problems"])
        assert [band["band"] for band in summary["image_quality"]["bands"]] == [2]


def test_an_image_without_edges_says_so(small: Path, tmp_path: Path) -> None:
    def noise(pixels: NDArray[Any]) -> NDArray[Any]:
        rng = np.random.default_rng(4)
        return np.rint(rng.normal(100.0, 3.0, pixels[:, :160, :160].shape)).astype(np.uint8)

    image = changed_image(small, tmp_path / "flat.tif", noise)
    outcome = aerocal("image-quality", image)
    assert outcome.returncode == 0
    assert "Band 1 has 0 edges that can be measured" in outcome.stdout
    assert "No edge could be measured." in (tmp_path / "image-quality" / "image_quality.html").read_text()
    limited = aerocal("image-quality", image, "--set", "image_quality.factor_max=1.3")
    assert limited.returncode == 4
    assert "Gate largest_factor: none" in limited.stdout


def test_an_image_without_noise_has_no_ratio_to_it(small: Path, tmp_path: Path) -> None:
    """A drawn image, or one filled with a colour: its noise is 0, and level / noise is no number."""
    image = changed_image(small, tmp_path / "drawn.tif", lambda pixels: np.full_like(pixels, 100))
    outcome = aerocal("image-quality", image)
    assert outcome.returncode == 0, outcome.stderr
    levels = pd.read_parquet(tmp_path / "image-quality" / "noise_levels.parquet")
    assert levels["noise"].tolist() == [0.0, 0.0]
    assert levels["signal_to_noise"].isna().all()


def test_a_float_image_with_holes_gives_the_same_factor(results: Path, tmp_path: Path) -> None:
    def with_holes(pixels: NDArray[Any]) -> NDArray[Any]:
        values = pixels.astype(np.float32)
        values[:, 200:204] = np.nan
        values[:, :, :10] = np.inf
        return values

    image = changed_image(results.parent / "0.tif", tmp_path / "float.tif", with_holes)
    assert aerocal("image-quality", image).returncode == 0
    edges = pd.read_parquet(tmp_path / "image-quality" / "edges.parquet")
    assert len(edges) > 30
    assert (edges["row_px"] - 202.0).abs().min() > 9.0
    for band, factor in enumerate(FACTORS, start=1):
        assert edges.loc[edges["band"] == band, "factor"].median() == pytest.approx(factor, abs=0.03)


def test_limits_of_the_settings_end_with_their_exit_code(results: Path, tmp_path: Path) -> None:
    project, out = results.parent / "quality.toml", shutil.copytree(results, tmp_path / "out")
    for limit, code in ((1.3, 4), (1.7, 0)):
        given = f"image_quality.factor_max={limit}"
        outcome = aerocal("image-quality", project, "--out", out, "--set", given)
        assert outcome.returncode == code
    drift = aerocal("image-quality", project, "--set", 'image_quality.fail_on=["drift"]')
    assert drift.returncode == 2
    assert "Give image_quality.earlier" in drift.stderr
