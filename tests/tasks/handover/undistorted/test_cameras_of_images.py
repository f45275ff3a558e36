"""Which camera has taken an image that is to be undistorted: never one of another image of its file name."""

from __future__ import annotations

from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.handover.undistorted.undistort import _camera_of

OF_IMAGE = {"nadir/1.tif": "N", "left/1.tif": "L", "left/2.tif": "L", "2.tif": "N", "3": "N", "101.0001": "N"}


@pytest.mark.parametrize(
    ("path", "camera"),
    [
        ("images/nadir/1.tif", "N"),
        ("images/left/1.tif", "L"),
        ("left/2.tif", "L"),
        ("other/2.tif", "N"),
        ("3.jp2", "N"),
        ("101.0001.tif", "N"),
        ("images/2.jpg", None),
        ("images/1.tif", None),
    ],
)
def test_folders_count_where_names_are_alike(path: str, camera: str | None) -> None:
    if camera is not None:
        assert _camera_of(Path(path), OF_IMAGE) == camera
        return
    with pytest.raises(InputError, match="Images of this name were taken by the cameras L, N") as raised:
        _camera_of(Path(path), OF_IMAGE)
    assert "--camera" in raised.value.remedy
