"""Inpho project (``.prj``): cameras and photos with exterior orientation, rotation object → image.

Interior orientation leads from millimetres to pixels (column, row; centre of the first pixel 0, 0). The focal
length is in the camera and in every photo, and must be the same. Keys and their order are those of a
published camera and of two programs that write photos for Inpho.
"""

from __future__ import annotations

from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.numbers import METRES, ROTATION, fixed
from tasks.handover.results import CalibratedCamera

_DECIMALS_MM = 6
# Readers expect a time and a date here; those of an export would make two exports differ.
_AT_NO_TIME = "00:00:00 01/01/2000"


def write_inpho(delivery: Delivery) -> Files:
    """``inpho.prj``."""
    handed = delivery.handed
    focal = dict(zip(delivery.camera_names, 1e3 * handed.pose.focal_length, strict=True))
    curved = "on" if handed.world == "map-cartesian-curved" else "off"
    lines = [
        "$PROJECT 7.0.0",
        f"  $REFRACT_CORR_DEFAULT : {_refraction(delivery)}",
        f"  $CURV_CORR_DEFAULT : {curved}",
        "  $LINEAR_UNITS_OF_OBJECT : m",
        "  $LINEAR_UNITS_OF_IMAGE : mm",
        "  $ANGULAR_UNITS : deg",
        "$END",
    ]
    for camera in delivery.results.cameras:
        lines += _camera(camera, float(focal[camera.frame.name]))
    ground = delivery.results.ground[:, 1]
    for k, name in enumerate(delivery.names):
        lines += _photo(delivery, k, name, float(focal[delivery.camera_names[k]]), float(ground[k]))
    return {"inpho.prj": "\n".join(lines) + "\n"}


def _refraction(delivery: Delivery) -> str:
    """Whether the program must correct refraction: if we did, and it is not in the orientations."""
    return "on" if delivery.results.images.refracted and not delivery.handed.refitted else "off"


def _camera(camera: CalibratedCamera, focal_length_mm: float) -> list[str]:
    frame = camera.frame
    per_mm = 1e-3 / frame.pixel_size
    column, row = 0.5 * (frame.columns - 1), 0.5 * (frame.rows - 1)
    x0, y0 = (1e3 * value for value in frame.principal_point)
    return [
        "$CAMERA",
        f"  $TYPE : {_escaped(frame.name)}",
        "  $BRAND : Custom",
        "  $KIND : CCDFrame",
        "  $CCD_INTERIOR_ORIENTATION :",
        f"    {' '.join(fixed([per_mm, 0.0, column], _DECIMALS_MM))}",
        f"    {' '.join(fixed([0.0, -per_mm, row], _DECIMALS_MM))}",
        f"  $CCD_COLUMNS : {frame.columns}",
        f"  $CCD_ROWS : {frame.rows}",
        "  $PIXEL_REFERENCE : CenterTopLeft",
        f"  $FOCAL_LENGTH : {focal_length_mm:.{_DECIMALS_MM}f}",
        f"  $PRINCIPAL_POINT_PPA : {' '.join(fixed([x0, y0], _DECIMALS_MM))}",
        "$END",
    ]


def _photo(delivery: Delivery, k: int, name: str, focal_length_mm: float, ground: float) -> list[str]:
    pose = delivery.handed.pose
    matrix = pose.map_from_camera[k].T
    return [
        "$PHOTO",
        f"  $PHOTO_NUM : {_escaped(name)}",
        f"  $PHOTO_FILE : {_escaped(name)}",
        f"  $CAMERA_ID : {_escaped(delivery.camera_names[k])}",
        f"  $TERRAIN_HEIGHT : {ground:.3f}",
        "  $IO_STAT : manual",
        "  $ORI_STAT : Adjusted",
        f"  $EXT_ORI : {_AT_NO_TIME}",
        f"    {focal_length_mm:.{_DECIMALS_MM}f} {' '.join(fixed(pose.centre[k], METRES))}",
        *(f"    {' '.join(fixed(row, ROTATION))}" for row in matrix),
        "$END",
    ]


def _escaped(name: str) -> str:
    return name.replace(" ", "\\ ")
