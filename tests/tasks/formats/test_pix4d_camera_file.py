"""Pix4D's camera file says the same as the calibrated camera parameters beside it, or is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.formats.pix4d import read_pix4d_cameras
from tasks.formats.pix4d_camera_file import read_pix4d_camera_file
from tests.tasks.formats.sound_files import PIX4D_CAMERA_FILE, PIX4D_CAMERAS


def written(folder: Path, text: str) -> Path:
    path = folder / "project_calibrated_internal_camera_parameters.cam"
    path.write_text(text)
    return path


def test_it_is_the_camera_of_the_calibrated_parameters(tmp_path: Path) -> None:
    (camera,) = read_pix4d_camera_file(written(tmp_path, PIX4D_CAMERA_FILE)).values()
    (in_pixels,) = read_pix4d_cameras(written(tmp_path, PIX4D_CAMERAS)).values()
    # The parameters have the row of the principal point at 39 of 80: one above the middle.
    same = in_pixels.with_pixel(50.0)
    assert (camera.columns, camera.rows) == (same.columns, same.rows)
    assert camera.pixel_um == pytest.approx(50.0)
    assert camera.focal_length_mm == pytest.approx(same.focal_length_mm)
    assert camera.principal_point_mm == pytest.approx(same.principal_point_mm)
    assert camera.additional_parameters.keys() == same.additional_parameters.keys()
    for key, value in same.additional_parameters.items():
        assert camera.additional_parameters[key] == pytest.approx(value)


def test_the_size_of_the_image_may_be_printed_with_decimals(tmp_path: Path) -> None:
    text = PIX4D_CAMERA_FILE.replace("100x80", "100.00000000000000000000x80.00000000000000000000")
    assert text != PIX4D_CAMERA_FILE
    (camera,) = read_pix4d_camera_file(written(tmp_path, text)).values()
    assert (camera.columns, camera.rows) == (100, 80)


def test_several_cameras_are_called_by_their_numbers(tmp_path: Path) -> None:
    again = PIX4D_CAMERA_FILE.replace("camera_calibration_file 0", "camera_calibration_file 1")
    cameras = read_pix4d_camera_file(
        written(tmp_path, PIX4D_CAMERA_FILE + again.replace("FOCAL 10", "FOCAL 20"))
    )
    assert {name: camera.focal_length_mm for name, camera in cameras.items()} == {"0": 10.0, "1": 20.0}
    with pytest.raises(InputError, match="exists twice"):
        read_pix4d_camera_file(written(tmp_path, 2 * PIX4D_CAMERA_FILE))


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("camera_calibration_file 0", "nothing", "No line begins with"),
        ("camera_calibration_file 0", "Pix4D camera calibration file 0", "size of the image in pixels"),
        ("FOCAL 10.0", "", "lacks at least one of"),
        ("FOCAL 10.0", "FOCAL -10.0", "focal length is not positive"),
        ("FOCAL 10.0", "FOCAL ten", "'ten'"),
        ("100x80", "100x90", "square pixels"),
        ("XPOFF -1.5", "XPOFF 1.5", "not the same point"),
        (
            "YPOFF 0.05\n#Principal Point Offset xpoff ypoff in mm\n",
            "YPOFF -0.05\n#Principal Point Offset xpoff ypoff in mm\n",
            "not the same point",
        ),
        ("SYM_DIST 0", "SYM_DIST 0.1", "K0 or p3"),
        ("DEC_DIST 0 0.00001 0", "DEC_DIST 0 0.00001", "3 are required"),
    ],
)
def test_damage_is_named(tmp_path: Path, old: str, new: str, what: str) -> None:
    assert old in PIX4D_CAMERA_FILE
    path = written(tmp_path, PIX4D_CAMERA_FILE.replace(old, new, 1))
    with pytest.raises(InputError) as refused:
        read_pix4d_camera_file(path)
    assert what in str(refused.value)
    assert refused.value.remedy
