"""SURE: one ``NAME.ori`` for each image, for undistorted images in a Cartesian world.

Axes are x right, y down, z forward; the rotation is image from world, the "translation" the projection
centre; pixels count from the centre of the first one. No section may be missing. The sections are as three
independent programs write them for SURE (OrientAL, which cites SURE_Coordinate_Systems.pdf, an exporter of
OpenMVG, a tool of a mapping agency), and a fourth reads them. Models of distortion are not written: their
signs are not known.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from tasks.formats.plain_records import CV_AXES
from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.camera_axes import exact
from tasks.handover.formats.short_names import stems

# The title of a section ends in the column 72.
_WIDTH = 72


def write_sure(delivery: Delivery) -> Files:
    """One file for each image."""
    images, pose = delivery.results.images, delivery.handed.pose
    files = {}
    for k, (name, stem) in enumerate(zip(delivery.names, stems(delivery.names), strict=True)):
        frame = delivery.results.cameras[images.camera[k]].frame
        pixel = frame.pixel_size
        focal = float(pose.focal_length[k])
        x0, y0 = frame.principal_point
        column, row = 0.5 * frame.columns - 0.5 + x0 / pixel, 0.5 * frame.rows - 0.5 - y0 / pixel
        matrix = np.array([[focal / pixel, 0.0, column], [0.0, focal / pixel, row], [0.0, 0.0, 1.0]])
        sections = (
            ("$ImageID", "(ORI_Ver_1.0)", [name]),
            ("$IntOri_FocalLength", "[mm]", [exact(1e3 * focal)]),
            ("$IntOri_PixelSize______(x|y)", "[mm]", _rows(np.full((1, 2), 1e3 * pixel))),
            ("$IntOri_SensorSize_____(x|y)", "[pixel]", [f"{frame.columns}\t{frame.rows}"]),
            ("$IntOri_PrincipalPoint_(x|y)", "[pixel]", _rows(np.array([[column, row]]))),
            ("$IntOri_CameraMatrix", "(ImageCoordinateSystem)", _rows(matrix)),
            (
                "$ExtOri_RotationMatrix",
                "(World->ImageCoordinateSystem)",
                _rows(CV_AXES @ pose.map_from_camera[k].T),
            ),
            ("$ExtOri_TranslationVector", "(WorldCoordinateSystem)", _rows(pose.centre[k : k + 1])),
            ("$IntOri_Distortion_____(Model|ParameterCount|(Parameters))", "", ["NONE\t0"]),
        )
        files[f"{stem}.ori"] = "".join(_section(*section) for section in sections)
    return files


def _section(title: str, meaning: str, lines: list[str]) -> str:
    head = title + "_" * (_WIDTH - len(title) - len(meaning)) + meaning
    return "\n".join([head, *(f"\t{line}" for line in lines)]) + "\n"


def _rows(values: Floats) -> list[str]:
    return ["\t".join(exact(value) for value in row) for row in values.tolist()]
