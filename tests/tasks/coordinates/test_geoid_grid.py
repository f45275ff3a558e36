"""A geoid grid is smooth, and a damaged one is not."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from tasks.coordinates.crs import MapFrame
from tasks.coordinates.geoid_grid import refuse_damaged_geoid
from tasks.errors import InputError
from tasks.settings.coordinates import ELLIPSOIDAL, Heights

# A plane of undulations, 1 cm a node, of 41 by 41 nodes about 3° E, 46.5° N.
SIDE, STEP = 41, 0.025
WEST, NORTH = 2.5, 47.0
#: The middle of the grid in Lambert-93.
MIDDLE = np.array([[700_000.0, 6_600_000.0, 300.0]])


def geotiff(path: Path, undulation: np.ndarray) -> Path:
    """A GeoTIFF of 32-bit numbers without compression."""
    tags: list[tuple[int, int, int, bytes]] = [
        (256, 3, 1, struct.pack("<I", SIDE)), (257, 3, 1, struct.pack("<I", SIDE)),
        (258, 3, 1, struct.pack("<I", 32)), (259, 3, 1, struct.pack("<I", 1)),
        (262, 3, 1, struct.pack("<I", 1)), (273, 4, 1, b"data"), (277, 3, 1, struct.pack("<I", 1)),
        (278, 3, 1, struct.pack("<I", SIDE)), (279, 4, 1, struct.pack("<I", SIDE * SIDE * 4)),
        (339, 3, 1, struct.pack("<I", 3)),
        (33550, 12, 3, struct.pack("<3d", STEP, STEP, 0.0)),
        (33922, 12, 6, struct.pack("<6d", 0.0, 0.0, 0.0, WEST, NORTH, 0.0)),
        # Geographic, points and not areas, WGS 84.
        (34735, 3, 16, struct.pack("<16H", 1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 2, 2048, 0, 1, 4326)),
    ]  # fmt: skip
    start = 8 + 2 + 12 * len(tags) + 4
    long, entries = b"", b""
    for tag, kind, count, value in tags:
        if len(value) > 4:
            entries += struct.pack("<HHII", tag, kind, count, start + len(long))
            long += value
        else:
            entries += struct.pack("<HHI", tag, kind, count) + value
    entries = entries.replace(b"data", struct.pack("<I", start + len(long)))
    head = b"II*\x00" + struct.pack("<IH", 8, len(tags))
    path.write_bytes(head + entries + bytes(4) + long + undulation.astype("<f4").tobytes())
    return path


def plane() -> np.ndarray:
    return 48.0 + 0.01 * np.add.outer(np.arange(SIDE), np.arange(SIDE))


def frame(grid: Path) -> MapFrame:
    return MapFrame.of("EPSG:2154", Heights(geoid=grid))


def test_a_smooth_grid_is_served_and_read_at_its_nodes(tmp_path: Path) -> None:
    found = frame(geotiff(tmp_path / "geoid.tif", plane()))
    refuse_damaged_geoid(found, MIDDLE)
    latitude, longitude = np.deg2rad([NORTH - 20 * STEP]), np.deg2rad([WEST + 20 * STEP])
    assert found.geoid_undulation(latitude, longitude)[0] == pytest.approx(48.4, abs=1e-4)


@pytest.mark.parametrize("bit", [18, 20, 22, 24, 30])
def test_a_flipped_bit_of_a_node_near_the_block_is_found_with_its_place(tmp_path: Path, bit: int) -> None:
    damaged = plane().astype("<f4")
    damaged.view("<u4")[22, 19] ^= 1 << bit
    off = abs(float(damaged[22, 19]) - 48.41)
    with pytest.raises(InputError, match=r"damaged: at 46\.450° N, 2\.975° E") as error:
        refuse_damaged_geoid(frame(geotiff(tmp_path / "geoid.tif", damaged)), MIDDLE)
    assert error.value.file == tmp_path / "geoid.tif"
    assert off > 0.9


def test_a_block_on_local_axes_or_without_a_geoid_has_no_grid_to_look_at() -> None:
    for crs in ("EPSG:2154", "local"):
        refuse_damaged_geoid(MapFrame.of(crs, ELLIPSOIDAL), MIDDLE)


def test_all_of_raf20_is_smooth(test_data: Path) -> None:
    """The published geoid of France, mountains and all."""
    corners = np.array([[150_000.0, 6_150_000.0, 0.0], [1_150_000.0, 7_050_000.0, 0.0]])
    refuse_damaged_geoid(frame(test_data / "ign_borea_uce_m3" / "fr_ign_RAF20.tif"), corners)
