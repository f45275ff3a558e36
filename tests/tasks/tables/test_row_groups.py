"""Tables written piece by piece."""

from __future__ import annotations

import gc
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tasks.coordinates.crs import MapFrame
from tasks.settings.coordinates import ELLIPSOIDAL
from tasks.store.artifact import artifact_of
from tasks.tables.geometry import box_around
from tasks.tables.names import Names
from tasks.tables.parquet import ROW_GROUP, read_table, write_row_groups, write_table
from tasks.tables.schemas.adjustment import OBJECT_POINTS, RESIDUALS

FRAME = MapFrame.of("EPSG:2154", ELLIPSOIDAL)
Columns = dict[str, Any]


def many_points(count: int) -> Columns:
    random = np.random.default_rng(3)
    place = random.uniform([7e5, 6.6e6, 100.0], [7.1e5, 6.61e6, 900.0], (count, 3))
    return {
        "point": np.array([f"T{number:07d}" for number in range(count)], dtype=object),
        **{f"{axis}_m": place[:, k] for k, axis in enumerate("xyz")},
        **{f"sigma_{axis}_m": random.uniform(0.01, 0.1, count) for axis in "xyz"},
        "rays": random.integers(2, 10, count),
    }


def residuals(*keys: tuple[str, str | None, str | None, str]) -> Columns:
    group, image, point, component = (list(part) for part in zip(*keys, strict=True))
    return {
        "group": group,
        "image": pa.array(image, pa.string()),
        "point": pa.array(point, pa.string()),
        "component": component,
        "residual": np.zeros(len(keys)),
        "sigma": np.ones(len(keys)),
        "unit": ["um"] * len(keys),
        "status": ["used"] * len(keys),
    }


def in_pieces(columns: Columns, size: int) -> Iterator[Mapping[str, Any]]:
    for start in range(0, len(next(iter(columns.values()))), size):
        yield {name: values[start : start + size] for name, values in columns.items()}


@pytest.fixture(scope="module")
def at_once(tmp_path_factory: pytest.TempPathFactory) -> tuple[Columns, Path]:
    """Columns of two row groups and a part of a third, and the table that has them all in one piece."""
    columns = many_points(2 * ROW_GROUP + 345)
    path = tmp_path_factory.mktemp("at_once") / "object_points.parquet"
    write_table(path, OBJECT_POINTS, columns, FRAME)
    return columns, path


@pytest.mark.parametrize("size", [7_919, ROW_GROUP, 10**6])
def test_the_bytes_do_not_depend_on_the_pieces(
    tmp_path: Path, size: int, at_once: tuple[Columns, Path]
) -> None:
    (columns, whole), pieces = at_once, tmp_path / "object_points.parquet"
    box = box_around(np.column_stack([columns[f"{axis}_m"] for axis in "xyz"]))
    rows = write_row_groups(pieces, OBJECT_POINTS, in_pieces(columns, size), FRAME, box)
    assert rows == 2 * ROW_GROUP + 345
    assert pieces.read_bytes() == whole.read_bytes()
    file = pq.ParquetFile(pieces)
    assert [file.metadata.row_group(k).num_rows for k in range(3)] == [ROW_GROUP, ROW_GROUP, 345]


def test_pieces_are_taken_one_by_one_and_not_kept(tmp_path: Path) -> None:
    columns = many_points(ROW_GROUP)
    before = pa.total_allocated_bytes()
    held = []

    def repeated() -> Iterator[Mapping[str, Any]]:
        for number in range(6):
            names = pa.array([f"{number:02d}{name}" for name in columns["point"]])
            gc.collect()  # What nobody holds any more may wait for it.
            held.append(pa.total_allocated_bytes() - before - names.nbytes)
            yield columns | {"point": names}

    assert write_row_groups(tmp_path / "t.parquet", OBJECT_POINTS, repeated(), FRAME) == 6 * ROW_GROUP
    # The sixth piece would find five of them, and the second found one at most.
    assert max(held) < 3 * (max(held[:2]) + 1)


def test_a_piece_without_rows_does_no_harm_and_no_piece_gives_a_table_without_rows(tmp_path: Path) -> None:
    columns = many_points(5)
    path, nothing = tmp_path / "object_points.parquet", tmp_path / "none" / "object_points.parquet"
    nothing.parent.mkdir()
    empty = {name: values[:0] for name, values in columns.items()}
    assert write_row_groups(path, OBJECT_POINTS, [empty, columns, empty], FRAME) == 5
    assert read_table(artifact_of(path))["point"].tolist() == columns["point"].tolist()
    assert write_row_groups(nothing, OBJECT_POINTS, [], FRAME) == 0
    assert len(read_table(artifact_of(nothing))) == 0


def test_rows_out_of_order_are_refused_within_a_piece_and_across_pieces(tmp_path: Path) -> None:
    columns = many_points(6)
    swapped = {name: values[[0, 2, 1, 3, 4, 5]] for name, values in columns.items()}
    for size in (6, 2):
        with pytest.raises(ValueError, match=r"the row \(T0000001\) is not in the order of the key"):
            write_row_groups(tmp_path / "t.parquet", OBJECT_POINTS, in_pieces(swapped, size), FRAME)


def test_a_key_twice_is_refused_across_pieces(tmp_path: Path) -> None:
    columns = many_points(2)
    with pytest.raises(ValueError, match=r"the row \(T0000000\)"):
        write_row_groups(tmp_path / "t.parquet", OBJECT_POINTS, [columns, columns], FRAME)


def test_null_stands_behind_every_name_in_the_order(tmp_path: Path) -> None:
    rows = [("g", "I1", "P", "x"), ("g", "I1", None, "x"), ("g", None, "P", "x"), ("h", "I1", None, "x")]
    assert write_row_groups(tmp_path / "t.parquet", RESIDUALS, [residuals(*rows)]) == 4
    assert write_row_groups(tmp_path / "t.parquet", RESIDUALS, (residuals(row) for row in rows)) == 4
    for first, second in ((1, 0), (2, 1), (3, 2)):
        with pytest.raises(ValueError, match="not in the order"):
            write_row_groups(tmp_path / "t.parquet", RESIDUALS, [residuals(rows[first], rows[second])])
    with pytest.raises(ValueError, match=r"\(g, I1, None, x\)"):
        write_row_groups(tmp_path / "t.parquet", RESIDUALS, [residuals(rows[1], rows[1])])


def test_coordinates_need_a_frame(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="need a CRS"):
        write_row_groups(tmp_path / "t.parquet", OBJECT_POINTS, [many_points(2)])


def test_names_are_ranked_like_the_rows_of_a_table(tmp_path: Path) -> None:
    given = ["10", "9", "b", "ä", "B", "€", "\U0001f600", ""]
    names = Names.of(given)
    expected = sorted(given)  # by code points
    assert names.take(np.argsort(names.rank)).to_pylist() == [*expected, None]
    assert names.take(np.array([2, -1, 0])).to_pylist() == ["b", None, "10"]
    path = tmp_path / "object_points.parquet"
    write_table(path, OBJECT_POINTS, many_points(len(given)) | {"point": given}, FRAME)
    assert read_table(artifact_of(path))["point"].tolist() == expected


def test_the_box_leaves_out_what_is_not_known() -> None:
    nan = np.nan
    assert box_around(np.array([[1.0, 5.0, nan], [2.0, nan, 7.0], [0.0, 9.0, 3.0]])) == (0, 5, 3, 2, 9, 7)
    assert box_around(np.array([[1.0, nan, 3.0]])) is None
    assert box_around(np.array([[1.0, 1.0, nan]])) is None
    assert box_around(np.zeros((0, 3))) is None
