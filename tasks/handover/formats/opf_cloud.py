"""Tie points of an OPF project: a glTF cloud whose points have their matches in the images.

Positions (float32, from the middle of the cloud) are y-up; the matrix of the node leads to ours. Pixels are float32 as well.
"""  # noqa: E501

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from tasks.handover.delivery import Delivery
from tasks.handover.formats.camera_axes import pixels
from tasks.handover.formats.short_names import tie_names

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
