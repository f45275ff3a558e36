"""Pix4Dmapper's parameter folder: external and calibrated camera parameters, tie points.

| file | line | read |
|---|---|---|
| ``…_calibrated_external_camera_parameters.txt`` | imageName X Y Z Omega Phi Kappa | CRS of the output, ω, φ, κ in degrees |
| ``…_tp_pix4d.txt`` | image, then id x y scale, then −99 | pixels; as `photo_lists` |
| ``…_calibrated_camera_parameters.txt`` | image, width, height; K; radial; tangential; t; R | cameras, in pixels; positions and rotations there are those of the other file |

The folder's ``…_tp_bingo.txt`` is read as ``bingo`` (mm, from the middle of the image).
"""  # noqa: E501

from __future__ import annotations

from collections.abc import Mapping
from itertools import islice
from pathlib import Path

from tasks.errors import Location
from tasks.formats.long_columns import LongRows
from tasks.formats.plain_records import numbers_of
from tasks.formats.records import AngleOrder, ExposureRecords, FileStatement, PixelCamera
from tasks.formats.text_lines import numbered_lines

_CAMERA_HEAD = "fileName imageWidth imageHeight"
# Lines of an image: K, radial and tangential distortion, t, R.
_LINES_OF_CAMERA = 9
# More than any block has.
_MOST_CAMERAS = 100_000
_HEAD = ["imagename", "x", "y", "z", "omega", "phi", "kappa"]


def read_pix4d_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read calibrated external camera parameters.

    Raises
    ------
    InputError
        With file and line: another header, fields missing.
    """
    rows = numbered_lines(path)
    if next(rows)[1].lower().split() != _HEAD:
        raise Location(path, 1).error(
            "The first line is not 'imageName X Y Z Omega Phi Kappa'.",
            "Check that this is …_calibrated_external_camera_parameters.txt.",
        )
    images = LongRows("position", "angles")
    for number, line in rows:
        fields = line.rsplit(maxsplit=6)
        if not fields:
            continue
        values = numbers_of(path, fields[1:], 6, number, "X, Y, Z, ω, φ, κ")
        images.append(fields[0].strip(), values[:3], values[3:], line=number)
    return images.exposures(path, FileStatement(order="omega-phi-kappa"), unit="deg")


def read_pix4d_cameras(path: Path) -> Mapping[str, PixelCamera]:
    """Read calibrated camera parameters: each different camera by the name of the first image that has it.

    Raises
    ------
    InputError
        With file and line: another header, numbers missing, or pixels that are not square.
    """
    rows = numbered_lines(path)
    if next(rows)[1].strip() != _CAMERA_HEAD:
        raise Location(path, 1).error(
            f"The first line is not '{_CAMERA_HEAD}'.",
            "Check that this is …_calibrated_camera_parameters.txt.",
        )
    # The head explains the lines of an image, and ends with an empty line.
    next((number for number, row in rows if not row.strip()), None)
    filled = ((number, row.split()) for number, row in rows if row.strip())
    known: dict[str, PixelCamera] = {}
    seen: set[tuple[object, ...]] = set()
    for number, words in filled:
        body = list(islice(filled, _LINES_OF_CAMERA))
        if len(words) < 3 or len(body) < _LINES_OF_CAMERA:
            raise Location(path, number).error(
                "An image is not complete.", "The file may have been cut off: deliver it again."
            )
        camera = _camera(path, number, words, body)
        values = (camera.columns, camera.rows, camera.focal_length_px, camera.principal_point_px)
        different = (*values, *sorted(camera.additional_parameters.items()))
        if different not in seen:
            if len(seen) == _MOST_CAMERAS:
                raise Location(path, number).error(
                    f"The file has more than {_MOST_CAMERAS:,} different cameras.",
                    "Write the camera into the project file.",
                )
            seen.add(different)
            known[" ".join(words[:-2])] = camera
    if not known:
        raise Location(path).error("There is no camera in the file.", "Deliver the file again.")
    return known


def _camera(path: Path, number: int, words: list[str], body: list[tuple[int, list[str]]]) -> PixelCamera:
    """The camera of an image: its own line, then three lines of K, radial, tangential distortion."""
    columns, rows = numbers_of(path, words[-2:], 2, number, "width and height")
    matrix = [numbers_of(path, row, 3, line, "a line of K") for line, row in body[:3]]
    radial = numbers_of(path, body[3][1], 3, body[3][0], "radial distortion")
    tangential = numbers_of(path, body[4][1], 2, body[4][0], "tangential distortion")
    (fx, skew, column), (_, fy, row) = matrix[0], matrix[1]
    whole = columns.is_integer() and rows.is_integer() and 0 < columns < 10**6 and 0 < rows < 10**6
    if not (whole and fx == fy > 0.0 and skew == 0.0):
        raise Location(path, number).error(
            "The pixels are not whole or not square, or the focal length is not positive.",
            "Declare the camera in the project file.",
        )
    values = dict(zip(("k1", "k2", "k3", "p1", "p2"), (*radial, *tangential), strict=True))
    distortion = {f"brown-forward:{key}": value for key, value in values.items() if value}
    return PixelCamera(int(columns), int(rows), fy, (column - 0.5 * columns, 0.5 * rows - row), distortion)
