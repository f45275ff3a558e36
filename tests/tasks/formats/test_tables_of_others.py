"""Tables as others write them: what is declared is read, else the line that declares it is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tasks.errors import InputError
from tasks.formats.native_csv import read_csv_control, read_csv_exposures, read_csv_image_points
from tasks.formats.table_layout import TableLayout

SAMPLES = "format_samples/eo_csv"
POK = "omega-phi-kappa"


@pytest.fixture
def file(tmp_path):
    def write(text, encoding="utf-8"):
        path = tmp_path / "table.csv"
        path.write_bytes(text.encode(encoding))
        return path

    return write


def remedy_of(reader, path, *arguments):
    with pytest.raises(InputError) as raised:
        reader(path, *arguments)
    return raised.value.remedy


def test_a_table_with_semicolons_and_decimal_commas_is_read_as_declared(file):
    layout = TableLayout(
        separator="semicolon", decimal=",", columns={"point": "Name", "x": "Ost", "y": "Nord", "z": "Höhe"}
    )
    records = read_csv_control(
        file("Name;Ost;Nord;Höhe\r\nA 1;500123,412;5300456,789;412,334\r\nB;1;2;\r\n"), layout
    )
    assert records.point.to_pylist() == ["A 1", "B"]
    np.testing.assert_array_equal(records.position, [[500123.412, 5300456.789, 412.334], [1.0, 2.0, np.nan]])


def test_the_line_for_the_project_file_is_named_for_another_separator(file):
    path = file("point;x;y;z\nA;1,5;2,5;3,5\n")
    assert 'separator = "semicolon" and decimal = ","' in remedy_of(read_csv_control, path)
    assert 'separator = "tab"' in remedy_of(read_csv_control, file("point\tx\ty\tz\nA\t1\t2\t3\n"))
    semicolon = TableLayout(separator="semicolon")
    assert 'separator = "comma"' in remedy_of(read_csv_control, file("point,x,y,z\nA,1,2,3\n"), semicolon)


def test_the_columns_to_declare_are_named_from_the_headings(file):
    remedy = remedy_of(read_csv_control, file("Name,Easting,Northing,Height\nA,1,2,3\n"))
    assert 'columns = { point = "Name", x = "Easting", y = "Northing", z = "Height" }' in remedy
    header = "Filename,X/Long,Y/Lat,Z,Omega,Phi,Kappa\na.tif,1,2,3,4,5,6\n"
    remedy = remedy_of(read_csv_exposures, file(header), POK)
    assert 'columns = { image = "Filename", x = "X/Long", y = "Y/Lat" }' in remedy
    assert 'camera = "NAME"' in remedy
    assert 'strip = "time-gaps"' in remedy


def test_a_decimal_comma_that_is_not_declared_is_named(file):
    layout = TableLayout(separator="semicolon")
    assert 'decimal = ","' in remedy_of(read_csv_control, file("point;x;y;z\nA;1,5;2;3\n"), layout)
    comma = TableLayout(separator="semicolon", decimal=",")
    with pytest.raises(InputError, match=r"'1\.5' in the column 'x' is not a number"):
        read_csv_control(file("point;x;y;z\nA;1.5;2;3\n"), comma)


def test_swapped_headings_are_taken_as_declared(file):
    layout = TableLayout(columns={"x": "y", "y": "x"})
    records = read_csv_control(file("point,x,y,z\nA,1,2,3\n"), layout)
    assert records.position.tolist() == [[2.0, 1.0, 3.0]]


def test_a_table_without_headings_is_read_by_numbers(file):
    layout = TableLayout(
        separator="blank", header=False, skip_lines=1, comment="#",
        columns={"point": 1, "x": 3, "y": 2, "z": 4},
    )  # fmt: skip
    records = read_csv_control(file("any title\n# remark\n A  1.0\t2.0 3.0\n# more\nB 4 5 6\n"), layout)
    assert records.point.to_pylist() == ["A", "B"]
    assert records.position.tolist() == [[2.0, 1.0, 3.0], [5.0, 4.0, 6.0]]
    assert records.line.tolist() == [3, 5]


def test_lines_of_errors_count_from_the_top_of_the_file(file):
    layout = TableLayout(skip_lines=2, comment="//")
    with pytest.raises(InputError) as raised:
        read_csv_control(file("title\n\n// remark\npoint,x,y,z\n// one\nA,1,2,3\nB,1,oops,3\n"), layout)
    assert raised.value.line == 7


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"x": "Eastin"}, "not in the file"),
        ({"x": 9}, "not in the file"),
        ({"x": "Easting", "y": "Easting"}, "twice"),
        ({"east": "Easting"}, "not a column of this kind"),
    ],
)
def test_declarations_that_cannot_be_are_refused(file, columns, said):
    with pytest.raises(InputError, match=said):
        read_csv_control(file("point,Easting,y,z\nA,1,2,3\n"), TableLayout(columns=columns))


def test_a_heading_like_ours_can_be_declared_unused(file):
    path = file("point,x,y,z,sigma_east\nA,1,2,3,0.1\n")
    assert 'unused = ["sigma_east"]' in remedy_of(read_csv_control, path)
    assert np.isnan(read_csv_control(path, TableLayout(unused=("sigma_east",))).sigma).all()
    assert read_csv_control(path, TableLayout(columns={"sx": "sigma_east"})).sigma[0, 0] == 0.1


def test_a_heading_of_ours_that_is_declared_unused_is_not_read(file):
    path = file("point,x,y,z,role,Std X\nA,1,2,3,check,0.1\n")
    assert read_csv_control(path).role.to_pylist() == ["check"]
    read = read_csv_control(path, TableLayout(unused=("role", "Std X")))
    assert read.role.to_pylist() == [None]
    assert np.isnan(read.sigma).all()
    with pytest.raises(InputError, match="lacks the column z"):
        read_csv_control(path, TableLayout(unused=("z",)))
    # What is declared to be unused is no news, and kept nowhere.
    assert read.extra == {}
    # Another column may have the place of the one that is not read.
    moved = TableLayout(columns={"z": "Std X"}, unused=("z",))
    assert read_csv_control(path, moved).position.tolist() == [[1.0, 2.0, 0.1]]
    assert read_csv_control(path, moved).extra == {}


def test_an_unused_column_that_the_file_does_not_have_is_refused(file):
    path = file("point,x,y,z,role\nA,1,2,3,check\n")
    with pytest.raises(InputError, match=r"unused declares 'rolle'.*not in the file.*Did you mean 'role'"):
        read_csv_control(path, TableLayout(unused=("rolle",)))


def test_latin_1_is_read_where_it_is_declared(file):
    path = file("point,x,y,z\nKöln,1,2,3\n", "latin-1")
    with pytest.raises(InputError, match='declare encoding = "latin-1"') as refused:
        read_csv_control(path, TableLayout())
    assert refused.value.line == 2
    assert "UTF-8" in remedy_of(read_csv_control, path)
    assert read_csv_control(path, TableLayout(encoding="latin-1")).point.to_pylist() == ["Köln"]


def test_headings_of_ultramap_with_a_mark_in_front_and_a_separator_behind(file):
    layout = TableLayout(
        separator="semicolon",
        columns={"camera": "Camera", "image": "Nr", "omega": "Rot_X", "phi": "Rot_Y", "kappa": "Rot_Z"},
        elsewhere=("strip",),
    )
    text = "# Camera; Session; Nr; X; Y; Z; Rot_X; Rot_Y; Rot_Z;\nUCO;S1;00017;1;2;3;0.1;0.2;90;\n"
    records = read_csv_exposures(file(text), POK, layout)
    assert records.image.to_pylist() == ["00017"]
    assert records.camera.to_pylist() == ["UCO"]
    assert records.angles.tolist() == [[0.1, 0.2, 90.0]]


def agency(test_data: Path, name: str, **layout):
    elsewhere = ("strip", "camera")
    return read_csv_exposures(test_data / SAMPLES / name, POK, TableLayout(elsewhere=elsewhere, **layout))


def test_the_samples_of_agencies_are_read(test_data):
    bc = agency(
        test_data, "bc_patb_georef_ultracam_xp.csv",
        columns={"image": "roll_frame", "x": "Easting", "y": "Northing", "z": "H_MSL"},
    )  # fmt: skip
    assert bc.image[0].as_py() == "bcd12001_001"
    assert bc.position[0].tolist() == [475222.0, 5943050.0, 6064.49]
    # The images' x is along flight (formats.md 16.4): flying west, κ is about 180°.
    assert np.abs(bc.angles[:, 2] - 178.0).max() < 2.0
    ngi = agency(test_data, "ngi_xyz_opk.csv", columns={"image": "filename"})
    assert ngi.position[0].tolist() == [-55094.504, -3727407.037, 5258.308]
    assert ngi.angles[2].tolist() == [-0.516, 0.227, 0.67]
    odm = agency(test_data, "odm_xyz_opk.csv", columns={"image": "filename"}, separator="blank", quote="'")
    assert odm.camera[0].as_py() == "dji fc6310r 5472 3648 brown 0.6666"
    assert odm.angles[0].tolist() == [28.831, 0.94, 1.782]


def test_the_sample_with_geographic_positions_and_heading_pitch_roll_is_read(test_data):
    layout = TableLayout(
        separator="blank",
        columns={"image": "filename", "x": "longitude", "y": "latitude", "z": "altitude", "heading": "yaw"},
        elsewhere=("strip",),
    )
    records = read_csv_exposures(test_data / SAMPLES / "odm_lla_rpy.csv", "heading-pitch-roll", layout)
    assert records.position[0].tolist() == [120.9517016, 24.68027804, 186.57]
    assert records.angles[0].tolist() == [92.9, 30.0, 0.0]


def test_image_points_have_a_layout_too(file):
    layout = TableLayout(separator="tab", columns={"image": "Photo", "point": "ID", "x": "Col", "y": "Row"})
    records = read_csv_image_points(file("Photo\tID\tCol\tRow\n a b\tp\t1\t2\n"), layout)
    assert records.image.to_pylist() == ["a b"]
