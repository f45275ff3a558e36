from __future__ import annotations

import json
import struct

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tasks.coordinates.crs import MapFrame
from tasks.files.installation import InstallationError
from tasks.settings.coordinates import ELLIPSOIDAL
from tasks.store.artifact import artifact_of
from tasks.tables.parquet import read_table, write_table
from tasks.tables.schemas.adjustment import OBJECT_POINTS, RESIDUALS
from tasks.tables.schemas.deliveries import APPROXIMATE_POINTS, CONTROL_POINTS, IMAGE_POINTS
from tasks.tables.schemas.parameters import PARAMETERS
from tasks.tables.schemas.register import SCHEMAS

FRAME = MapFrame.of("EPSG:2154", ELLIPSOIDAL)


def object_points(names, **changes):
    count = len(names)
    columns = {
        "point": names,
        "x_m": np.arange(count) + 700000.0,
        "y_m": np.arange(count) + 6600000.0,
        "z_m": np.arange(count) + 100.0,
        "sigma_x_m": np.full(count, 0.1),
        "sigma_y_m": np.full(count, 0.1),
        "sigma_z_m": np.full(count, 0.2),
        "rays": np.full(count, 3),
    }
    return columns | changes


def test_rows_come_out_in_the_order_of_the_key(tmp_path):
    path = tmp_path / "object_points.parquet"
    assert write_table(path, OBJECT_POINTS, object_points(["10", "9", "b", "ä", "B"]), FRAME) == 5
    table = read_table(artifact_of(path))
    assert table["point"].tolist() == ["10", "9", "B", "b", "ä"]
    assert table["x_m"].tolist() == [700000.0, 700001.0, 700004.0, 700002.0, 700003.0]
    assert "geometry" not in table.columns


def test_the_same_content_gives_the_same_bytes_whatever_the_order_of_the_rows(tmp_path):
    first, second = tmp_path / "a" / "object_points.parquet", tmp_path / "b" / "object_points.parquet"
    columns = object_points([f"P{i}" for i in range(1000)])
    order = np.random.default_rng(1).permutation(1000)
    shuffled = {name: np.asarray(values)[order] for name, values in columns.items()}
    for path, content in ((first, columns), (second, shuffled)):
        path.parent.mkdir()
        write_table(path, OBJECT_POINTS, content, FRAME)
    assert first.read_bytes() == second.read_bytes()


def test_units_key_and_frame_stand_in_the_metadata_and_nothing_of_this_machine(tmp_path):
    path = tmp_path / "object_points.parquet"
    write_table(path, OBJECT_POINTS, object_points(["a"]), FRAME)
    described = json.loads(pq.read_schema(path).metadata[b"aerocal"])
    assert described["schema"] == "object_points"
    assert described["key"] == ["point"]
    assert described["columns"]["sigma_x_m"]["unit"] == "m"
    assert (described["crs"], described["heights"]) == ("EPSG:2154", "ellipsoidal heights")
    assert str(tmp_path).encode() not in path.read_bytes()


def test_tables_with_coordinates_are_geoparquet(tmp_path):
    path = tmp_path / "object_points.parquet"
    write_table(path, OBJECT_POINTS, object_points(["b", "a"]), FRAME)
    table = pq.read_table(path)
    geo = json.loads(table.schema.metadata[b"geo"])
    assert geo["version"] == "1.1.0"
    column = geo["columns"][geo["primary_column"]]
    assert column["encoding"] == "WKB"
    assert column["geometry_types"] == ["Point Z"]
    assert column["crs"]["id"] == {"authority": "EPSG", "code": 2154}
    assert column["bbox"] == [700000.0, 6600000.0, 100.0, 700001.0, 6600001.0, 101.0]
    first = table["geometry"][0].as_py()
    assert struct.unpack("<BIddd", first) == (1, 1001, 700001.0, 6600001.0, 101.0)


def test_a_local_project_has_no_crs_in_its_geometry(tmp_path):
    path = tmp_path / "object_points.parquet"
    write_table(path, OBJECT_POINTS, object_points(["a"]), MapFrame.of("local", ELLIPSOIDAL))
    geo = json.loads(pq.read_schema(path).metadata[b"geo"])
    assert geo["columns"]["geometry"]["crs"] is None


def test_a_point_without_plan_position_has_no_geometry(tmp_path):
    path = tmp_path / "control_points.parquet"
    nan = np.nan
    write_table(
        path,
        CONTROL_POINTS,
        {
            "point": ["a", "b", "c"],
            "x_m": [1.0, nan, 3.0],
            "y_m": [1.0, nan, 3.0],
            "z_m": [1.0, 2.0, nan],
            "role": ["control"] * 3,
        },
        FRAME,
    )
    geometry = pq.read_table(path)["geometry"].to_pylist()
    assert [value is None for value in geometry] == [False, True, False]
    assert np.isnan(struct.unpack("<BIddd", geometry[2])[4])


def test_nan_is_written_as_null_and_read_as_nan(tmp_path):
    path = tmp_path / "parameters.parquet"
    columns = {
        "parameter": ["focal_length", "boresight_roll"],
        "entity": ["CAM", "CAM"],
        "value": [0.1, 0.2],
        "change": [0.0, 0.1],
        "sigma": [np.nan, 0.01],
        "unit": ["mm", "deg"],
        "status": ["fixed", "significant"],
    }
    write_table(path, PARAMETERS, columns)
    raw = pq.read_table(path)
    assert raw["sigma"].to_pylist() == [0.01, None]
    assert raw["t"].null_count == 2
    assert np.isnan(read_table(artifact_of(path))["sigma"][1])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"x_m": [np.nan]}, "x_m: 1 rows are null"),
        ({"x_m": [np.inf]}, "x_m: infinite"),
        ({"rays": None}, "rays"),
        ({"colour": ["red"]}, "no such columns: colour"),
        ({"x_m": [1.0, 2.0]}, "x_m: 2 rows, but 1"),
    ],
)
def test_what_does_not_fit_the_schema_is_refused(tmp_path, changes, message):
    columns = object_points(["a"]) | changes
    columns = {name: values for name, values in columns.items() if values is not None}
    with pytest.raises(ValueError, match=message):
        write_table(tmp_path / "object_points.parquet", OBJECT_POINTS, columns, FRAME)


def test_a_text_outside_the_known_ones_is_refused(tmp_path):
    columns = {"point": ["a"], "role": ["tie"]}
    with pytest.raises(ValueError, match="'tie'"):
        write_table(tmp_path / "control_points.parquet", CONTROL_POINTS, columns, FRAME)


def test_two_rows_with_the_same_key_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"two rows have the key \(b\)"):
        write_table(
            tmp_path / "object_points.parquet", OBJECT_POINTS, object_points(["a", "b", "c", "b"]), FRAME
        )


def test_null_is_a_value_in_a_key(tmp_path):
    columns = {
        "group": ["ins", "ins", "image_points", "image_points"],
        "image": ["I2", "I1", "I1", "I1"],
        "point": [None, None, "P", "P"],
        "component": ["roll", "roll", "y", "x"],
        "residual": np.arange(4.0),
        "sigma": np.ones(4),
        "unit": ["deg", "deg", "um", "um"],
        "status": ["used"] * 4,
    }
    path = tmp_path / "residuals.parquet"
    write_table(path, RESIDUALS, columns)
    assert read_table(artifact_of(path))["residual"].tolist() == [3.0, 2.0, 1.0, 0.0]
    columns["image"] = ["I1", "I1", "I1", "I1"]
    with pytest.raises(ValueError, match=r"\(ins, I1, None, roll\)"):
        write_table(path, RESIDUALS, columns)


def test_arrow_arrays_and_further_text_columns_are_taken_as_they_are(tmp_path):
    path = tmp_path / "image_points.parquet"
    columns = {
        "image": pa.array(["b", "a"]),
        "point": pa.chunked_array([["P"], ["Q"]]),
        "x_mm": [1.0, 2.0],
        "y_mm": [1.0, 2.0],
        "sigma_x_mm": [0.1, 0.1],
        "sigma_y_mm": [0.1, 0.1],
    }
    write_table(
        path, IMAGE_POINTS, columns, extra={"method": pa.array(["lsm", None]), "x_mm": pa.array(["no", "no"])}
    )
    table = read_table(artifact_of(path))
    assert table["point"].tolist() == ["Q", "P"]
    assert table["x_mm"].tolist() == [2.0, 1.0]
    assert table["method"].isna().tolist() == [True, False]


def test_a_table_of_another_name_or_version_is_not_read(tmp_path):
    path = tmp_path / "parameters.parquet"
    write_table(path, OBJECT_POINTS, object_points(["a"]), FRAME)
    with pytest.raises(InstallationError, match="not a table 'parameters'"):
        read_table(artifact_of(path))


def test_a_table_without_rows_can_be_written_and_read(tmp_path):
    path = tmp_path / "object_points.parquet"
    assert write_table(path, OBJECT_POINTS, object_points([]), FRAME) == 0
    assert len(read_table(artifact_of(path))) == 0


def test_many_residuals_are_written_in_groups_of_rows(tmp_path):
    count = 62_500
    names = np.char.add("P", np.arange(count).astype(str))
    columns = {
        "group": np.repeat("image_points", 4 * count),
        "image": np.tile(np.repeat(["I1", "I2"], count), 2),
        "point": np.tile(names, 4),
        "component": np.repeat(["y", "x"], 2 * count),
        "residual": np.zeros(4 * count),
        "sigma": np.ones(4 * count),
        "unit": np.repeat("um", 4 * count),
        "status": np.repeat("used", 4 * count),
    }
    path = tmp_path / "residuals.parquet"
    assert write_table(path, RESIDUALS, columns) == 4 * count
    assert pq.ParquetFile(path).num_row_groups == 3


@pytest.mark.parametrize("schema", SCHEMAS.values(), ids=SCHEMAS.keys())
def test_every_schema_has_a_key_of_its_own_columns_and_explains_each(schema):
    names = [column.name for column in schema.columns]
    assert len(set(names)) == len(names)
    assert schema.key
    assert set(schema.key) <= set(names)
    assert set(schema.coordinates) <= set(names)
    assert all(column.meaning for column in schema.columns)
    assert schema.meaning.endswith(".")
    for column in schema.columns:
        suffix = {"m": "_m", "mm": "_mm", "deg": "_deg", "um": "_um", "s": "_s"}.get(column.unit)
        # The contract names the σ of mean residuals plainly.
        if suffix is not None and (schema.name, column.name) != ("residual_grid", "sigma"):
            assert column.name.endswith(suffix)


#: The columns that users and other programs rely on.
CONTRACT = {
    "images": "image camera strip flight heading_deg height_above_ground_m",
    "image_points": "image point x_mm y_mm sigma_x_mm sigma_y_mm",
    "exposures": "image x_m y_m z_m omega_deg phi_deg kappa_deg heading_deg pitch_deg roll_deg sigma_x_m "
    "sigma_y_m sigma_z_m sigma_omega_deg sigma_phi_deg sigma_kappa_deg time_s flight strip",
    "control_points": "point x_m y_m z_m sigma_x_m sigma_y_m sigma_z_m role",
    "exterior_orientations": "image x_m y_m z_m omega_deg phi_deg kappa_deg sigma_x_m sigma_omega_deg",
    "object_points": "point x_m y_m z_m sigma_x_m sigma_y_m sigma_z_m rays",
    "residuals": "group image point component residual sigma unit redundancy standardized mdb status",
    "parameters": "parameter entity value change sigma sigma_prior sigma_over_prior unit t status",
    "correlations": "parameter_a entity_a parameter_b entity_b correlation",
    "control_residuals": "point dx_m dy_m dz_m rays status",
    "check_points": "point dx_m dy_m dz_m rays",
}


@pytest.mark.parametrize("name", CONTRACT)
def test_the_published_columns_are_there(name):
    assert set(CONTRACT[name].split()) <= {column.name for column in SCHEMAS[name].columns}


def test_texts_can_be_read_as_categories_in_their_order(tmp_path):
    path = tmp_path / "residuals.parquet"
    # Names come in any order, a null stays one, and each of two row groups has a dictionary of its own.
    count = 120_000
    names = np.array(["b", "ä", "B", "10"], dtype=object)[np.arange(count) % 4]
    numbers = [f"{i:06d}" for i in range(count)]
    write_table(
        path,
        RESIDUALS,
        {
            "group": ["gnss_positions"] * (count - 1) + ["control_points"],
            "image": pa.array([*names[:-1], None]),
            "point": numbers,
            "component": ["x"] * count,
            "residual": np.arange(count),
            "sigma": np.ones(count),
            "unit": ["m"] * count,
            "redundancy": np.ones(count),
            "standardized": np.ones(count),
            "status": ["used"] * count,
        },
    )
    plain, read = (read_table(artifact_of(path), categories=own) for own in (False, True))
    assert read["image"].cat.categories.tolist() == ["10", "B", "b", "ä"]
    assert read["point"].cat.categories.is_monotonic_increasing
    for name in ("group", "image", "point", "status"):
        assert read[name].astype(plain[name].dtype).equals(plain[name])
    assert read["residual"].equals(plain["residual"])
    few = read_table(artifact_of(path), categories=True, columns=("residual", "image"))
    assert list(few) == ["residual", "image"]
    assert all(few[name].equals(read[name]) for name in few)


def test_a_long_table_that_a_stage_changes_is_read_unchanged_by_the_next(tmp_path):
    path = tmp_path / "approximate_points.parquet"
    columns = {
        "point": ["A", "B"],
        **dict.fromkeys(("x_m", "y_m", "z_m", "angle_deg"), np.array([1.0, 2.0])),
        "rays": np.array([2, 3]),
        "status": ["used", "used"],
    }
    write_table(path, APPROXIMATE_POINTS, columns, FRAME)
    first = read_table(artifact_of(path), categories=True)
    first.loc[0, "x_m"] = 5.0
    first["rays"] = 0
    second = read_table(artifact_of(path), categories=True)
    assert second["x_m"].tolist() == [1.0, 2.0]
    assert second["rays"].tolist() == [2, 3]
