"""PATB, BINGO, Inpho, ISAT and the text exports of other programs, from small files with known content."""

from __future__ import annotations

import numpy as np
import pyproj
import pytest

from adjust.geometry.rotation import about_x, about_y, about_z, from_omega_phi_kappa
from tasks.errors import InputError
from tasks.formats import blocks_exchange, bundler, inpho, isat, metashape, opensfm, pix4d, realityscan
from tasks.formats.bingo import read_bingo_control, read_bingo_orientations
from tasks.formats.native_csv import read_csv_cameras
from tasks.formats.patb import read_patb_control, read_patb_orientations
from tasks.formats.photo_lists import read_photo_lists

ORDER = "omega-phi-kappa"


@pytest.fixture
def file(tmp_path):
    def write(text, name="file.txt"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def refused(reader, *arguments):
    with pytest.raises(InputError) as raised:
        reader(*arguments)
    assert raised.value.remedy
    return raised.value


# Numbers of a record of PATB as a page of another program prints it (formats.md 1.3).
PATB = """\
           10203      0.00000000    712190.65866     -5421.70427      2141.64057
 -0.998826566538 -0.043032486871 -0.022219249579  0.044887436532 -0.994826584290
 -0.091132789002 -0.018182629618 -0.092023215893  0.995590839510
"""


def test_orientations_of_patb_are_rotations_ground_from_camera(file):
    records = read_patb_orientations(file(PATB), ORDER)
    assert records.image.to_pylist() == ["10203"]
    assert records.position.tolist() == [[712190.65866, -5421.70427, 2141.64057]]
    rotation = from_omega_phi_kappa(np.radians(records.angles[0]))
    np.testing.assert_allclose(rotation[0], [-0.998826566538, -0.043032486871, -0.022219249579], atol=1e-11)
    assert abs(abs(records.angles[0, 2]) - 177.5) < 0.1
    # The spare field may be blank, and long numbers may leave no blank between the columns.
    blank = PATB.replace("     0.00000000", " " * 15)
    assert read_patb_orientations(file(blank), ORDER).position.tolist() == records.position.tolist()
    joined = PATB.replace("     -5421.70427", "-5304421.704270 ")
    assert read_patb_orientations(file(joined), ORDER).position[0, 1] == -5304421.70427


@pytest.mark.parametrize(
    ("old", "new", "said", "line"),
    [
        ("  0.995590839510\n", "\n", "3 fields", 3),
        ("0.044887436532", "0.000000000000", "not a rotation", 1),
        (" -0.018182629618", " 0.0l8182629618", "is not a number", 3),
        (PATB.split("\n")[2] + "\n", "", "every image needs three", 2),
    ],
)
def test_damaged_orientations_of_patb_are_named(file, old, new, said, line):
    error = refused(read_patb_orientations, file(PATB.replace(old, new)), ORDER)
    assert said in error.what
    assert error.line == line


def test_lists_of_image_points_end_with_minus_99(file):
    text = (
        "  1001  120000.000\n 5000001 -34210.4 12988.7\n 5000002 10233.1 -20871.9 1\n -99\n"
        "# next\n\nIMG#1 2 CAM # camera\nT#1 1 2 #3\n"
    )
    records = read_photo_lists(file(text))
    assert records.image.to_pylist() == ["1001", "1001", "IMG#1"]
    assert records.point.to_pylist() == ["5000001", "5000002", "T#1"]
    assert records.xy.tolist() == [[-34210.4, 12988.7], [10233.1, -20871.9], [1.0, 2.0]]
    assert records.line.tolist() == [2, 3, 8]
    error = refused(read_photo_lists, file("1001\n1 2 3\n1002\n1 2 3\n-99\n"))
    assert error.line == 3
    assert "-99" in error.remedy


def test_control_of_patb_is_known_in_plan_height_or_both(file):
    records = read_patb_control(file("A 1.5 2.5 1\nB 3 4\nF 7 8 9.5\n-99\nA 10.25 1\nH 20\n-99\n"))
    assert records.point.to_pylist() == ["A", "B", "F", "H"]
    np.testing.assert_array_equal(
        records.position,
        [[1.5, 2.5, 10.25], [3, 4, np.nan], [7, 8, 9.5], [np.nan, np.nan, 20.0]],
    )
    assert "2 points known in X, Y and Z, 1 in X and Y, 1 in Z" in records.remarks[0]


@pytest.mark.parametrize(
    ("text", "said", "line"),
    [
        ("A 1 2\nA 1 2\n-99\n", "twice", 2),
        ("A 1 2 3.5\n-99\nA 4.5\n-99\n", "a height in both", 3),
        # A height with its σ was a position 412.5, 0.02, and moved a point that had another one.
        ("A 1 2\n-99\nA 412.5 0.02\n-99\n", "2 coordinates in a list of heights", 3),
        # Nothing tells a height of 12 m from a group.
        ("A 500123.1 5300456.2 12\nB 500124.1 5300457.2 8\n-99\n", "The third number, 12, may be", 1),
        ("A 500123.1 5300456.2 112\nB 500124.1 5300457.2 98\n-99\n", "The third number, 98, may be", 2),
    ],
)
def test_control_of_patb_that_can_mean_two_things_is_refused(file, text, said, line):
    error = refused(read_patb_control, file(text))
    assert said in error.what
    assert error.line == line


def test_groups_of_control_of_patb_are_no_heights(file):
    lists = "A 1.5 2.5 1\nB 3 4 12\n-99\nA 10.25 1\n-99\n"
    nan = np.nan
    np.testing.assert_array_equal(read_patb_control(file(lists)).position, [[1.5, 2.5, 10.25], [3, 4, nan]])
    full = "A 1.5 2.5 12 1\nB 3 4 1\nC 5\n-99\n-99\nD 7 8\n-99\n"
    np.testing.assert_array_equal(
        read_patb_control(file(full)).position, [[1.5, 2.5, 12], [3, 4, nan], [nan, nan, 5], [7, 8, nan]]
    )


def test_orientations_of_bingo_are_in_the_declared_order(file):
    path = file("ORIA 17 500.5 600.5 1000.25 1.5 2.5 100.0 CAM1\nCORD 1 2 3 4\n")
    records = read_bingo_orientations(path, "phi-omega-kappa")
    # Angles of records are ω, φ, κ in every order.
    assert records.angles.tolist() == [[2.5, 1.5, 100.0]]
    assert records.camera.to_pylist() == ["CAM1"]
    assert read_bingo_orientations(path, ORDER).angles.tolist() == [[1.5, 2.5, 100.0]]
    assert "phi-omega-kappa" in refused(read_bingo_orientations, path, "heading-pitch-roll").remedy


def test_control_and_check_points_of_bingo(file):
    text = (
        "CAPA CAM1 0 100.5 0.001 -0.03\nCONT 2001 500123.412 5300456.789 412.334\n"
        "* CONT 9 1 2 3\nCHCK 2002 1 2 3\n"
    )
    records = read_bingo_control(file(text))
    assert records.point.to_pylist() == ["2001", "2002"]
    assert records.role.to_pylist() == ["control", "check"]
    assert records.remarks == ("file.txt: not taken over: CAPA.",)
    more = text.replace("412.334", "412.334 0.02 0.03") + "ECCA CAM1 0 0 1\nC CONT 8 1 2 3\n"
    assert read_bingo_control(file(more)).remarks == (
        "file.txt: not taken over: CAPA, fields behind E, N, H, ECCA.",
    )
    assert refused(read_bingo_control, file("CONT 1 2 3\n")).line == 1


INPHO = """\
$PROJECT 15.0.0
  $PROJECT_NAME : a b
  $COORDINATE_SYSTEM :
    PROJCS["x"]
  $END_COORDINATE_SYSTEM
$END
$CAMERA_DEFINITION
  $ID : UC\\ Xp
  $ACTIVE_CALIBRATION : b
  $CALIBRATION_SET
    $ID : a
    $FOCAL_LENGTH : 99.0
  $END
  $CALIBRATION_SET
    $ID : b
    $FOCAL_LENGTH : 100.5
    $PRINCIPAL_POINT_PPA : 0.01 -0.02
  $END
  $CCD_COLUMNS : 1001
  $CCD_ROWS : 801
  $CCD_INTERIOR_ORIENTATION :
    200.0 0 500.0
    0 -200.0 400.0
  $RADIAL_COEFFS : 0 0 0 0
    0 0 0 0
$END
$PHOTO
  $PHOTO_NUM : 1_0001
  $CAMERA_ID : UC\\ Xp
  $EXT_ORI : 12:00:00 01/06/2025
   100.500000  500123.4120  5300456.7890  2430.1230
     0.999390827   0.034899497   0.000000000
    -0.034899497   0.999390827   0.000000000
     0.000000000   0.000000000   1.000000000
  $PHOTO_POINTS :
    t\\ 1 10.5 20.25 1.00 2 { * }
    t2 11 21 1.00 2 { * }
  $END_POINTS
$END
$CONTROL_POINTS
  c1 1.0 2.0 3.0 HV 0 0 0
$END_POINTS
"""


def test_a_project_of_inpho_is_read(file):
    path = file(INPHO)
    exposures = inpho.read_inpho_exposures(path, ORDER)
    # The sample of formats.md: camera from ground of κ = +2°.
    np.testing.assert_allclose(exposures.angles, [[0.0, 0.0, 2.0]], atol=1e-7)
    assert exposures.camera.to_pylist() == ["UC Xp"]
    assert exposures.states.crs == 'PROJCS["x"]'
    points = inpho.read_inpho_image_points(path)
    assert points.point.to_pylist() == ["t 1", "t2"]
    assert points.xy.tolist() == [[10.5, 20.25], [11.0, 21.0]]
    assert inpho.read_inpho_control(path).position.tolist() == [[1.0, 2.0, 3.0]]
    (camera,) = inpho.read_inpho_cameras(path).values()
    assert (camera.columns, camera.rows, camera.pixel_um, camera.focal_length_mm) == (1001, 801, 5.0, 100.5)
    assert camera.principal_point_mm == (0.01, -0.02)


def test_what_is_not_taken_over_of_a_project_of_inpho_is_said_once(file):
    assert inpho.read_inpho_exposures(file(INPHO), ORDER).remarks == ()
    more = (
        INPHO.replace("  $COORDINATE_SYSTEM", "  $CURV_CORR_DEFAULT : on\n  $COORDINATE_SYSTEM")
        .replace(
            "    $FOCAL_LENGTH : 100.5", "    $FOCAL_LENGTH : 100.5\n    $GPS_ANTENNA_OFFSET : 0.0 0.1 -0.2"
        )
        .replace("  $CCD_ROWS", "  $CAMERA_MOUNT_ROTATION : 0.000000\n  $CCD_ROWS")
    )
    more += (
        "$PHOTO\n  $PHOTO_NUM : 9\n$END\n$PHOTO\n  $PHOTO_NUM : 10\n$END\n"
        "$NAVIGATION\n  $PHOTO_NUM : 9\n  $GPS : 1 2 3\n$ENDNAV\n$DESCRIPTIONS\n 0 Undefined\n$END\n"
    )
    records = inpho.read_inpho_exposures(file(more), ORDER)
    assert records.image.to_pylist() == ["1_0001"]
    assert records.remarks == (
        "file.txt: not taken over: $CURV_CORR_DEFAULT : on, $GPS_ANTENNA_OFFSET, "
        "$PHOTO without $EXT_ORI (2), $NAVIGATION, $DESCRIPTIONS.",
    )
    assert inpho.read_inpho_control(file(INPHO)).remarks == ("file.txt: not taken over: type HV.",)


def test_terms_of_distortion_that_are_not_read_are_refused_unless_zero(file):
    sensor = (
        '<document><chunk><sensors><sensor id="0" label="S"><calibration class="adjusted">'
        '<resolution width="100" height="80"/><f>100</f><k1>0.1</k1><{0}>{1}</{0}></calibration></sensor>'
        "</sensors></chunk></document>"
    )
    for term in ("p3", "p4", "skew"):
        assert f"has {term}" in refused(metashape.read_metashape_cameras, file(sensor.format(term, 0.5))).what
        known = metashape.read_metashape_cameras(file(sensor.format(term, 0)))["S"].additional_parameters
        assert known == {"brown-forward:k1": 0.1}
    block = BLOCKS.format(srs="EPSG:25832", axes="XRightYUp", rotation=ANGLES)
    more = file(block.replace("<K1>", "<K4>0.001</K4><K1>"))
    assert "has K4" in refused(blocks_exchange.read_blocks_cameras, more).what
    blocks_exchange.read_blocks_cameras(file(block.replace("<K1>", "<K4>0</K4><K1>")))
    head = "camera,columns,rows,pixel_um,focal_length_mm,x0_mm,y0_mm,K1,p_2,remark\n"
    zero = read_csv_cameras(file(head + "C,100,80,5,100,0,0,0.0,0.00E+00,new\n"))
    assert zero["C"].focal_length_mm == 100.0
    error = refused(read_csv_cameras, file(head + "C,100,80,5,100,0,0,0,,\nD,100,80,5,100,0,0,,-1e-9,\n"))
    assert "'p_2'" in error.what
    assert error.line == 3


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("$CCD_ROWS : 801", "$CCD_ROWS : 801\n  $DISTORTION_TYPE : Grid", "of the type 'Grid'"),
        ("$RADIAL_COEFFS : 0 0 0 0", "$RADIAL_COEFFS : 0 1e-9 0 0", "distortion"),
        ("200.0 0 500.0\n    0 -200.0 400.0", "0 200.0 500.0\n    200.0 0 400.0", "not x right, y up"),
        ("$CCD_ROWS : 801\n", "", "lacks $CCD_ROWS"),
    ],
)
def test_cameras_of_inpho_that_are_not_read_are_refused(file, old, new, said):
    assert said in refused(inpho.read_inpho_cameras, file(INPHO.replace(old, new))).what


def test_a_project_of_inpho_that_was_cut_off_is_refused(file):
    assert (
        "does not end"
        in refused(inpho.read_inpho_exposures, file(INPHO[: INPHO.index("$PHOTO_POINTS")]), ORDER).what
    )


def test_a_camera_of_an_older_inpho_project_is_called_by_its_type(file):
    """A published project has such a block: 5 pixels beside the middle, sides of a pixel 5e-6 apart."""
    text = """\
$CAMERA
  $TYPE : iXU_(50mm)
  $KIND : CCDFrame
  $CCD_INTERIOR_ORIENTATION :
     217.3924 -0.0 5798.5
       0.0 -217.3914 4358.0
  $CCD_COLUMNS : 11608
  $CCD_ROWS : 8708
  $PIXEL_REFERENCE : CenterTopLeft
  $FOCAL_LENGTH : 51.7
  $PRINCIPAL_POINT_PPA : 0.0 0.0
$END
"""
    ((name, camera),) = inpho.read_inpho_cameras(file(text)).items()
    assert name == "iXU_(50mm)"
    assert camera.pixel_um == pytest.approx(1e3 / 217.3919)
    assert camera.principal_point_mm == pytest.approx((-5.0 / 217.3919, -4.5 / 217.3919))
    far = refused(inpho.read_inpho_cameras, file(text.replace("5798.5", "4353.5")))
    assert "the interior orientation" in far.what.lower()
    oblong = refused(inpho.read_inpho_cameras, file(text.replace("-217.3914", "-217.4")))
    assert "square pixels" in oblong.what


INPHO_15 = """\
$PROJECT 15.0.0
  $ANGULAR_UNITS : deg
$END
$COORDINATE_SYSTEM_SET
  $ID : UTM 32
  $COORDINATE_SYSTEM : PROJCS["UTM32",AUTHORITY["EPSG","25832"]]
$END_COORDINATE_SYSTEM
$CAMERA_DEFINITION
  $ID : LE
  $CCD_COLUMNS : 101
  $CCD_ROWS : 81
  $ACTIVE_CALIBRATION : 2
  $CALIBRATION_SET :
    $ID : 1
    $CCD_INTERIOR_ORIENTATION :
      10 0 50
      0 -10 40
    $FOCAL_LENGTH : 123
    $PRINCIPAL_POINT_PPA : 0 0
    $END
    $ID : 2
    $CCD_INTERIOR_ORIENTATION :
      10 0 50
      0 -10 40
    $FOCAL_LENGTH : 124
    $PRINCIPAL_POINT_PPA : 0 0
    $END
  $END
$END
$PHOTO
  $PHOTO_NUM : LE_01
  $CAMERA_ID : LE
  $EXT_ORI : 12:00:00 01/01/2026
    124 380000 5680000 1000
    1 0 0
    0 1 0
    0 0 1
$END
$MULTIHEADSYSTEM
  $HEAD_DATASET :
    $ID : 1
    $HEADS :
      LE 1 left LE
    $END_HEADS
  $END
$END
"""


def test_calibrations_and_systems_of_a_newer_inpho_project_are_read(file):
    """As two public programs read and fill such projects; theirs ends the set of systems by this name."""
    ((name, camera),) = inpho.read_inpho_cameras(file(INPHO_15)).items()
    assert (name, camera.focal_length_mm) == ("LE", 124.0)
    found = inpho.read_inpho_exposures(file(INPHO_15), ORDER)
    assert found.image.to_pylist() == ["LE_01"]
    assert found.camera.to_pylist() == ["LE"]
    assert found.states.crs == 'PROJCS["UTM32",AUTHORITY["EPSG","25832"]]'
    assert found.remarks == ("file.txt: not taken over: $MULTIHEADSYSTEM.",)
    system = INPHO_15[INPHO_15.index("  $ID : UTM 32") : INPHO_15.index("$END_COORDINATE_SYSTEM")]
    two = INPHO_15.replace(system, system + system.replace("32", "33"))
    assert inpho.read_inpho_exposures(file(two), ORDER).states.crs is None


def test_points_of_an_inpho_project_that_are_no_pixels_are_refused(file):
    """A public reader of a film project divides them by the size of a pixel: mm from the middle."""
    text = (
        "$PHOTO\n $PHOTO_NUM : a\n $PHOTO_POINTS :\n  p 12.5 -0.4\n  q -34.2 12.1 1 2\n $END_POINTS\n$END\n"
    )
    error = refused(inpho.read_inpho_image_points, file(text))
    assert "(-34.2, 12.1)" in error.what
    assert error.line == 5
    assert inpho.read_inpho_image_points(file(text.replace("-34.2", "34.2"))).xy[0].tolist() == [12.5, -0.4]


ISAT = """\
begin photo_parameters 1_0001\tstrip_id 1
 camera_name: DMC2_27
 EO_parameters\t500123.412 5300456.789 2430.123 0.01234 -0.22310 89.76540
 COMPUTED_std_devs: 0.021 0.020 0.030 0.0004 0.0004 0.0006
end photo_parameters
begin photo_measurements 1_0001
 1 2 3
end photo_measurements
"""


def test_photos_of_isat_are_read_with_or_without_colons(file):
    records = isat.read_isat_exposures(file(ISAT), ORDER)
    assert records.angles.tolist() == [[0.01234, -0.2231, 89.7654]]
    assert records.strip.to_pylist() == ["1"]
    described = file(ISAT.replace("strip_id", "stripid"))
    assert isat.read_isat_exposures(described, ORDER).strip.to_pylist() == ["1"]
    assert records.sigma_position.tolist() == [[0.021, 0.02, 0.03]]
    assert records.remarks == ("file.txt: not taken over: photo_measurements.",)
    more = ISAT.replace(" camera_name", " camera_orientation: 90\n image_id: a b\n camera_name")
    assert isat.read_isat_exposures(file(more * 2), ORDER).remarks == (
        "file.txt: not taken over: camera_orientation (2), photo_measurements (2).",
    )
    assert (
        "lacks eo_parameters"
        in refused(isat.read_isat_exposures, file(ISAT.replace("EO_parameters", "XX")), ORDER).what
    )
    control = isat.read_isat_control(file("begin control_points\n A 1 2 3 HV\nend control_points\n"))
    assert control.position.tolist() == [[1.0, 2.0, 3.0]]
    assert control.remarks == ("file.txt: not taken over: fields behind X, Y, Z.",)


def test_a_distortion_table_of_isat_is_refused(file):
    text = (
        "begin camera_parameters C\n focal_length: 100\n ppac: 0 0\n pixel_size: 5\n"
        " image_size_in_pixels: 10 8\n lens_distortion_flag: on\n distortions: 0 1.5\nend camera_parameters\n"
    )
    assert "distortion" in refused(isat.read_isat_cameras, file(text)).what
    assert isat.read_isat_cameras(file(text.replace("flag: on", "flag: off")))["C"].pixel_um == 5.0


def test_a_camera_of_isat_that_is_turned_against_its_image_is_refused(file):
    """Pix4D writes rows before columns, and this code for the axes; the codes are not published."""
    text = (
        "begin camera_parameters D_15.0_4608x3456 (RGB)(1)\n focal_length: 15\n ppac: 0.03 -0.02\n"
        " pixel_size: 3.8 3.8\n image_size_in_pixels: 3456 4608\n scanline_orientation: 4\n"
        " photo_coord_sys_orientation: 1\nend camera_parameters\n"
    )
    error = refused(isat.read_isat_cameras, file(text))
    assert "photo_coord_sys_orientation 1" in error.what
    assert "3456 and 4608" in error.what
    assert error.line == 7


def test_a_csv_of_realityscan_may_count_its_cameras_and_call_heights_z(file):
    """Four public programs read or write these heads."""
    text = "#cameras 2\n#name,x,y,z,heading,pitch,roll,f\na.tif,1,2,3,-89.7,0,0,30\nb.tif,4,5,6,0,0,0,30\n"
    found = realityscan.read_realityscan_exposures(file(text), ORDER)
    assert found.position.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    np.testing.assert_allclose(found.angles, [[0.0, 0.0, 89.7], [0.0, 0.0, 0.0]], atol=1e-9)
    assert found.line.tolist() == [3, 4]
    cut = refused(realityscan.read_realityscan_exposures, file(text.replace("cameras 2", "cameras 3")), ORDER)
    assert "2 images, but its first line counts 3" in cut.what


def test_calibrated_parameters_of_pix4d(file):
    text = (
        "imageName X Y Z Omega Phi Kappa\nIMG 1.JPG 500123.41201 5300456.789 2430.12 0.0123 -0.2231 89.7654\n"
    )
    records = pix4d.read_pix4d_exposures(file(text), ORDER)
    assert records.image.to_pylist() == ["IMG 1.JPG"]
    assert records.angles.tolist() == [[0.0123, -0.2231, 89.7654]]
    assert refused(pix4d.read_pix4d_exposures, file(text.replace("Omega Phi", "Phi Omega")), ORDER).line == 1


def test_the_row_of_realityscan_is_the_photo_of_the_other_formats(file):
    """One photo in the angles of both (receivers.md 5.6)."""
    text = (
        "#name,x,y,alt,heading,pitch,roll,f,px,py\n"
        "1_0001.tif,123.412,456.789,2030.123,-89.7653503,-0.2230478,-0.0132135,27.14,0,0\n"
    )
    records = realityscan.read_realityscan_exposures(file(text), ORDER)
    np.testing.assert_allclose(records.angles, [[0.0123, -0.2231, 89.7654]], atol=2e-7)


def test_bundler_is_camera_from_world_in_our_axes(file):
    rotation = about_x(0.1) @ about_y(-0.2) @ about_z(2.0)
    centre = np.array([10.0, 20.0, 30.0])
    rows = ["# Bundle file v0.3", "2 1", *["0 0 0"] * 5, "500 0 0"]
    rows += [" ".join(map(repr, row.tolist())) for row in (*rotation.T, -rotation.T @ centre)]
    rows += ["1 2 3", "255 0 0", "2 0 7 1.5 -2.5 1 8 3 4"]
    path = file("\n".join(rows) + "\n")
    records = bundler.read_bundler_exposures(path, ORDER)
    assert records.image.to_pylist() == ["1"]
    np.testing.assert_allclose(records.position, [centre], atol=1e-12)
    np.testing.assert_allclose(np.radians(records.angles), [[0.1, -0.2, 2.0]], atol=1e-12)
    points = bundler.read_bundler_image_points(path)
    assert points.image.to_pylist() == ["0", "1"]
    assert points.xy.tolist() == [[1.5, -2.5], [3.0, 4.0]]
    assert "too few" in refused(bundler.read_bundler_exposures, file("# Bundle file v0.3\n9 1\n"), ORDER).what


BLOCKS = """\
<BlocksExchange version="2.1"><SpatialReferenceSystems><SRS><Id>0</Id><Definition>{srs}</Definition></SRS>
</SpatialReferenceSystems><Block><SRSId>0</SRSId><Photogroups><Photogroup><Name>UC</Name>
<ImageDimensions><Width>1000</Width><Height>800</Height></ImageDimensions><SensorSize>50</SensorSize>
<FocalLength>100</FocalLength><CameraOrientation>{axes}</CameraOrientation>
<PrincipalPoint><x>500.5</x><y>399.5</y></PrincipalPoint>
<Distortion><K1>-0.1</K1><P1>0.001</P1><P2>0.002</P2></Distortion>
<Photo><Id>7</Id><ImagePath>D:\\img\\a.tif</ImagePath><Pose><Rotation>{rotation}</Rotation>
<Center><x>10</x><y>20</y><z>30</z></Center></Pose></Photo>
<Photo><Id>8</Id><ImagePath>b.tif</ImagePath><Component>0</Component></Photo></Photogroup></Photogroups>
<ControlPoints><ControlPoint><SRSId>0</SRSId><Name>g1</Name><Category>Horizontal</Category>
<Position><x>1</x><y>2</y></Position><HorizontalAccuracy>0.02</HorizontalAccuracy><CheckPoint>true</CheckPoint>
<Measurement><PhotoId>7</PhotoId><x>5</x><y>6</y></Measurement></ControlPoint></ControlPoints>
<TiePoints><TiePoint><Measurement><PhotoId>8</PhotoId><x>1.5</x><y>2.5</y></Measurement></TiePoint></TiePoints>
</Block></BlocksExchange>"""
ANGLES = "<Omega>0.0123</Omega><Phi>-0.2231</Phi><Kappa>89.7654</Kappa>"


def blocks(file, rotation=ANGLES, axes="XRightYUp", srs="EPSG:32632"):
    return file(BLOCKS.format(rotation=rotation, axes=axes, srs=srs))


@pytest.mark.parametrize("version", ["WKT1_GDAL", "WKT2_2019"])
def test_a_crs_with_heights_is_stated(file, version):
    text = pyproj.CRS("EPSG:25832+7837").to_wkt(version)
    assert blocks_exchange.read_blocks_exposures(blocks(file, srs=text), ORDER).states.crs == text
    project = INPHO.replace('PROJCS["x"]', text)
    assert inpho.read_inpho_exposures(file(project), ORDER).states.crs == text
    assert inpho.read_inpho_control(file(project)).states.crs == text


def test_a_block_in_our_axes_has_the_angles_that_stand_there(file):
    records = blocks_exchange.read_blocks_exposures(blocks(file), ORDER)
    assert records.image.to_pylist() == ["a.tif"]
    np.testing.assert_allclose(records.angles, [[0.0123, -0.2231, 89.7654]], atol=1e-10)
    assert records.states.crs == "EPSG:32632"


def test_a_reference_system_counts_for_all_that_states_no_other(file):
    """As the makers describe it: a point, the list of points, the group or the block names it."""
    other = "<SRS><Id>1</Id><Definition>EPSG:25833</Definition></SRS></SpatialReferenceSystems>"
    text = BLOCKS.format(srs="EPSG:32632", axes="XRightYUp", rotation=ANGLES)
    text = text.replace("</SpatialReferenceSystems>", other)
    of_block = text.replace("<ControlPoint><SRSId>0</SRSId>", "<ControlPoint>")
    of_list = of_block.replace("<ControlPoints>", "<ControlPoints><SRSId>1</SRSId>")
    assert blocks_exchange.read_blocks_control(file(of_block)).states.crs == "EPSG:32632"
    assert blocks_exchange.read_blocks_control(file(of_list)).states.crs == "EPSG:25833"
    of_group = text.replace("<Photogroup>", "<Photogroup><SRSId>1</SRSId>")
    assert blocks_exchange.read_blocks_exposures(file(of_group), ORDER).states.crs == "EPSG:25833"
    group = of_group[of_group.index("<Photogroup>") : of_group.index("</Photogroups>")]
    group = group.replace("<SRSId>1</SRSId>", "").replace(">UC<", ">D<").replace("a.tif", "c.tif")
    two = file(of_group.replace("</Photogroups>", group + "</Photogroups>"))
    assert "several reference systems" in refused(blocks_exchange.read_blocks_exposures, two, ORDER).what


def test_tie_points_in_another_file_are_not_left_out_silently(file):
    text = BLOCKS.format(srs="EPSG:32632", axes="XRightYUp", rotation=ANGLES)
    head, tail = text.split("<TiePoints>")
    path = file(f"{head}<TiePoints><Path>TiePoints.xml</Path></TiePoints>{tail.split('</TiePoints>')[1]}")
    assert "'TiePoints.xml'" in refused(blocks_exchange.read_blocks_image_points, path).what


@pytest.mark.parametrize(
    ("axes", "in_ours"),
    [
        ("XRightYDown", np.diag([1.0, -1.0, -1.0])),
        ("XLeftYDown", np.diag([-1.0, -1.0, 1.0])),
        ("XDownYRight", np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])),
    ],
)
def test_a_block_in_other_axes_is_turned(file, axes, in_ours):
    rotation = from_omega_phi_kappa(np.radians([0.0123, -0.2231, 89.7654]))
    # World → camera, in the axes of the camera: columns of `in_ours` are its axes in ours.
    matrix = (rotation @ in_ours).T
    text = "".join(f"<M_{i}{j}>{matrix[i, j]!r}</M_{i}{j}>".replace("np.float64(", "").replace(")<", "<")
                   for i in range(3) for j in range(3))  # fmt: skip
    records = blocks_exchange.read_blocks_exposures(blocks(file, text, axes), ORDER)
    np.testing.assert_allclose(records.angles, [[0.0123, -0.2231, 89.7654]], atol=1e-10)


def test_a_block_east_north_up_of_a_place_is_put_on_the_earth(file):
    records = blocks_exchange.read_blocks_exposures(blocks(file, srs="ENU:47.5,9.25"), ORDER)
    longitude, latitude, height = records.position[0]
    assert (longitude - 9.25) * 111_412.0 * np.cos(np.radians(47.5)) == pytest.approx(10.0, abs=0.05)
    assert (latitude - 47.5) * 111_180.0 == pytest.approx(20.0, abs=0.05)
    assert height == pytest.approx(30.0, abs=1e-3)
    assert records.states.reference == "true-north"


def test_camera_control_and_measurements_of_a_block(file):
    path = blocks(file)
    camera = blocks_exchange.read_blocks_cameras(path)["UC"]
    assert camera.focal_length_px == 2000.0
    # The centre of the image is (499.5, 399.5) from the centre of the first pixel.
    assert camera.principal_point_px == (1.0, 0.0)
    assert camera.additional_parameters == {
        "brown-forward:k1": -0.1, "brown-forward:p2": 0.001, "brown-forward:p1": 0.002,
    }  # fmt: skip
    control = blocks_exchange.read_blocks_control(path)
    np.testing.assert_array_equal(control.position, [[1.0, 2.0, np.nan]])
    np.testing.assert_array_equal(control.sigma, [[0.02, 0.02, np.nan]])
    assert control.role.to_pylist() == ["check"]
    for text, role in (("1", "check"), ("false", "control"), ("0", "control")):
        other = file(path.read_text().replace("<CheckPoint>true", f"<CheckPoint>{text}"), "b.xml")
        assert blocks_exchange.read_blocks_control(other).role.to_pylist() == [role]
    points = blocks_exchange.read_blocks_image_points(path)
    assert points.point.to_pylist() == ["g1", "tie1"]
    assert points.image.to_pylist() == ["a.tif", "b.tif"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"rotation": "<Heading>1</Heading><Pitch>0</Pitch><Roll>0</Roll>"}, "not published"),
        ({"axes": "XRightYLeft"}, "does not exist"),
        ({"srs": "/some/file.prj"}, "is not supported"),
        ({"rotation": "<M_00>1</M_00>"}, "<M_01>"),
    ],
)
def test_blocks_that_are_not_read_are_refused(file, change, said):
    assert said in refused(blocks_exchange.read_blocks_exposures, blocks(file, **change), ORDER).what


MARKERS = """\
<document><chunk><cameras><camera id="0" label="a"/><camera id="1" label="b"/></cameras><markers>
<marker id="0" label="g1"><reference x="1" y="2" z="3" enabled="true"/></marker>
<marker id="1" label="g2"><reference x="4" y="5" z="6" enabled="false"/></marker>
<marker id="2" label="tie"/></markers><frames><frame id="0"><markers><marker marker_id="0">
<location camera_id="0" pinned="true" x="10.5" y="20.5"/><location camera_id="1" pinned="false" x="1" y="2"/>
</marker></markers></frame></frames></chunk></document>"""


def test_only_measurements_of_metashape_that_somebody_made_are_read(file):
    points = metashape.read_metashape_measurements(file(MARKERS))
    assert list(zip(points.point.to_pylist(), points.image.to_pylist(), strict=True)) == [("g1", "a")]
    assert points.xy.tolist() == [[10.5, 20.5]]
    control = metashape.read_metashape_markers(file(MARKERS))
    assert control.point.to_pylist() == ["g1", "g2"]
    assert control.role.to_pylist() == ["control", "check"]


def test_accuracies_of_markers_are_read_in_all_their_spellings(file):
    text = MARKERS.replace('z="3"', 'z="3" sxy="0.02" sz="0.04"').replace('z="6"', 'z="6" sx="0.1" sy="0.2"')
    sigma = metashape.read_metashape_markers(file(text)).sigma
    np.testing.assert_array_equal(sigma, [[0.02, 0.02, 0.04], [0.1, 0.2, np.nan]])
    sigma = metashape.read_metashape_markers(file(MARKERS.replace('z="3"', 'z="3" sxyz="0.5"'))).sigma
    np.testing.assert_array_equal(sigma[0], [0.5, 0.5, 0.5])


PHOTOSCAN = """\
<document version="1.2.0"><chunks><chunk><sensors><sensor id="0" label="S" type="frame">
<resolution width="100" height="80"/><calibration><fx>202</fx><fy>200</fy><cx>51.5</cx><cy>39</cy>
<skew>0.5</skew><p1>0.001</p1><p2>0.002</p2></calibration></sensor></sensors><cameras>
<camera id="0" sensor_id="0" label="a"><transform>1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1</transform></camera>
</cameras><transform><rotation>0 1 0 1 0 0 0 0 -1</rotation><translation>1000000 110000 1910</translation>
<scale>192</scale></transform></chunk></chunks></document>"""


def test_a_calibration_of_photoscan_counts_from_the_corner_and_has_the_terms_of_opencv(file):
    (camera,) = metashape.read_metashape_cameras(file(PHOTOSCAN)).values()
    assert (camera.focal_length_px, camera.principal_point_px) == (200.0, (1.5, 1.0))
    values = {key.split(":")[1]: value for key, value in camera.additional_parameters.items()}
    assert values == pytest.approx({"p1": 0.001, "p2": 0.002, "b1": 0.01, "b2": 0.0025})
    bare = PHOTOSCAN.replace("<cx>51.5</cx><cy>39</cy>", "")
    (camera,) = metashape.read_metashape_cameras(file(bare)).values()
    assert camera.principal_point_px == (0.0, 0.0)


def test_a_saved_calibration_of_metashape_is_a_camera_of_its_own(file):
    text = """<?xml version="1.0" encoding="UTF-8"?><calibration><projection>frame</projection>
    <width>100</width><height>80</height><f>200</f><cx>1.5</cx><cy>-2</cy><p1>0.001</p1>
    <date>2022-05-25T13:33:33Z</date></calibration>"""
    ((name, camera),) = metashape.read_metashape_cameras(file(text)).items()
    assert name == "file"
    assert (camera.columns, camera.rows, camera.focal_length_px) == (100, 80, 200.0)
    assert camera.principal_point_px == (1.5, 2.0)
    assert camera.additional_parameters == {"brown-forward:p2": 0.001}
    fisheye = refused(metashape.read_metashape_cameras, file(text.replace("frame", "fisheye")))
    assert "of the type 'fisheye'" in fisheye.what


@pytest.mark.parametrize("reference", ["", '<reference>LOCAL_CS["Local Coordinates (m)"]</reference>'])
def test_a_transform_that_does_not_lead_to_the_earth_is_local(file, reference):
    found = metashape.read_metashape_exposures(
        file(PHOTOSCAN.replace("</chunk>", reference + "</chunk>")), "omega-phi-kappa"
    )
    assert (found.states.crs, found.states.reference) == ("local", None)
    np.testing.assert_allclose(found.position, [[1_000_000.0, 110_192.0, 1910.0]])
    # x right and y down of the image are north and east; it looks down.
    np.testing.assert_allclose(found.angles, [[0.0, 0.0, 90.0]], atol=1e-9)


def test_check_points_and_heights_that_are_not_known_in_a_gcp_list(file):
    text = (
        "EPSG:25832\n# remark\n500123.412 5300456.789 412.334 4012.6 3001.2 a.tif 2001\n"
        "500623.1 5300956.021 NaN 1210.4 2977.9 b.tif CHK-2002\n"
    )
    control = opensfm.read_odm_control(file(text))
    assert control.role.to_pylist() == ["control", "check"]
    np.testing.assert_array_equal(control.position[1], [500623.1, 5300956.021, np.nan])
    other = text + "1 2 3 4 5 c.tif 2001\n"
    assert "other coordinates in line 3" in refused(opensfm.read_odm_control, file(other)).what
    assert "state a CRS" in refused(opensfm.read_odm_control, file("1 2 3 4 5 a.tif\n")).what
    error = refused(opensfm.read_odm_control, file("EPSG:25832\n1 2 3 4 5\n"))
    assert ("no image" in error.what, error.line) == (True, 2)


def test_names_with_blanks_of_a_gcp_list_need_tabulators(file):
    row = "500123.4 5300456.7 412.3 4012.6 3001.2 img 1.tif GCP 1"
    for reader in (opensfm.read_odm_control, opensfm.read_odm_measurements):
        error = refused(reader, file(f"EPSG:25832\n{row}\n"))
        assert "'img', seems to go on with '1.tif'" in error.what
        assert error.line == 2
        assert "tabulators" in error.remedy
    names = "EPSG:25832\n1 2 3 4 5 a.tif GCP 1\n6 7 8 9 10 a.tif GCP 2\n"
    assert "tabulators" in refused(opensfm.read_odm_control, file(names)).remedy
    tabbed = row.replace(" ", "\t").replace("img\t", "img ").replace("GCP\t", "GCP ")
    records = opensfm.read_odm_measurements(file(f"EPSG:25832\n{tabbed}\n"))
    assert (records.image[0].as_py(), records.point[0].as_py()) == ("img 1.tif", "GCP 1")


def test_positions_of_a_geo_file_have_no_angles(file):
    records = opensfm.read_odm_geo(file("WGS84\na.jpg 11.5 48.0 600 10 20 30\n"), ORDER)
    assert records.position.tolist() == [[11.5, 48.0, 600.0]]
    assert np.isnan(records.angles).all()
    assert np.isnan(records.sigma_position).all()


def test_accuracies_of_a_geo_file_are_standard_deviations(file):
    path = file("WGS84\na.jpg 11.5 48.0 600 10 20 30 0.02 0.05\nb.jpg 11.5 48.0 600\n")
    records = opensfm.read_odm_geo(path, ORDER)
    np.testing.assert_array_equal(records.sigma_position, [[0.02, 0.02, 0.05], [np.nan] * 3])
    assert "accuracies" in refused(opensfm.read_odm_geo, file("WGS84\na 1 2 3 4 5 6 x 1\n"), ORDER).what
