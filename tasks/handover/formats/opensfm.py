"""OpenSfM and OpenDroneMap: ``reconstruction.json`` (world east, north, up of its reference) and ``tracks.csv``.

Cameras are ``brown``; lengths in the image are parts of its longer side, from its middle. Tracks go by the names of the points.
A block on the earth has OpenDroneMap's ``gcp_list.txt`` of complete control points, the like of complete check points (``CHK-NAME``), as
OpenDroneMap takes all of a list as control, and ``geo.txt``, the positions of its images; in longitude, latitude and ellipsoidal height. A block with rigs has rig cameras and rig instances, also as
``rig_cameras.json`` and ``rig_assignments.json``; the rig is its reference head.
"""  # noqa: E501

from __future__ import annotations

import json

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.earth import TopocentricFrame
from adjust.geometry.rotation import log
from tasks.errors import InputError
from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.camera_axes import camera_from_world, pixels
from tasks.handover.formats.numbers import fixed
from tasks.handover.formats.rigs import written_rigs
from tasks.handover.lens import LensModel

_GREY = [128.0, 128.0, 128.0]
# Of OpenDroneMap's lists: pixels count from the centre of the first one, and names of check points begin so.
_CENTRE, _CHECK = 0.5, "CHK-"
_EARTH = "+proj=longlat +datum=WGS84 +no_defs"
# Decimals: a millionth of a metre.
_DEGREES, _HEIGHT, _PIXEL = 11, 6, 4


def write_opensfm(delivery: Delivery) -> Files:
    """The files."""
    rotation, translation = camera_from_world(delivery)
    frame, points = delivery.results.images.frame, delivery.points
    shots = {
        name: {
            "rotation": turn.tolist(),
            "translation": shift.tolist(),
            "camera": camera,
            "orientation": 1,
            "capture_time": 0.0,
        }
        for name, camera, turn, shift in zip(
            delivery.names, delivery.camera_names, log(rotation), translation, strict=True
        )
    }
    found: dict[str, object] = {
        "cameras": {model.name: _camera(model) for model in delivery.lenses.models},
        "shots": shots,
        "points": {
            name: {"color": _GREY, "coordinates": place.tolist()}
            for name, place in zip(points.names, points.local, strict=True)
        },
    }
    if isinstance(frame, TopocentricFrame):
        found["reference_lla"] = {
            "latitude": float(np.rad2deg(frame.latitude)),
            "longitude": float(np.rad2deg(frame.longitude)),
            "altitude": float(frame.height_of_origin_m),
        }
    rigs, assignments = _rigs(delivery)
    return {
        "reconstruction.json": json.dumps([{**found, **rigs}], indent=1) + "\n",
        "tracks.csv": _tracks(delivery),
        **assignments,
        **(_on_earth(delivery, frame) if isinstance(frame, TopocentricFrame) else {}),
    }


def _rigs(delivery: Delivery) -> tuple[dict[str, object], dict[str, str]]:
    """Rig cameras and instances of a reconstruction, and the files of its dataset that declare them."""
    found = written_rigs(delivery)
    if found is None:
        return {}, {}
    names, cameras = [model.name for model in delivery.lenses.models], delivery.camera_names
    turn, of_rig = log(found.turn), log(found.rig_turn)
    heads = {
        name: {"rotation": turn[k].tolist(), "translation": found.shift[k].tolist()}
        for k, name in enumerate(names)
    }
    instances = {
        f"{number}": {
            "rotation": of_rig[images[0]].tolist(),
            "translation": found.rig_shift[images[0]].tolist(),
            "rig_camera_ids": {delivery.names[k]: cameras[k] for k in images},
        }
        for number, images in enumerate(found.events, start=1)
    }
    assignments = {
        f"{number}": [[delivery.names[k], cameras[k]] for k in images]
        for number, images in enumerate(found.events, start=1)
    }
    models = {name: {**head, "camera": name} for name, head in heads.items()}
    return (
        {"rig_cameras": heads, "rig_instances": instances},
        {
            "rig_cameras.json": json.dumps(models, indent=1) + "\n",
            "rig_assignments.json": json.dumps(assignments, indent=1) + "\n",
        },
    )


def _on_earth(delivery: Delivery, frame: TopocentricFrame) -> dict[str, str]:
    """The files that OpenDroneMap reads next to its images."""
    points = delivery.points
    surveyed = points.surveyed_at
    measured = pixels(delivery) - _CENTRE
    rows: dict[str, list[str]] = {"gcp_list.txt": [], "gcp_check_list.txt": []}
    for ray, (image, point) in enumerate(zip(points.image, points.point, strict=True)):
        at = surveyed.get(points.names[point])
        if at is None or not np.isfinite(points.surveyed.local[at]).all():
            continue
        check = bool(points.surveyed.check[at])
        name = f"{_CHECK if check else ''}{points.names[point]}"
        place = _longitude_latitude(frame, points.surveyed.local[at])
        # Tabulators keep names with blanks whole.
        listed = rows["gcp_check_list.txt" if check else "gcp_list.txt"]
        listed.append("\t".join([*place, *fixed(measured[ray], _PIXEL), delivery.names[image], name]))
    files = {file: "\n".join([_EARTH, *listed]) + "\n" for file, listed in rows.items() if listed}
    if not any(sign.isspace() for name in delivery.names for sign in name):
        places = (_longitude_latitude(frame, centre) for centre in delivery.handed.pose.centre)
        lines = [" ".join([name, *place]) for name, place in zip(delivery.names, places, strict=True)]
        files["geo.txt"] = "\n".join([_EARTH, *lines]) + "\n"
    return files


def _longitude_latitude(frame: TopocentricFrame, local: Floats) -> list[str]:
    latitude, longitude, height = frame.to_geodetic(local)
    return [*fixed(np.rad2deg([longitude, latitude]), _DEGREES), *fixed([height], _HEIGHT)]


def _camera(model: LensModel) -> dict[str, object]:
    longer = max(model.columns, model.rows)
    (fx, fy), (column, row) = model.focal, model.principal_point
    return {
        "projection_type": "brown",
        "width": model.columns,
        "height": model.rows,
        "focal_x": fx / longer,
        "focal_y": fy / longer,
        "c_x": (column - 0.5 * model.columns) / longer,
        "c_y": (row - 0.5 * model.rows) / longer,
        **model.distortion,
    }


def _tracks(delivery: Delivery) -> str:
    """Shot, track, feature, x, y, scale, colour, segment, instance; features count within their shot."""
    points, images = delivery.points, delivery.results.images
    for name in (*delivery.names, *points.names):
        if "\t" in name:
            raise InputError(
                "The name has a tabulator, which separates fields in tracks.csv.", "Rename it.", entity=name
            )
    models = delivery.lenses.models
    size = np.array([[model.columns, model.rows] for model in models], dtype=np.float64)[
        images.camera[points.image]
    ].reshape(-1, 2)
    normalized = (pixels(delivery) - 0.5 * size) / size.max(axis=1, initial=1.0)[:, None]
    feature = np.arange(len(points.image)) - np.searchsorted(points.image, points.image)
    lines = [
        f"{delivery.names[image]}\t{points.names[point]}\t{number}\t{x:.9f}\t{y:.9f}\t0.001\t128\t128\t128\t-1\t-1"
        for image, point, number, (x, y) in zip(points.image, points.point, feature, normalized, strict=True)
    ]
    return "\n".join(["OPENSFM_TRACKS_VERSION_v2", *lines]) + "\n"
