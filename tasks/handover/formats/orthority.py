"""Orthority: interior parameters of the cameras (YAML) and exterior ones of the images (GeoJSON).

Its world is the map taken as Cartesian; ω, φ, κ are in radians. Cameras are of the type ``brown``: distortion from the ideal to the
measured point, principal point from the middle of the image in parts of its longer side. The focal length is that which was fitted with the
orientations.
"""  # noqa: E501

from __future__ import annotations

import json

import numpy as np

from tasks.coordinates.wgs84 import geodetic_on_wgs84
from tasks.errors import InputError
from tasks.handover.delivery import Angles, Delivery, Files
from tasks.handover.formats.camera_axes import exact
from tasks.handover.formats.numbers import in_angles
from tasks.handover.lens import LensModel


def write_orthority(delivery: Delivery) -> Files:
    """``interior.yaml`` and ``exterior.geojson``."""
    images, pose = delivery.results.images, delivery.handed.pose
    if images.map_frame.is_local:
        raise InputError(
            "Orthority requires a projected CRS, but the block is local.",
            "Write it for another program.",
            entity="project.crs",
        )
    angles = in_angles(pose.map_from_camera, Angles("omega-phi-kappa", "rad"))
    places = np.rad2deg(geodetic_on_wgs84(images.map_frame, images.map_pose.centre)[:, :2])
    features = [
        {
            "type": "Feature",
            "properties": {
                "filename": name,
                "camera": delivery.camera_names[k],
                "opk": angles[k].tolist(),
                "xyz": pose.centre[k].tolist(),
            },
            "geometry": {
                "type": "Point",
                "coordinates": [*places[k, ::-1].tolist(), float(pose.centre[k, 2])],
            },
        }
        for k, name in enumerate(delivery.names)
    ]
    found = {"type": "FeatureCollection", "world_crs": images.map_frame.name, "features": features}
    cameras = [_camera(model) for model in delivery.lenses.models]
    return {
        "interior.yaml": "\n".join(cameras) + "\n",
        "exterior.geojson": json.dumps(found, indent=1, ensure_ascii=False) + "\n",
    }


def _camera(model: LensModel) -> str:
    longer = max(model.columns, model.rows)
    column, row = model.principal_point
    sensor = [exact(size * model.pixel_size * 1e3) for size in (model.columns, model.rows)]
    return "\n".join(
        [
            f"{json.dumps(model.name, ensure_ascii=False)}:",
            "  type: brown",
            f"  im_size: [{model.columns}, {model.rows}]",
            f"  focal_len: {exact(model.focal[1] * model.pixel_size * 1e3)}",
            f"  sensor_size: [{', '.join(sensor)}]",
            f"  cx: {_decimal((column - 0.5 * model.columns) / longer)}",
            f"  cy: {_decimal((row - 0.5 * model.rows) / longer)}",
            *(f"  {name}: {_decimal(value)}" for name, value in model.distortion.items()),
        ]
    )


def _decimal(value: float) -> str:
    """A number that YAML reads as one: without an exponent."""
    return f"{value + 0.0:.18f}"
