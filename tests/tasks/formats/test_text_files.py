from __future__ import annotations

import numpy as np
import pytest

from tasks.errors import InputError
from tasks.formats import text_lines
from tasks.formats.native_csv import read_csv_control, read_csv_exposures, read_csv_image_points
from tasks.formats.photo_lists import read_photo_lists
from tasks.formats.register import CONTROL_FORMATS, EXPOSURE_FORMATS, IMAGE_POINT_FORMATS


@pytest.fixture
def file(tmp_path):
    def write(content):
        path = tmp_path / "input.txt"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


def refused(reader, path, *arguments):
    with pytest.raises(InputError) as raised:
        reader(path, *arguments)
    assert raised.value.file == path
    assert raised.value.remedy
    return raised.value


def test_columns_come_in_any_order_and_names_stay_verbatim(file):
    records = read_csv_image_points(file('y,x,point,image\n2.5,1.5,007,"Im, 1"\n-4,3e1,NA,null\n'))
    assert records.point.to_pylist() == ["007", "NA"]
    assert records.image.to_pylist() == ["Im, 1", "null"]
    assert records.xy.tolist() == [[1.5, 2.5], [30.0, -4.0]]
    assert np.isnan(records.sigma).all()
    assert records.line.tolist() == [2, 3]


def test_numbers_are_read_to_the_last_digit(file):
    values = ["6459960.9899999998", "0.1234567890123456", "1e-300", "123456789.123456789"]
    records = read_csv_image_points(
        file("image,point,x,y\n" + "".join(f"I,P{i},{value},0\n" for i, value in enumerate(values)))
    )
    assert records.xy[:, 0].tolist() == [float(value) for value in values]


@pytest.mark.parametrize("end", ["\r\n", "\r", "\n\n", " \r\n"])
def test_line_ends_blank_lines_and_a_byte_order_mark_do_not_matter(file, end):
    text = "\ufeff" + end.join(["image, point, x, y", "I1,P1,1,2", "I2,P1,3,4"])
    records = read_csv_image_points(file(text))
    assert records.xy.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert records.image.to_pylist() == ["I1", "I2"]


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_text_in_utf_16_is_named(file, encoding):
    """As spreadsheets ("Unicode text") and the output of PowerShell are saved."""
    content = "\ufeffimage,point,x,y\nI1,P1,1,2\n".encode(encoding)
    for reader in (read_csv_image_points, read_photo_lists):
        error = refused(reader, file(content))
        assert "UTF-16" in error.what
        assert error.remedy == "Save it as UTF-8."


def test_lines_are_counted_as_an_editor_shows_them(file):
    error = refused(read_csv_image_points, file("\n\nimage,point,x,y\nI,P,1,2\n\n\nI,Q,oops,2\n"))
    assert error.line == 7
    assert "'oops' in the column 'x'" in error.what


@pytest.mark.parametrize("reader", [read_csv_image_points, read_csv_control])
@pytest.mark.parametrize("content", ["", " \n\n", "\ufeff"])
def test_an_empty_file_is_an_error(file, reader, content):
    assert "empty" in refused(reader, file(content)).what


@pytest.mark.parametrize("content", ["image,point,x,y", "image,point,x,y\n", "image,point,x,y\n\n \n"])
def test_a_header_without_rows_is_an_error(file, content):
    assert "no rows" in refused(read_csv_image_points, file(content)).what


def test_missing_columns_are_named_with_what_may_be_meant(file):
    error = refused(read_csv_image_points, file("image,points,x,y_mm\nI,P,1,2\n"))
    assert "point, y" in error.what
    assert "'points' may mean 'point'" in error.remedy
    assert error.line == 1


@pytest.mark.parametrize(("mark", "name"), [(";", "semicolon"), ("\t", "tab")])
def test_another_delimiter_is_named(file, mark, name):
    text = "image,point,x,y\nI,P,1,2\n".replace(",", mark)
    assert name in refused(read_csv_image_points, file(text)).what


def test_a_decimal_comma_is_named(file):
    quoted = refused(read_csv_image_points, file('image,point,x,y\nI,P,"1,5",2\n'))
    assert "decimal point" in quoted.remedy
    plain = refused(read_csv_image_points, file("image,point,x,y\nI,Q,1,2\nI,P,1,5,2,5\n"))
    assert plain.line == 3
    assert "decimal point" in plain.remedy


def test_one_field_too_many_is_not_dropped_silently(file):
    assert refused(read_csv_image_points, file("image,point,x,y\nI,P,1,5,2\nI,Q,1,2\n")).line == 2


def test_one_field_too_few_is_an_error_on_its_line(file):
    error = refused(read_csv_image_points, file("image,point,x,y\nI,P,1,2\nI,Q,1\n"))
    assert (error.line, "has 3 columns, but the header has 4" in error.what) == (3, True)


@pytest.mark.parametrize("last", ["C3,1,2", "C3,1", "C3", "C3,1,2,3,0.1,0.1", '"C, 3",1', "C3,1,2\n\n"])
def test_a_control_file_cut_off_inside_a_row_is_not_a_point_known_in_plan(file, last):
    error = refused(read_csv_control, file("point,x,y,z,sx,sy,sz\nC1,1,2,3,,,\n\nC2,1,2,,0.1,0.1,\n" + last))
    assert error.line == 5
    assert "cut off" in error.remedy


def test_a_short_row_is_found_wherever_it_stands(file, monkeypatch):
    monkeypatch.setattr(text_lines, "_PIECE", 50)
    rows = [f"I,P{i},1,2" for i in range(100)]
    assert len(read_csv_image_points(file("\n".join(["image,point,x,y", *rows]))).line) == 100
    for number in (0, 7, 50, 99):
        cut = [*rows[:number], "I,P,1", *rows[number + 1 :]]
        assert refused(read_csv_image_points, file("\n".join(["image,point,x,y", *cut]))).line == number + 2


@pytest.mark.parametrize("last", ["20.9", "20.", "20", "-0.001"])
def test_a_file_cut_off_inside_its_last_number_is_refused(file, last):
    rows = ["image,point,x,y", *(f"I,P{i:03d},1.5,{i}.{100_000 + i}" for i in range(100))]
    error = refused(read_csv_image_points, file("\n".join([*rows, f"I,Q,1.5,{last}"])))
    assert (error.line, "cut off" in error.remedy) == (102, True)
    # With the end of a line it was meant; and a zero at the end of a number may be left out.
    for sound in (f"I,Q,1.5,{last}\n", "I,Q,1.5,20.10001"):
        assert len(read_csv_image_points(file("\n".join([*rows, sound]))).line) == 101


def test_an_open_quotation_mark_is_an_error(file):
    assert (
        "quotation mark" in refused(read_csv_image_points, file('image,point,x,y\nI,"P,1,2\nI,Q,1,2\n')).what
    )


def test_lines_are_counted_where_a_name_in_quotation_marks_has_a_line_end(file):
    """Names with a line end are refused on the line where their row begins; the next row keeps its own."""
    text = 'point,x,y,z,note\nC1,1,2,3,"one\ntwo"\n\nC2,1,oops,3,\n'
    error = refused(read_csv_control, file(text))
    assert (error.line, "'oops' in the column 'y'" in error.what) == (5, True)


@pytest.mark.parametrize("text", ["1_000", "٣", "nan", "-NaN", "1,5", "1 5", "0x10"])
def test_what_python_or_pandas_would_take_for_a_number_is_none(file, text):
    """Below a blank line, so that the row is not read by Arrow."""
    error = refused(read_csv_control, file(f'point,x,y,z\n\nC1,"{text}",2,3\n'))
    assert (error.line, "'x' is not a number" in error.what) == (3, True)


def test_bytes_that_are_not_utf8_name_their_line(file):
    error = refused(read_csv_image_points, file(b"image,point,x,y\nI,P,1,2\nI,\xe9,1,2\n"))
    assert error.line == 3


def test_a_column_named_twice_is_an_error(file):
    assert "twice" in refused(read_csv_image_points, file("image,point,x,x,y\nI,P,1,1,2\n")).what


def test_an_empty_name_is_an_error(file):
    assert refused(read_csv_image_points, file("image,point,x,y\nI,P,1,2\n,P,1,2\n")).line == 3


def test_exposures_need_the_angles_that_are_declared(file):
    text = "image,camera,strip,x,y,z,omega,phi,kappa\nI,C,S,1,2,3,4,5,6\n"
    assert read_csv_exposures(file(text), "omega-phi-kappa").angles.tolist() == [[4.0, 5.0, 6.0]]
    error = refused(read_csv_exposures, file(text), "heading-pitch-roll")
    assert "heading, pitch, roll" in error.what


def test_heading_pitch_roll_and_all_optional_columns(file):
    text = (
        "image,camera,strip,flight,time,x,y,z,heading,pitch,roll,sx,sy,sz,sheading,spitch,sroll,gsd\n"
        "I,C,,F,12.5,1,2,3,350,1,2,.1,.2,.3,.01,.02,.03,5\n"
    )
    records = read_csv_exposures(file(text), "heading-pitch-roll")
    assert records.angles.tolist() == [[350.0, 1.0, 2.0]]
    assert records.sigma_angles.tolist() == [[0.01, 0.02, 0.03]]
    assert records.sigma_position.tolist() == [[0.1, 0.2, 0.3]]
    assert records.strip.to_pylist() == [None]
    assert records.flight.to_pylist() == ["F"]
    assert records.time_s.tolist() == [12.5]
    assert records.extra["gsd"].to_pylist() == ["5"]


def test_control_may_miss_coordinates_and_roles(file):
    records = read_csv_control(file("point,x,y,z,role\nA,1,2,,check\nB,,,3,\n"))
    np.testing.assert_array_equal(np.isnan(records.position), [[False, False, True], [True, True, False]])
    assert records.role.to_pylist() == ["check", None]


@pytest.mark.parametrize("register", [IMAGE_POINT_FORMATS, CONTROL_FORMATS])
def test_every_reader_refuses_an_empty_file_and_a_table_of_words(file, register):
    for reader in register.values():
        assert refused(reader, file("")).what == "The file is empty."
        error = refused(reader, file("point image x y\nthis is no number\n"))
        assert error.line in (1, 2) or error.what.startswith(("There is no", "The camera", "This is not "))


def test_every_exposure_reader_refuses_an_empty_file(file):
    for reader in EXPOSURE_FORMATS.values():
        assert refused(reader, file(""), "omega-phi-kappa").what == "The file is empty."


@pytest.mark.parametrize(
    "names", ["sigma_x,Sigma-Y,SIGZ", "std_x,y_sigma,sz", "sdx,stddev y,Sz", "sx,sy,sz", "SX,SY,SZ"]
)
def test_common_names_of_standard_deviations_are_recognised(file, names):
    records = read_csv_control(file(f"Point,X,Y,Z,{names}\nA,1,2,3,0.1,0.2,5\n"))
    assert records.sigma.tolist() == [[0.1, 0.2, 5.0]]
    assert records.extra == {}


@pytest.mark.parametrize(
    "name", ["sigma_east", "s_sigma", "sx_mm", "std_easting", "height_stddev", "roles", "role_code"]
)
def test_a_column_that_is_nearly_one_of_ours_is_not_passed_over(file, name):
    error = refused(read_csv_control, file(f"point,x,y,z,{name}\nA,1,2,3,0.1\n"))
    assert error.entity == name
    assert error.line == 1
    assert "it is not used" in error.what


@pytest.mark.parametrize("name", ["note", "gsd", "signal", "class", "Description", "source", "side", "epoch"])
def test_other_columns_are_kept(file, name):
    records = read_csv_control(file(f"point,x,y,z,{name}\nA,1,2,3,q\n"))
    assert records.extra[name].to_pylist() == ["q"]


def test_a_line_that_is_no_text_below_one_that_is_no_number_is_refused(file):
    error = refused(read_csv_image_points, file(b"image,point,x,y\nI,P,1,oops\nI,Q,1,2,\x80\n"))
    assert error.line == 3
    assert "UTF-8" in error.what


def test_lines_of_thousands_of_separators_are_no_empty_rows(file):
    error = refused(read_csv_image_points, file("image,point,x,y\nI,P,1,2\n" + ("," * 5_000 + "\n") * 3))
    assert error.line == 3
    assert "more than 4 columns" in error.what
