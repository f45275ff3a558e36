"""nerfstudio and 3D Gaussian splatting: ``transforms.json``, camera to world, in our axes x right, y up, z back.

Coordinates count from the middle of the projection centres, as such programs compute in single precision; ``aerocal_offset`` is to be
added to get back to the coordinates of HANDOVER.txt.
"""  # noqa: E501

from __future__ import annotations

import json

import numpy as np

from tasks.handover.delivery import Delivery, Files
from tasks.handover.lens import LensModel


def write_nerfstudio(delivery: Delivery) -> Files:
    """``transforms.json``; every frame has its camera."""
    pose, camera = delivery.handed.pose, delivery.results.images.camera
    offset = np.round(0.5 * (pose.centre.min(axis=0) + pose.centre.max(axis=0)))
    frames = []
    for k, name in enumerate(delivery.names):
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = pose.map_from_camera[k], pose.centre[k] - offset
        model = delivery.lenses.models[camera[k]]
        frames.append({"file_path": name, **_camera(model), "transform_matrix": matrix.tolist()})
    found = {"camera_model": "OPENCV", "aerocal_offset": offset.tolist(), "frames": frames}
    return {"transforms.json": json.dumps(found, indent=1) + "\n"}


def _camera(model: LensModel) -> dict[str, float]:
    (fx, fy), (column, row), lens = model.focal, model.principal_point, model.distortion
    size = {"w": model.columns, "h": model.rows}
    radial = {key: lens[key] for key in ("k1", "k2", "k3")}
    tangential = {key: lens[key] for key in ("p1", "p2")}
    return {"fl_x": fx, "fl_y": fy, "cx": column, "cy": row, **size, **radial, "k4": 0.0, **tangential}
