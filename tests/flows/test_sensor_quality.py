"""``aerocal image-quality`` on images of a sensor: planted defects, simulated light, limits, page."""

from __future__ import annotations

import hashlib
import json
import re
import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adjust.arrays import Floats
from tasks.files.json_text import json_text
from tasks.image_files.image_reader import raster_environment
from tests.command_line import aerocal

ROWS, COLUMNS, BANDS = 400, 560, 2
GAIN, READ, DARK, FULL = 4.0, 20.0, 200.0, 16_000.0
PIXELS = ([(10, 10), (399, 559), (0, 300)], [(200, 100), (200, 101)])
EXPOSURES = (1.0, 5.0, 10.0, 20.0, 40.0, 60.0, 80.0)


@dataclass(frozen=True)
class Sensor:
    """A sensor as it was, or not: electrons for one then, read noise, further defects of band 1."""

    seed: int = 17
    sensitivity: float = 1.0
    read: float = READ
    more: tuple[tuple[int, int], ...] = ()


AS_BUILT = Sensor()


def light(exposure_ms: float, band: int, rng: np.random.Generator, sensor: Sensor) -> Floats:
    """Grey values (rows, columns): 1000 and 1500 electrons a millisecond in the middle, falling off."""
    row, column = np.mgrid[:ROWS, :COLUMNS]
    square = ((row - ROWS / 2) ** 2 + (column - COLUMNS / 2) ** 2) / ((ROWS / 2) ** 2 + (COLUMNS / 2) ** 2)
    electrons = rng.poisson(sensor.sensitivity * exposure_ms * (1000.0 + 500.0 * band) * (1.0 - 0.1 * square))
    return DARK + (electrons + rng.normal(0.0, sensor.read, electrons.shape)) / GAIN


def write(path: Path, bands: Floats) -> str:
    pixels = np.clip(np.rint(bands), 1, 65_535).astype(np.uint16)
    size = {"width": COLUMNS, "height": ROWS, "count": BANDS, "dtype": "uint16"}
    with raster_environment() as rasterio, rasterio.open(path, "w", driver="GTiff", **size) as file:
        file.write(pixels)
    return path.name


def write_sensor(folder: Path, sensor: Sensor = AS_BUILT) -> Path:
    """A project with bright, dark and pairs of images; defects are planted into bright and dark."""
    rng = np.random.default_rng(sensor.seed)
    planted = ((*PIXELS[0], *sensor.more), PIXELS[1])

    def image(name: str, exposure_ms: float, *, part: float = 1.0, added: float = 0.0) -> str:
        bands = np.stack([light(exposure_ms, band, rng, sensor) for band in range(BANDS)])
        for band, places in enumerate(planted):
            for place in places:
                bands[(band, *place)] = bands[(band, *place)] * part + added
        bands[0, 50:350, 222] *= part
        bands[1, 100:300, 0:2] *= part
        return write(folder / name, bands)

    bright, dark = image("bright.tif", 30.0, part=0.5), image("dark.tif", 0.0, added=900.0)
    series = []
    for exposure in EXPOSURES:
        first, second = (image(f"{exposure:g}_{side}.tif", exposure) for side in "ab")
        series.append("[[image_quality.sensor.series]]\n")
        series.append(f'exposure_ms = {exposure}\nimages = ["{first}", "{second}"]\n')
    project = folder / "sensor.toml"
    project.write_text(
        'version = 1\n[image_quality]\nname = "Sensor"\n[image_quality.sensor]\nkind = "multispectral"\n'
        f'bright = "{bright}"\ndark = "{dark}"\ndark_limit = 160.0\n' + "".join(series)
    )
    return project


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sensor")
    outcome = aerocal("image-quality", write_sensor(folder), "--out", folder / "out")
    # A double column is more than the protocol allows.
    assert outcome.returncode == 4, outcome.stderr
    assert "Gate missed_limits_of_sensor: 1" in outcome.stdout
    return folder / "out"


def test_all_planted_defects_are_listed_and_no_others(results: Path) -> None:
    pixels = pd.read_parquet(results / "defect_pixels.parquet")
    for band, places in enumerate(PIXELS, start=1):
        listed = pixels.loc[pixels["band"] == band, ["row", "column"]].to_numpy().tolist()
        assert sorted(map(tuple, listed)) == sorted(places)
    assert set(pixels["test"]) == {"both"}
    assert pixels.loc[pixels["band"] == 2, "cluster"].tolist() == [1, 1]
    columns = pd.read_parquet(results / "defect_columns.parquet").drop(columns="number")
    assert columns.to_numpy().tolist() == [[1, 50, 222, 349, 222], [2, 100, 0, 299, 1]]


def test_the_limits_of_the_protocol_are_applied(results: Path) -> None:
    sheets = pd.read_parquet(results / "sensor_sheets.parquet").set_index(["band", "sheet"])["passed"]
    # A multispectral sensor may have one single column, and no double one.
    assert sheets.loc[(1, "defect_columns_single")]
    assert sheets.loc[(1, "defect_columns_double")]
    assert not sheets.loc[(2, "defect_columns_double")]
    assert sheets.drop((2, "defect_columns_double")).all()
    summary = json.loads((results / "summary.json").read_text())
    assert summary["sensor"]["passed"] is False
    assert "defect columns double of band 2" in summary["problems"][0]


def test_gain_and_read_noise_are_those_of_the_sensor(results: Path) -> None:
    for found in json.loads((results / "summary.json").read_text())["sensor"]["photon_transfer"]:
        assert found["gain"] == pytest.approx(GAIN, rel=0.02)
        assert found["read_noise"] == pytest.approx(READ, rel=0.1)
        assert found["full_well"] is None


def test_sensitivity_linearity_and_aperture_are_those_of_the_light(results: Path) -> None:
    sheets = pd.read_parquet(results / "sensor_sheets.parquet").set_index(["band", "sheet"])
    for band, electrons in ((1, 1000.0), (2, 1500.0)):
        # The middle window takes in some of the fall-off: 3 % on average.
        assert sheets.loc[(band, "sensitivity"), "value"] == pytest.approx(electrons / GAIN, rel=0.05)
        assert sheets.loc[(band, "linearity"), "value"] == pytest.approx(DARK, abs=3.0)
        assert sheets.loc[(band, "linearity"), "largest_residual"] < 1e-3
        assert sheets.loc[(band, "aperture"), "value"] == pytest.approx(0.91, abs=0.02)
    aperture = pd.read_parquet(results / "aperture.parquet")
    assert len(aperture) == BANDS * 32 * 48


def test_the_page_lists_what_the_tables_do(results: Path) -> None:
    page = (results / "image_quality.html").read_text()
    assert "The sensor does not meet all thresholds." in page
    assert page.count('<tr data-key="2:defect_columns_double">') == 1
    assert "RowStart" in page


def test_a_series_without_dark_images_is_refused(results: Path, tmp_path: Path) -> None:
    images, project = results.parent, tmp_path / "sensor.toml"
    text = (images / "sensor.toml").read_text().replace('dark = "dark.tif"\n', "")
    project.write_text(re.sub(r'"(\w+\.tif)"', lambda name: f'"{images / name[1]}"', text))
    outcome = aerocal("image-quality", project)
    assert outcome.returncode == 2
    assert "Also name dark images" in outcome.stderr


def test_the_certificate_says_the_same_in_three_forms(results: Path) -> None:
    twin = json.loads((results / "radiometric_certificate.json").read_text())
    assert twin["title"] == "Radiometric limits not met"
    assert twin["verdict"] == "refused"
    digest = hashlib.sha256(json_text(twin["record"]).encode()).hexdigest()
    assert twin["code"] == digest
    page = (results / "radiometric_certificate.html").read_text()
    assert twin["short_code"] in page
    assert "defect columns double of band 2: 1, threshold 0" in page
    assert (results / "radiometric_certificate.pdf").read_bytes().startswith(b"%PDF")
    sheets = pd.read_parquet(results / "sensor_sheets.parquet")
    (section,) = (one for one in twin["sections"] if one["name"] == "sheets")
    rows = section["blocks"][0]["rows"]
    assert [row["cells"][2]["value"] for row in rows] == pytest.approx(sheets["value"].tolist())


def drift_of(sensor: Sensor, earlier: Path, folder: Path) -> pd.DataFrame:
    """Examine a sensor and compare it with the earlier results."""
    project = write_sensor(folder, sensor)
    given = f"image_quality.earlier={earlier}"
    outcome = aerocal("image-quality", project, "--out", folder / "out", "--set", given)
    assert outcome.returncode == 4, outcome.stderr
    return pd.read_parquet(folder / "out" / "quality_drift.parquet").set_index(["band", "quantity"])


@pytest.fixture(scope="module")
def aged(results: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of the sensor with less sensitivity, more noise and more defects, against those before."""
    # At most 12 in a column, or it would be a defect column.
    spots = tuple((30 + 20 * k, 400 + 10 * (k % 2)) for k in range(15))
    folder = tmp_path_factory.mktemp("aged")
    drift_of(Sensor(18, 0.97, 26.0, spots), results, folder)
    return folder / "out"


def test_a_sensor_that_has_aged_has_drifted(aged: Path) -> None:
    drift = pd.read_parquet(aged / "quality_drift.parquet").set_index(["band", "quantity"])
    for band in (1, 2):
        sensitivity, read = drift.loc[(band, "sensitivity")], drift.loc[(band, "read_noise")]
        assert sensitivity["drifted"]
        assert sensitivity["value"] / sensitivity["earlier"] == pytest.approx(0.97, abs=0.003)
        assert read["drifted"]
        assert read["change"] == pytest.approx(6.0, abs=3.3 * read["sigma_change"])
    pixels = drift.loc[(1, "defect_pixels")]
    assert (pixels["earlier"], pixels["value"], pixels["drifted"]) == (3, 18, True)
    assert pixels["t"] == pytest.approx(np.sqrt(15.0))
    assert not drift.loc[(2, "defect_pixels"), "drifted"]
    summary = json.loads((aged / "summary.json").read_text())
    assert summary["drift"]["drifted_quantities"] == 5
    assert any("defect pixels of band 1 has changed by +15" in sentence for sentence in summary["problems"])
    assert "Change of noise, sensitivity and defects" in (aged / "image_quality.html").read_text()


def test_a_sensor_as_it_was_has_not_drifted(results: Path, tmp_path: Path) -> None:
    drift = drift_of(Sensor(19), results, tmp_path)
    assert len(drift) == 8
    assert not drift["drifted"].any()


def test_the_registry_keeps_results_and_says_what_has_changed(
    results: Path, aged: Path, tmp_path: Path
) -> None:
    registry = str(tmp_path / "registry.sqlite")

    def call(*words: str | Path, code: int = 0) -> str:
        outcome = aerocal("registry", *words, "--registry", registry)
        assert outcome.returncode == code, outcome.stdout + outcome.stderr
        return outcome.stdout + outcome.stderr

    assert "the first of its camera" in call("add", results, "--by", "ann")
    assert "in the registry already" in call("add", results, "--by", "ann", code=2)
    added = call("add", aged, "--by", "ann")
    assert "4 of 10 quantities have changed" in added
    assert "sensitivity of band 1" in added
    assert "read noise of band 2" in added
    shown = call("show", "Sensor")
    assert "From result 1 to result 2" in shown
    assert "Radiometric results of Sensor" in call("list")
    assert "radiometric results: 2" in call("verify")
    # What somebody edits behind its back shows.
    with closing(sqlite3.connect(registry)) as connection, connection:
        connection.execute("UPDATE radiometric_results SET content = replace(content, 'Sensor', 'Other')")
    assert "its values do not match its seal" in call("verify", code=2)


def test_a_certificate_that_was_edited_is_not_registered(results: Path, tmp_path: Path) -> None:
    for name in ("radiometric_certificate.json", "manifest.json"):
        (tmp_path / name).write_text((results / name).read_text())
    certificate = tmp_path / "radiometric_certificate.json"
    certificate.write_text(certificate.read_text().replace("refused", "accepted"))
    outcome = aerocal("registry", "add", tmp_path, "--registry", str(tmp_path / "r.sqlite"), "--by", "ann")
    assert outcome.returncode == 2
    assert "not the file that was published" in outcome.stderr


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda pixels: np.where(pixels > 7000, 65_535, pixels), "is overexposed"),
        (lambda pixels: np.minimum(pixels // 256, 255) * 257, "was scaled from 8 bits"),
    ],
)
def test_flat_images_that_are_not_raw_are_refused(
    results: Path, tmp_path: Path, change: Callable[[Floats], Floats], words: str
) -> None:
    with raster_environment() as rasterio, rasterio.open(results.parent / "bright.tif") as file:
        pixels = file.read()
    # Over the whole range, for there are 8 bits of it.
    stretched = np.linspace(1000.0, 60_000.0, pixels.shape[2])[None, None] * np.ones(pixels.shape)
    write(tmp_path / "bright.tif", change(pixels if "over" in words else stretched.astype(np.uint16)))
    project = tmp_path / "sensor.toml"
    project.write_text(
        'version = 1\n[image_quality.sensor]\nkind = "pan"\nbright = "bright.tif"\n[image_quality]\n'
    )
    outcome = aerocal("image-quality", project)
    assert outcome.returncode == 2
    assert words in outcome.stderr
