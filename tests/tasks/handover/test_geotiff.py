"""GeoTIFF read back by its own structure, and by GDAL."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pyproj
import pytest
import rasterio

from tasks.coordinates.crs import MapFrame
from tasks.handover.geotiff import GridPlace, write_geotiff
from tasks.settings.coordinates import Heights

PLACE = GridPlace(651_000.0, 6_861_000.0, 2.5)
FORMATS = {2: "s", 3: "H", 4: "I", 12: "d"}


def grids(rows: int = 300, columns: int = 530) -> dict[str, np.ndarray]:
    y, x = np.mgrid[:rows, :columns]
    first = (y * 1000 + x).astype(np.float32)
    first[:7, :9] = np.nan
    return {"sigma_x_m": first, "rays <all>": (x % 5).astype(np.float32)}


def directories(data: bytes) -> list[tuple[int, int, dict[int, tuple]]]:
    """Start and end of each directory with its tags."""
    assert data[:4] == b"II*\0"
    start = struct.unpack_from("<I", data, 4)[0]
    found = []
    while start:
        count = struct.unpack_from("<H", data, start)[0]
        tags, end = {}, start + 2 + 12 * count + 4
        for entry in range(count):
            tag, kind, number, value = struct.unpack_from("<HHII", data, start + 2 + 12 * entry)
            size = struct.calcsize(f"<{number}{FORMATS[kind]}")
            place = start + 10 + 12 * entry if size <= 4 else value
            tags[tag] = struct.unpack_from(f"<{number}{FORMATS[kind]}", data, place)
            end = max(end, place + size)
        assert list(tags) == sorted(tags)
        found.append((start, end, tags))
        start = struct.unpack_from("<I", data, start + 2 + 12 * count)[0]
    return found


def tile(data: bytes, tags: dict[int, tuple], number: int) -> np.ndarray:
    offset, length = tags[324][number], tags[325][number]
    return np.frombuffer(zlib.decompress(data[offset : offset + length]), "<f4").reshape(256, 256)


def frame(crs: str = "EPSG:2154") -> MapFrame:
    return MapFrame.of(crs, Heights.model_validate("ellipsoidal"))


def test_tiles_hold_the_numbers_and_overviews_come_before_them(tmp_path: Path) -> None:
    bands = grids()
    write_geotiff(tmp_path / "map.tif", bands, PLACE, frame(), "A test.")
    data = (tmp_path / "map.tif").read_bytes()
    full, *overviews = directories(data)
    assert [level[2][256] for level in (full, *overviews)] == [(530,), (265,), (133,)]
    for band, expected in enumerate(bands.values()):
        found = np.block([[tile(data, full[2], 6 * band + 3 * i + j) for j in range(3)] for i in range(2)])
        np.testing.assert_array_equal(found[:300, :530], expected)
        assert np.isnan(found[300:]).all()
        np.testing.assert_array_equal(tile(data, overviews[1][2], band)[:75, :133], expected[::4, ::4])
    every = (full, *overviews)
    ends_of_directories = max(end for _, end, _ in every)
    first_of_data = [min(tags[324]) for _, _, tags in every]
    assert ends_of_directories <= min(first_of_data)
    assert first_of_data == sorted(first_of_data, reverse=True)
    assert full[2][33550] == (2.5, 2.5, 0.0)
    assert full[2][33922][3:5] == (651_000.0, 6_861_000.0)


def test_a_small_grid_has_no_overview(tmp_path: Path) -> None:
    write_geotiff(tmp_path / "map.tif", grids(20, 30), PLACE, frame(), "A test.")
    assert len(directories((tmp_path / "map.tif").read_bytes())) == 1


OBLIQUE = "+proj=omerc +lat_0=4 +lonc=115 +alpha=53.3 +k=0.9998 +gamma=53.1 +ellps=GRS80 +units=m +type=crs"


@pytest.mark.parametrize("crs", ["EPSG:2154", OBLIQUE, "local"])
def test_gdal_reads_numbers_names_place_and_crs(tmp_path: Path, crs: str) -> None:
    bands = grids()
    write_geotiff(tmp_path / "map.tif", bands, PLACE, frame(crs), "A <test>.")
    with rasterio.open(tmp_path / "map.tif") as found:
        assert found.descriptions == tuple(bands)
        assert found.tags()["ABOUT"] == "A <test>."
        assert found.overviews(1) == [2, 4]
        assert np.isnan(found.nodata)
        assert found.transform[:6] == (2.5, 0.0, 651_000.0, 0.0, -2.5, 6_861_000.0)
        for number, expected in enumerate(bands.values(), 1):
            np.testing.assert_array_equal(found.read(number), expected)
        if crs.startswith("EPSG"):
            assert found.crs.to_epsg() == 2154
        else:
            assert not found.crs.is_projected
        if crs == OBLIQUE:  # as a text only
            assert 'PARAMETER[""Azimuth"",53.3]' in found.crs.to_wkt()


@pytest.mark.parametrize(
    "projection",
    [
        "tmerc +lat_0=48 +lon_0=9.3 +k=0.99995 +x_0=20000 +y_0=30000 +ellps=GRS80",
        "tmerc +lat_0=0 +lon_0=9 +k=1 +x_0=3500000 +ellps=bessel +towgs84=598.1,73.7,418.2,0.2,0.05,-2.5,6.7",
        "lcc +lat_1=46.5 +lat_0=46.5 +lon_0=3 +k_0=0.9998 +x_0=6e5 +a=6378249.2 +b=6356515 +pm=paris",
        "lcc +lat_1=48 +lat_2=50 +lat_0=49 +lon_0=13 +x_0=1000 +y_0=2000 +ellps=intl",
        "merc +k=0.9996 +lon_0=10 +x_0=400 +y_0=500 +ellps=GRS80",
        "sterea +lat_0=52.156 +lon_0=5.387 +k=0.9999 +x_0=155000 +y_0=463000 +ellps=bessel",
    ],
)  # fmt: skip
def test_gdal_reads_a_projection_without_code_by_its_parameters(tmp_path: Path, projection: str) -> None:
    declared = frame(f"+proj={projection} +units=m +type=crs")
    write_geotiff(tmp_path / "map.tif", grids(20, 30), PLACE, declared, "A test.")
    own = declared.crs
    with rasterio.open(tmp_path / "map.tif") as found:
        theirs = pyproj.CRS.from_wkt(found.crs.to_wkt())
        shift = found.crs.to_dict().get("towgs84")
    places = np.array([[9.1, 9.9], [48.2, 49.4]])
    np.testing.assert_allclose(
        pyproj.Proj(theirs)(*places), pyproj.Proj(own)(*places), rtol=0.0, atol=1e-6, err_msg=str(theirs)
    )
    for part in ("semi_major_metre", "semi_minor_metre"):
        np.testing.assert_allclose(getattr(theirs.ellipsoid, part), getattr(own.ellipsoid, part), atol=1e-6)
    assert theirs.is_projected
    if own.is_bound:
        assert shift == "598.1,73.7,418.2,0.2,0.05,-2.5,6.7"
