"""Frames and Cameras tables of ArcGIS (ortho mapping, frame camera raster type)."""

from __future__ import annotations

from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.numbers import fixed, orientations, table
from tasks.handover.results import CalibratedCamera

_FRAME = (
    "Raster", "CameraID", "PerspectiveX", "PerspectiveY", "PerspectiveZ", "Omega", "Phi", "Kappa", "SRS",
)  # fmt: skip
_CAMERA = (
    "CameraID", "FocalLength", "PrincipalX", "PrincipalY", "A0", "A1", "A2", "B0", "B1", "B2",
    "NRows", "NColumns", "PixelSize",
)  # fmt: skip


def write_esri(delivery: Delivery) -> Files:
    """``frames.csv`` and ``cameras.csv``; lengths of cameras in micrometres."""
    place = delivery.results.images.map_frame
    srs = "" if place.is_local else place.name.removeprefix("EPSG:")
    named = zip(delivery.names, delivery.camera_names, orientations(delivery), strict=True)
    frames = [[image, camera, *cells, srs] for image, camera, cells in named]
    focal = dict(zip(delivery.camera_names, delivery.handed.pose.focal_length, strict=True))
    cameras = [_camera(item, focal[item.frame.name]) for item in delivery.results.cameras]
    return {"frames.csv": table(_FRAME, frames), "cameras.csv": table(_CAMERA, cameras)}


def _camera(camera: CalibratedCamera, focal_length: float) -> list[str]:
    """Affine from pixels (column, row; centre of the first is 0) to film, micrometres: x right, y up."""
    frame = camera.frame
    pitch = frame.pixel_size * 1e6
    x0, y0 = (value * 1e6 for value in frame.principal_point)
    left, top = -0.5 * (frame.columns - 1) * pitch, 0.5 * (frame.rows - 1) * pitch
    affine = fixed([left, pitch, 0.0, top, 0.0, -pitch], 4)
    return [
        frame.name,
        *fixed([focal_length * 1e6, x0, y0], 4),
        *affine,
        str(frame.rows),
        str(frame.columns),
        *fixed([pitch], 4),
    ]
