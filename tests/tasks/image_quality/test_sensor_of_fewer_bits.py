"""Sensors of fewer bits than their files have room for, and images that hold floating point."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tasks.errors import InputError
from tasks.image_quality.scenes import examined_scene
from tasks.image_quality.sensor import examine_sensor
from tasks.settings.image_quality import SensorSettings
from tests.adjust.image_quality.synthetic_edges import scene
from tests.tasks.image_files.images import written

pytestmark = pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
SIZE = (1, 256, 256)
GAIN, READ = 2.0, 2.0


def flat(folder: Path, name: str, level: float, dtype: str, hot: int = 0) -> Path:
    """An image of about `level` with a pixel that is higher by `hot`."""
    pixels = np.random.default_rng(4).normal(level, 3.0, SIZE)
    pixels[0, 100, 100] += hot
    return written(folder / name, np.rint(pixels).astype(dtype))


@pytest.mark.parametrize(("level", "dtype"), [(2000.0, "uint16"), (2000.0, "float32"), (30_000.0, "float32")])
def test_the_limit_of_dark_images_is_not_that_of_the_room_in_the_file(
    tmp_path: Path, level: float, dtype: str
) -> None:
    """A hot pixel of 15 % of 12 bits would be below 1 % of 16 bits."""
    bright, dark = flat(tmp_path, "b.tif", level, dtype), flat(tmp_path, "d.tif", 100.0, dtype, hot=600)
    settings = SensorSettings(kind="pan", bright=(bright,), dark=(dark,))
    with pytest.raises(InputError, match="not that of its files") as raised:
        examine_sensor(tmp_path, settings)
    assert "dark_limit" in raised.value.remedy
    examine_sensor(tmp_path, settings.model_copy(update={"dark_limit": 41.0}))
    assert len(pd.read_parquet(tmp_path / "defect_pixels.parquet")) == 1


@pytest.mark.parametrize("whole", [True, False])
def test_rounding_is_subtracted_from_whole_grey_values_only(tmp_path: Path, whole: bool) -> None:
    random, side = np.random.default_rng(8), (1, 300, 300)

    def image(name: str, electrons: float) -> Path:
        values = 100.0 + (random.poisson(electrons, side) + random.normal(0.0, READ, side)) / GAIN
        return written(tmp_path / name, (np.rint(values) if whole else values).astype(np.float32))

    series = [
        {"exposure_ms": k, "images": tuple(image(f"{k}{side}.tif", 20.0 * k) for side in "ab")}
        for k in (0, 1, 10, 100)
    ]
    dark = (image("d.tif", 0.0),)
    settings = SensorSettings.model_validate(
        {"kind": "pan", "dark": dark, "dark_limit": 9.0, "series": series}
    )
    examine_sensor(tmp_path, settings)
    sheets = pd.read_parquet(tmp_path / "sensor_sheets.parquet").set_index("sheet")
    # Subtracted from what was not rounded: 1.91.
    assert sheets.loc["noise", "value"] == pytest.approx(READ, abs=4.0 * sheets.loc["noise", "sigma"])
    assert sheets.loc["noise", "sigma"] < 0.02


def test_a_value_without_data_is_not_the_largest_of_a_sensor(tmp_path: Path) -> None:
    """Clipped pixels of 12 bits take no part, with a border of 65535 that means no data as with one of 0."""
    pixels = 16.0 * scene(0.5, 3.0, np.random.default_rng(1), 320)
    grey = np.clip(np.rint(pixels), 1, 2500).astype(np.uint16)[None]
    grey[grey == 2500] = 4095
    found = []
    for nodata in (0, 65_535):
        grey[:, :, :10] = nodata
        image = examined_scene(written(tmp_path / f"{nodata}.tif", grey, nodata=nodata))
        (band,) = image.bands
        found.append((band.values.largest, band.values.clipped, band.values.known, len(band.edges.edges)))
    assert found[0] == found[1]
    assert found[0][0] == 4095.0
