"""OPF 1.0 (Pix4D's open photogrammetry format): a project of cameras and control points.

World is the frame of the adjustment as an engineering CRS, so nothing is approximated. Pixels count from
the corner of the first one; angles are ω, φ, κ of R = R_x R_y R_z. Surveyed points are in the same frame,
as control or check points with their marks; a point without one of its coordinates is a manual tie point.
Images are URI references: a blank is %20, as "#" would begin the number of a page.
Heads of a rig are sensors with relatives, their events captures; those without an image of the reference
head are captures of single cameras.

Tie points are a glTF cloud whose points have their matches in the images. Positions (float32, from the
middle of the cloud) are y-up; the matrix of the node leads to ours. Pixels are float32 as well.
"""

from __future__ import annotations

import json
import uuid
from collections.abc import Sequence
from importlib.metadata import version

import numpy as np

from adjust.geometry.earth import TopocentricFrame
from adjust.geometry.rotation import to_omega_phi_kappa
from tasks.handover.delivery import Angles, Delivery, Files
from tasks.handover.formats.camera_axes import pixels
from tasks.handover.formats.numbers import in_angles
from tasks.handover.formats.rigs import WrittenRigs, written_rigs
from tasks.handover.formats.short_names import tie_names, uri_of
from tasks.handover.lens import LensModel

_VERSION = "1.0"
# So that the same block has the same identifiers.
_NAMESPACE = uuid.UUID("6b0a3f0e-52a5-4c4f-9a55-0d6a8f2b7c11")
#: Item → its files (kind, name), and the items it was made from.
_ITEMS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "camera_list": (("camera-list",), ()),
    "input_cameras": (("input-cameras",), ("camera_list",)),
    "scene_reference_frame": (("scene-reference-frame",), ()),
    "input_control_points": (("input-control-points",), ("camera_list",)),
    "projected_control_points": (
        ("projected-control-points",),
        ("input_control_points", "scene_reference_frame"),
    ),
    "calibration": (
        ("calibrated-cameras", "calibrated-control-points"),
        ("input_cameras", "input_control_points", "projected_control_points", "scene_reference_frame"),
    ),
}


def write_opf(delivery: Delivery) -> Files:
    """``project.opf`` and its files."""
    crs = {"definition": _definition(delivery)}
    camera = delivery.results.images.camera
    pose = delivery.handed.pose
    angles = in_angles(pose.map_from_camera, Angles())
    calibrated = [
        {"id": k, "sensor_id": int(camera[k]), "position": centre.tolist(), "orientation_deg": turn.tolist()}
        for k, (centre, turn) in enumerate(zip(pose.centre, angles, strict=True))
    ]
    rigs = written_rigs(delivery)
    relatives = _relatives(rigs)
    sensors = [
        {"id": k, "internals": _internals(model), **relatives.get(k, {})}
        for k, model in enumerate(delivery.lenses.models)
    ]
    points = delivery.points
    adjusted = [
        {"id": points.names[k], "coordinates": points.local[k].tolist()}
        for k in np.flatnonzero(points.is_surveyed)
    ]
    gcps, mtps = _marked(delivery, crs)
    projected = [
        {"id": item["id"], "coordinates": place["coordinates"], "sigmas": place["sigmas"]}
        for item in gcps
        if isinstance(place := item["geolocation"], dict)
    ]
    frame = {"scale": [1.0, 1.0, 1.0], "shift": [0.0, 0.0, 0.0], "swap_xy": False}
    contents: dict[str, dict[str, object]] = {
        "camera-list": {"cameras": [{"id": k, "uri": uri_of(name)} for k, name in enumerate(delivery.names)]},
        "input-cameras": {"sensors": _sensors(delivery), "captures": _captures(delivery, rigs)},
        "scene-reference-frame": {"crs": crs, "base_to_canonical": frame},
        "input-control-points": {"gcps": gcps, "mtps": mtps},
        "projected-control-points": {"projected_gcps": projected},
        "calibrated-cameras": {"cameras": calibrated, "sensors": sensors},
        "calibrated-control-points": {"points": adjusted},
    }
    files = {
        f"{name}.json": _text({"format": f"application/opf-{name}+json", "version": _VERSION, **content})
        for name, content in contents.items()
    }
    cloud = cloud_files(delivery)
    return {**files, **cloud, "project.opf": _project(delivery.results.name, resources(list(cloud)))}


def _definition(delivery: Delivery) -> str:
    """The world as an engineering CRS."""
    frame, name = delivery.results.images.frame, "local"
    if isinstance(frame, TopocentricFrame):
        latitude, longitude = np.rad2deg([frame.latitude, frame.longitude])
        name = f"east north up of latitude {latitude:.9f} longitude {longitude:.9f} ellipsoidal height 0"
    axes = (("east (X)", "east"), ("north (Y)", "north"), ("up (Z)", "up"))
    listed = ",".join(f'AXIS["{label}",{way},ORDER[{k}]]' for k, (label, way) in enumerate(axes, start=1))
    system = f'CS[Cartesian,3],{listed},LENGTHUNIT["metre",1.0]'
    return f'ENGINEERINGCRS["{name}",ENGINEERINGDATUM["{name}"],{system}]'


def _internals(model: LensModel) -> dict[str, object]:
    lens = model.distortion
    return {
        "type": "perspective",
        "principal_point_px": list(model.principal_point),
        "focal_length_px": model.focal[1],
        "radial_distortion": [lens["k1"], lens["k2"], lens["k3"]],
        "tangential_distortion": [lens["p1"], lens["p2"]],
    }


def _sensors(delivery: Delivery) -> list[dict[str, object]]:
    return [
        {
            "id": k,
            "name": model.name,
            "bands": [{"name": "Gray", "weight": 1.0}],
            "image_size_px": [model.columns, model.rows],
            "pixel_size_um": model.pixel_size * 1e6,
            "internals": _internals(model),
            "shutter_type": "global",
        }
        for k, model in enumerate(delivery.lenses.models)
    ]


def _relatives(rigs: WrittenRigs | None) -> dict[int, dict[str, object]]:
    """Of the sensors that are secondary ones of a rig; axes x right, y down, z front."""
    if rigs is None:
        return {}
    turn, place = rigs.back
    angles = np.rad2deg(to_omega_phi_kappa(turn))
    return {
        int(k): {
            "rig_relatives": {"translation": place[k].tolist(), "rotation_angles_deg": angles[k].tolist()}
        }
        for k in np.flatnonzero(rigs.reference != np.arange(len(rigs.reference)))
    }


def _captures(delivery: Delivery, rigs: WrittenRigs | None) -> list[dict[str, object]]:
    camera, time = delivery.results.images.camera, f"{delivery.results.needed_date.isoformat()}T00:00:00"
    images = range(len(delivery.names))
    events = [(k, np.array([k])) for k in images] if rigs is None else rigs.with_reference()
    return [
        {
            "id": number,
            "cameras": [
                {
                    "id": int(k),
                    "sensor_id": int(camera[k]),
                    "model_source": "user",
                    "pixel_type": "uint8",
                    "pixel_range": {"min": 0, "max": 255},
                }
                for k in taken
            ],
            "reference_camera_id": first,
            "rig_model_source": "user" if len(taken) > 1 else "not_applicable",
            "time": time,
        }
        for number, (first, taken) in enumerate(events)
    ]


def _marked(
    delivery: Delivery, crs: dict[str, str]
) -> tuple[list[dict[str, object]], list[dict[str, object]]]:
    """Surveyed points with their marks: complete ones, and others."""
    points, measured = delivery.points, pixels(delivery)
    surveyed = points.surveyed_at
    gcps, mtps = [], []
    for number in np.flatnonzero(points.is_surveyed):
        name = points.names[number]
        at = surveyed[name]
        rays = np.flatnonzero(points.point == number)
        marks = [
            {"camera_id": int(points.image[ray]), "position_px": measured[ray].tolist(), "accuracy": 1.0}
            for ray in rays
        ]
        item = {"id": name, "marks": marks, "is_checkpoint": bool(points.surveyed.check[at])}
        place, sigma = points.surveyed.local[at], points.surveyed.sigma[at]
        if np.isfinite(place).all() and np.isfinite(sigma).all():
            where = {"crs": crs, "coordinates": place.tolist(), "sigmas": sigma.tolist()}
            gcps.append({**item, "geolocation": where})
        else:
            mtps.append({**item, "is_checkpoint": False})
    return gcps, mtps


def _project(name: str, cloud: list[dict[str, str]]) -> str:
    """The list of items; the cloud belongs to the calibration."""

    def identifier(of: str) -> str:
        return str(uuid.uuid5(_NAMESPACE, f"{name}/{of}"))

    def listed(kinds: Sequence[str]) -> list[dict[str, str]]:
        return [{"uri": f"{kind}.json", "format": f"application/opf-{kind}+json"} for kind in kinds]

    items = [
        {
            "id": identifier(item),
            "type": item,
            "resources": [*listed(kinds), *(cloud if item == "calibration" else [])],
            "sources": [{"id": identifier(source), "type": source} for source in sources],
        }
        for item, (kinds, sources) in _ITEMS.items()
    ]
    return _text(
        {
            "format": "application/opf-project+json",
            "version": _VERSION,
            "id": identifier("project"),
            "name": name,
            "description": "Adjusted block",
            "generator": {"name": "aerocal", "version": version("aerocal")},
            "items": items,
        }
    )


def _text(content: dict[str, object]) -> str:
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


GLTF = "tie-points.gltf"
_OFFSET_BITS = 40
_UINT32, _FLOAT32, _ARRAY_BUFFER = 5125, 5126, 34962


def cloud_files(delivery: Delivery) -> dict[str, str | bytes]:
    """The cloud, its buffers and the names of its points; none without tie points."""
    points = delivery.points
    chosen = np.flatnonzero(~points.is_surveyed & (points.rays > 0))
    if not len(chosen):
        return {}
    order = np.argsort(points.point, kind="stable")
    of_tie = order[np.isin(points.point[order], chosen)]
    count = points.rays[chosen].astype(np.uint64)
    first = np.concatenate([[0], np.cumsum(count)[:-1]]).astype(np.uint64)
    middle = points.local[chosen].mean(axis=0).round()
    x, y, z = (points.local[chosen] - middle).T
    features = np.column_stack([of_tie, np.zeros_like(of_tie)])
    none = np.zeros(len(of_tie))
    buffers = {
        "positions.bin": np.column_stack([x, z, -y]).astype("<f4"),
        "matchCameraIds.bin": points.image[of_tie].astype("<u4"),
        "matchPointIndexRanges.bin": (count << np.uint64(_OFFSET_BITS) | first).astype("<u8").view("<u4"),
        "matchPixelCoordinates.bin": pixels(delivery)[of_tie].astype("<f4"),
        "matchFeatureIds.bin": features.astype("<u4"),
        "matchScales.bin": none.astype("<f4"),
        "matchDepths.bin": none.astype("<f4"),
    }
    shapes = ("VEC3", "SCALAR", "VEC2", "VEC2", "VEC2", "SCALAR", "SCALAR")
    content = _gltf(buffers, shapes, len(delivery.names), middle.tolist())
    return {
        GLTF: json.dumps(content, indent=1) + "\n",
        **{name: values.tobytes() for name, values in buffers.items()},
        **tie_names([points.names[number] for number in chosen]),
    }


def resources(files: Sequence[str]) -> list[dict[str, str]]:
    """The files of the cloud among these, as resources of an item."""
    found = [{"uri": GLTF, "format": "model/gltf+json"}] if GLTF in files else []
    buffers = [name for name in files if name.endswith(".bin")]
    return [*found, *({"uri": name, "format": "application/gltf-buffer+bin"} for name in buffers)]


def _gltf(
    buffers: dict[str, np.ndarray], shapes: Sequence[str], cameras: int, middle: list[float]
) -> dict[str, object]:
    accessors: list[dict[str, object]] = []
    for k, (values, shape) in enumerate(zip(buffers.values(), shapes, strict=True)):
        kind = _FLOAT32 if values.dtype == np.dtype("<f4") else _UINT32
        width = 1 if shape == "SCALAR" else int(shape[-1])
        accessors.append(
            {"bufferView": k, "componentType": kind, "count": values.size // width, "type": shape}
        )
    positions = buffers["positions.bin"]
    accessors[0] |= {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
    matches = {
        "cameraUids": list(range(cameras)),
        "cameraIds": 1,
        "pointIndexRanges": 2,
        "imagePoints": {"pixelCoordinates": 3, "featureIds": 4, "scales": 5, "depths": 6},
    }
    primitive = {
        "attributes": {"POSITION": 0},
        "extensions": {"OPF_mesh_primitive_matches": matches},
        "material": 0,
        "mode": 0,
    }
    # Column by column: y-up to z-up, and back to the frame of the project.
    matrix = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, *middle, 1.0]
    extensions = ["KHR_materials_unlit", "OPF_asset_version", "OPF_mesh_primitive_matches"]
    return {
        "accessors": accessors,
        "asset": {"extensions": {"OPF_asset_version": {"version": "1.0"}}, "version": "2.0"},
        "bufferViews": [
            {"buffer": k, "byteLength": values.nbytes, "target": _ARRAY_BUFFER}
            for k, values in enumerate(buffers.values())
        ],
        "buffers": [{"uri": name, "byteLength": values.nbytes} for name, values in buffers.items()],
        "extensionsRequired": ["KHR_materials_unlit"],
        "extensionsUsed": extensions,
        "materials": [{"extensions": {"KHR_materials_unlit": {}}}],
        "meshes": [{"primitives": [primitive]}],
        "nodes": [{"matrix": matrix, "mesh": 0}],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
    }
