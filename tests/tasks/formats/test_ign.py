from __future__ import annotations

import re

import numpy as np
import pytest

from tasks.errors import InputError
from tasks.formats.ign_camera import read_ign_camera, read_ign_cameras
from tasks.formats.ign_text import read_ign_app, read_ign_mes, read_ign_opk

CAMERA = """\
<sensor>\r
<name> invented </name>\r
<usefull-frame> \r
<rect> \r
<x> 0 </x>\r
<y> 0 </y>\r
<w> 1000 </w>\r
<h> 800 </h>\r
</rect>\r
</usefull-frame>\r
<focal>\r
<pt3d> \r
<x> 510 </x>\r
<y> 390 </y>\r
<z> 20000 </z>\r
</pt3d>\r
</focal>\r
<pixel_size> 0.000004 </pixel_size>\r
</sensor>"""


@pytest.fixture
def file(tmp_path):
    def write(content, name="input.txt"):
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


def test_lines_may_end_in_blank_cr_blank_lf_and_names_in_quotation_marks(file):
    records = read_ign_mes(file(' \r\n"10 03" 23F x  1.5 2.5 \r \n'.replace("23F x", "23Fx") + "P\tI 3 4"))
    assert records.point.to_pylist() == ["10 03", "P"]
    assert records.image.to_pylist() == ["23Fx", "I"]
    assert records.xy.tolist() == [[1.5, 2.5], [3.0, 4.0]]
    assert records.line.tolist() == [2, 3]


def test_an_error_names_the_line_although_carriage_returns_stand_in_it(file):
    with pytest.raises(InputError) as raised:
        read_ign_mes(file("P I 1 2 \r \nP J 1 2 \r \nQ J 1 x \r \n"))
    assert raised.value.line == 3


def test_many_columns_too_many_in_the_first_row_are_an_error(file):
    with pytest.raises(InputError, match="more than 4 columns") as raised:
        read_ign_mes(file("P I 1 2 3 4 5 6\nP J 1 2\n"))
    assert raised.value.line == 1


def test_too_many_columns_are_an_error(file):
    with pytest.raises(InputError) as raised:
        read_ign_mes(file("P I 1 2\nP J 1 2 0.5\n"))
    assert raised.value.line == 2


def test_control_points_have_codes_that_are_kept_and_remarked(file):
    records = read_ign_app(file('"1003" 13 1.5 2.5 54.96 \r\n"1005" 3 1 2 3'))
    assert records.point.to_pylist() == ["1003", "1005"]
    assert records.position.tolist() == [[1.5, 2.5, 54.96], [1.0, 2.0, 3.0]]
    assert records.extra["code"].to_pylist() == ["13", "3"]
    assert len(records.remarks) == 1
    assert "1005 (3)" in records.remarks[0]
    assert "1003" not in records.remarks[0]


OPK_ROW = "21FDx00015_00614 1 2 3 0.1 0.2 0.3"


@pytest.mark.parametrize(
    "text",
    [
        OPK_ROW,
        OPK_ROW + " CAM\r\n",
        f"ID X Y Z O P K CAMERA\r\n{OPK_ROW} CAM\r\n",
        f"CHANTIER : test\r\nUNITE ANGLE  : degre\r\nNOM\tX\tY\tZ\tO\tP\tK\tCAMERA\r\n{OPK_ROW}     CAM",
        f"NOM X Y Z O P K\n{OPK_ROW}",
    ],
)
def test_exposures_are_read_with_and_without_header_and_camera(file, text):
    records = read_ign_opk(file(text), "omega-phi-kappa")
    assert records.image.to_pylist() == ["21FDx00015_00614"]
    assert records.position.tolist() == [[1.0, 2.0, 3.0]]
    assert records.angles.tolist() == [[0.1, 0.2, 0.3]]
    assert records.camera.to_pylist() == ["CAM" if "CAM" in text.replace("CAMERA", "") else None]
    assert (records.flight.to_pylist(), records.strip.to_pylist()) == (["21FD"], ["x00015"])
    assert records.declared_angle_unit == ("deg" if "UNITE" in text else None)
    assert records.line.tolist() == [text.count("\n", 0, text.index("21FD")) + 1]


def test_columns_follow_the_header(file):
    records = read_ign_opk(file("NOM CAMERA Z Y X K P O\nI CAM 3 2 1 6 5 4\n"), "omega-phi-kappa")
    assert records.position.tolist() == [[1.0, 2.0, 3.0]]
    assert records.angles.tolist() == [[4.0, 5.0, 6.0]]
    assert records.strip.to_pylist() == [None]


def test_a_header_without_needed_columns_is_an_error(file):
    with pytest.raises(InputError, match="lacks the column K"):
        read_ign_opk(file("NOM X Y Z O P CAMERA\nI 1 2 3 4 5 CAM\n"), "omega-phi-kappa")


@pytest.mark.parametrize(("word", "unit"), [("degre", "deg"), ("grade", "gon"), ("radian", "rad")])
def test_the_header_may_state_the_angle_unit(file, word, unit):
    text = f"UNITE ANGLE : {word}\nNOM X Y Z O P K\n{OPK_ROW}\n"
    assert read_ign_opk(file(text), "omega-phi-kappa").declared_angle_unit == unit


def test_heading_pitch_roll_is_not_what_the_format_holds(file):
    with pytest.raises(InputError, match="heading-pitch-roll"):
        read_ign_opk(file(OPK_ROW), "heading-pitch-roll")


def test_accents_of_an_older_encoding_do_not_stop_reading(file):
    text = f"CHANTIER : été\r\nNOM X Y Z O P K\r\n{OPK_ROW}\r\n".encode("latin-1")
    assert len(read_ign_opk(file(text), "omega-phi-kappa").line) == 1


def test_a_camera_is_converted_from_pixels_to_millimetres_about_the_format_centre(file):
    camera = read_ign_camera(file(CAMERA))
    assert (camera.columns, camera.rows, camera.pixel_um) == (1000, 800, 4.0)
    np.testing.assert_allclose(camera.focal_length_mm, 80.0, rtol=1e-12)
    # 10 px right of the centre and 10 px above it.
    np.testing.assert_allclose(camera.principal_point_mm, (0.04, 0.04), atol=1e-12)


@pytest.mark.parametrize(("name", "key"), [("<name> UC-f100 </name>", "UC-f100"), ("", "")])
def test_a_camera_is_known_by_the_name_in_its_file(file, name, key):
    text = re.sub("<name>.*</name>", name, CAMERA)
    assert read_ign_cameras(file(text)) == {key: read_ign_camera(file(text))}


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("</focal>", "", "not well-formed"),
        ("<z> 20000 </z>", "", "lacks a number"),
        ("20000", "long", "lacks a number"),
        ("<w> 1000", "<w> 0", "cannot be"),
        ("<w> 1000", "<w> 1000.4", "not a whole number of pixels"),
        ("<h> 800 </h>", "<h> 800 </h><h> 800 </h>", "2 elements <usefull-frame/rect/h>"),
        ("<name>", "<pixel_size> 0.000008 </pixel_size><name>", "2 elements <pixel_size>"),
        (
            "<name>",
            "<objectif> 123.9mm </objectif><name>",
            "80 mm .* differs from that of the lens, 123.9 mm",
        ),
        ("<name>", "<objectif> 40 mm </objectif><name>", "80 mm .* differs from that of the lens"),
        ("<name>", "<distortion><r3> 1.5e-09 </r3><r5> 0 </r5></distortion><name>", "has distortion"),
        ("<name>", "<doublegrid><grid_directe/></doublegrid><name>", "distortion .<doublegrid>"),
        ("<x> 0 </x>", "<x> 12 </x>", "does not begin at the corner"),
    ],
)
def test_a_camera_file_that_cannot_be_is_refused(file, old, new, what):
    with pytest.raises(InputError, match=what):
        read_ign_camera(file(CAMERA.replace(old, new)))


def test_a_distortion_of_zero_is_none(file):
    text = CAMERA.replace("<name>", "<distortion><r3> 0.0 </r3><r5> 0 </r5><r7>0</r7></distortion><name>")
    assert read_ign_camera(file(text)) == read_ign_camera(file(CAMERA))


@pytest.mark.parametrize("lens", ["80mm", "80.2 MM", "79.6mm", "Vexcel 123.9", ""])
def test_a_lens_that_agrees_or_has_no_length_raises_no_alarm(file, lens):
    assert (
        read_ign_camera(file(CAMERA.replace("<name>", f"<objectif> {lens} </objectif><name>"))).columns
        == 1000
    )


def test_a_carriage_return_alone_ends_a_line(file):
    records = read_ign_mes(file("P I 1 2\rP J 3 4\r"))
    assert records.xy.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert records.line.tolist() == [1, 2]
    exposures = read_ign_opk(file("NOM X Y Z O P K\rI 1 2 3 0 0 0\rJ 2 2 3 0 0 0\r"), "omega-phi-kappa")
    assert exposures.image.to_pylist() == ["I", "J"]


def test_a_column_named_twice_is_an_error(file):
    with pytest.raises(InputError, match="contains the column 'X' twice") as raised:
        read_ign_opk(file("ID X Y Z O P K X\n1 1 2 3 0 0 0 4\n"), "omega-phi-kappa")
    assert raised.value.line == 1


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("0.000004", "1e-300"),
        ("0.000004", "1e300"),
        ("0.000004", "4_0e-6"),
        ("20000", "1e-300"),
        ("20000", "1e19"),
        ("20000", "9" * 400),
    ],
)
def test_a_camera_of_an_impossible_size_is_refused(file, old, new):
    with pytest.raises(InputError, match="camera file") as raised:
        read_ign_camera(file(CAMERA.replace(old, new), "camera.xml"))
    assert len(str(raised.value)) < 500
