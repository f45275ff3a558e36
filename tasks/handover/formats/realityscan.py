"""RealityScan (RealityCapture): its CSV of registered images, and an XMP file next to each image.

| file | orientation | camera |
|---|---|---|
| ``realityscan.csv`` | heading, pitch, roll of R_z(−heading) R_x(pitch) R_y(roll), in east, north, up at each camera | 35 mm focal length, principal point and distortion, parts of the longer side |
| ``NAME.xmp`` | camera from the axes of the map, x right, y down, z forward | the same |

The map is not conformal to true north: the CSV counts from true north at each camera, the XMP from grid north. In a local world both are
those of the frame. Tangential t1, t2 are p2, p1.
"""  # noqa: E501

from __future__ import annotations

from xml.sax.saxutils import escape

import numpy as np

from adjust.arrays import Floats
from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.camera_axes import camera_from_world, exact
from tasks.handover.formats.numbers import ANGLES, METRES, fixed, table
from tasks.handover.formats.short_names import stems
from tasks.handover.lens import LensModel

_HEAD = (
    "#name",
    "x",
    "y",
    "alt",
    "heading",
    "pitch",
    "roll",
    "f",
    "px",
    "py",
    "k1",
    "k2",
    "k3",
    "k4",
    "t1",
    "t2",
)
# Width of 35 mm film.
_FILM_MM = 36.0
_XMP = """<x:xmpmeta xmlns:x="adobe:ns:meta/">
 <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
  <rdf:Description xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#" xcr:Version="3"
    xcr:PosePrior="exact" xcr:Coordinates="absolute" xcr:DistortionModel="brown4t2"
    xcr:FocalLength35mm="{f}" xcr:Skew="0" xcr:AspectRatio="1" xcr:PrincipalPointU="{u}"
    xcr:PrincipalPointV="{v}" xcr:CalibrationPrior="exact" xcr:CalibrationGroup="-1"
    xcr:DistortionGroup="-1" xcr:InTexturing="1" xcr:InMeshing="1">
   <xcr:Rotation>{rotation}</xcr:Rotation>
   <xcr:Position>{position}</xcr:Position>
   <xcr:DistortionCoeficients>{lens}</xcr:DistortionCoeficients>
  </rdf:Description>
 </rdf:RDF>
</x:xmpmeta>
"""


def write_realityscan(delivery: Delivery) -> Files:
    """``realityscan.csv`` and one XMP file for each image."""
    pose, camera = delivery.handed.pose, delivery.results.images.camera
    models = [delivery.lenses.models[k] for k in camera]
    angles = np.degrees(_heading_pitch_roll(_at_each_camera(delivery)))
    rotation, _ = camera_from_world(delivery)
    rows, files, of_image = [], {}, stems(delivery.names)
    for k, (name, model) in enumerate(zip(delivery.names, models, strict=True)):
        f, u, v, lens = _camera(model)
        place = fixed(pose.centre[k], METRES)
        rows.append([name, *place, *fixed(angles[k], ANGLES), *map(exact, (f, u, v, *lens))])
        files[f"{of_image[k]}.xmp"] = _XMP.format(
            f=exact(f),
            u=exact(u),
            v=exact(v),
            lens=" ".join(map(exact, lens)),
            rotation=" ".join(map(exact, rotation[k].ravel())),
            position=escape(" ".join(place)),
        )
    return {"realityscan.csv": table(_HEAD, rows), **files}


def _at_each_camera(delivery: Delivery) -> Floats:
    """Rotations (n, 3, 3) from the camera into east, north, up at each camera, or of the local world."""
    images = delivery.results.images
    if delivery.handed.world == "local" or images.map_frame.is_local:
        return delivery.handed.pose.map_from_camera
    axes = np.asarray(images.frame.local_from_enu(images.projection_centre))
    return np.asarray(np.swapaxes(axes, 1, 2) @ images.local_from_camera)


def _heading_pitch_roll(rotation: Floats) -> Floats:
    """(n, 3) radians of R = R_z(−heading) R_x(pitch) R_y(roll)."""
    heading = np.arctan2(rotation[:, 0, 1], rotation[:, 1, 1])
    pitch = np.arcsin(np.clip(rotation[:, 2, 1], -1.0, 1.0))
    roll = np.arctan2(-rotation[:, 2, 0], rotation[:, 2, 2])
    return np.column_stack([heading, pitch, roll])


def _camera(model: LensModel) -> tuple[float, float, float, list[float]]:
    """35 mm focal length, principal point, distortion k1 to k4, t1, t2."""
    longer, lens = max(model.columns, model.rows), model.distortion
    column, row = model.principal_point
    terms = [lens["k1"], lens["k2"], lens["k3"], 0.0, lens["p2"], lens["p1"]]
    f, u, v = (
        _FILM_MM * model.focal[1] / longer,
        (column - 0.5 * model.columns) / longer,
        (row - 0.5 * model.rows) / longer,
    )
    return f, u, v, terms
