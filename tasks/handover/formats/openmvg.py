"""OpenMVG ``sfm_data.json`` 0.3: views, intrinsics, extrinsics, structure and control points.

Cameras are ``pinhole_brown_t2``, whose t1, t2 are p1, p2; pixels count from the corner of the first one. Points are numbers;
``openmvg_points.csv`` names them.
"""  # noqa: E501

from __future__ import annotations

import json

import numpy as np

from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.camera_axes import camera_from_world, pixels
from tasks.handover.formats.numbers import table
from tasks.handover.lens import LensModel

_VIEW, _FIRST = 1 << 30, 1 << 31
_KIND = "pinhole_brown_t2"


def write_openmvg(delivery: Delivery) -> Files:
    """``sfm_data.json`` and ``openmvg_points.csv``."""
    models, camera = delivery.lenses.models, delivery.results.images.camera
    rotation, _ = camera_from_world(delivery)
    centre = delivery.handed.pose.centre
    views = [
        {
            "key": k,
            "value": {
                "polymorphic_id": _VIEW,
                "ptr_wrapper": {
                    "id": _FIRST + len(models) + 1 + k,
                    "data": {
                        "local_path": "",
                        "filename": name,
                        "width": models[camera[k]].columns,
                        "height": models[camera[k]].rows,
                        "id_view": k,
                        "id_intrinsic": int(camera[k]),
                        "id_pose": k,
                    },
                },
            },
        }
        for k, name in enumerate(delivery.names)
    ]
    poses = [
        {"key": k, "value": {"rotation": rotation[k].tolist(), "center": centre[k].tolist()}}
        for k in range(len(views))
    ]
    structure, control = _points(delivery)
    found = {
        "sfm_data_version": "0.3",
        "root_path": "",
        "views": views,
        "intrinsics": [_intrinsic(k, model) for k, model in enumerate(models)],
        "extrinsics": poses,
        "structure": structure,
        "control_points": control,
    }
    return {
        "sfm_data.json": json.dumps(found, indent=1) + "\n",
        "openmvg_points.csv": table(["number", "point", "role"], delivery.points.numbered()),
    }


def _intrinsic(number: int, model: LensModel) -> dict[str, object]:
    value: dict[str, object] = {"polymorphic_id": _FIRST + 1} if number == 0 else {"polymorphic_id": 1}
    if number == 0:
        value["polymorphic_name"] = _KIND
    lens = model.distortion
    data = {
        "width": model.columns,
        "height": model.rows,
        "focal_length": model.focal[1],
        "principal_point": list(model.principal_point),
        "disto_t2": [lens[name] for name in ("k1", "k2", "k3", "p1", "p2")],
    }
    return {"key": number, "value": {**value, "ptr_wrapper": {"id": _FIRST + 1 + number, "data": data}}}


def _points(delivery: Delivery) -> tuple[list[dict[str, object]], list[dict[str, object]]]:
    """Structure, and surveyed points that are control; each with its observations."""
    points, measured = delivery.points, pixels(delivery)
    surveyed = points.surveyed_at
    structure: list[dict[str, object]] = []
    control: list[dict[str, object]] = []
    for k, (name, rays) in enumerate(zip(points.names, points.rays_of_points, strict=True)):
        seen = [
            {"key": int(points.image[ray]), "value": {"id_feat": k, "x": measured[ray].tolist()}}
            for ray in rays
        ]
        at = surveyed.get(name)
        is_control = at is not None and not points.surveyed.check[at]
        known = at is not None and is_control and bool(np.isfinite(points.surveyed.local[at]).all())
        place = points.surveyed.local[at] if at is not None and known else points.local[k]
        item = {"key": k, "value": {"X": place.tolist(), "observations": seen}}
        (control if known else structure).append(item)
    return structure, control
