"""Tie points of an OPF project: the matches of its sparse cloud (glTF with ``OPF_mesh_primitive_matches``).

| accessor | read |
|---|---|
| ``pointIndexRanges`` | one 64-bit number for each point: number of its matches × 2⁴⁰ + place of the first |
| ``cameraIds``, ``cameraUids`` | camera of each match, as a place in the list of identifiers |
| ``imagePoints.pixelCoordinates`` | column and row, float32: 0.001 px at 20,000 |
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from tasks.errors import InputError
from tasks.formats.json_value import JsonValue

_EXTENSION = "OPF_mesh_primitive_matches"
_OFFSET_BITS = 40
_OFFSETS = np.uint64((1 << _OFFSET_BITS) - 1)
_UINT32, _FLOAT32 = np.dtype("<u4"), np.dtype("<f4")
#: Component type of an accessor, and values of an element.
_COMPONENTS, _WIDTHS = {5125: _UINT32, 5126: _FLOAT32}, {"SCALAR": 1, "VEC2": 2}


@dataclass(frozen=True, eq=False)
class Tracks:
    """Matches of tie points: camera identifier and number of the point (m,), column and row (m, 2)."""

    camera: list[int]
    point: Ints
    xy: Floats


def tracks_of(gltf: JsonValue, beside: Callable[[str], bytes]) -> Tracks:
    """The matches of a glTF file.

    Parameters
    ----------
    beside : content of a buffer by its relative address.

    Raises
    ------
    InputError
        If it is damaged.
    """
    camera: list[int] = []
    point, xy, points = [np.zeros(0, np.int64)], [np.zeros((0, 2))], 0
    for mesh in gltf["meshes"].items():
        for primitive in mesh["primitives"].items():
            if not primitive.has("extensions") or not primitive["extensions"].has(_EXTENSION):
                continue
            matches = primitive["extensions"][_EXTENSION]
            known = [one.whole() for one in matches["cameraUids"].items()]
            ids = _accessor(gltf, matches["cameraIds"], beside, _UINT32, 1)[:, 0]
            ranges = _accessor(gltf, matches["pointIndexRanges"], beside, _UINT32, 2)
            packed = np.ascontiguousarray(ranges).view("<u8")[:, 0]
            seen = matches["imagePoints"]["pixelCoordinates"]
            pixel = _accessor(gltf, seen, beside, _FLOAT32, 2).astype(np.float64)
            first, count = packed & _OFFSETS, packed >> np.uint64(_OFFSET_BITS)
            ends = first + count
            if len(ids) != len(pixel) or (ends > len(ids)).any() or (ids >= len(known)).any():
                raise _damaged(matches)
            rows = [np.arange(begin, end) for begin, end in zip(first.tolist(), ends.tolist(), strict=True)]
            taken = np.concatenate([np.zeros(0, np.int64), *rows]).astype(np.int64)
            camera += [known[k] for k in ids[taken]]
            point.append(np.repeat(np.arange(points, points + len(packed)), count.astype(np.int64)))
            xy.append(pixel[taken])
            points += len(packed)
    return Tracks(camera, np.concatenate(point), np.concatenate(xy))


def _accessor(
    gltf: JsonValue, number: JsonValue, beside: Callable[[str], bytes], kind: np.dtype, width: int
) -> np.ndarray:
    """Values (n, width) of an accessor of this component type."""
    accessors, views, buffers = (gltf[name].items() for name in ("accessors", "bufferViews", "buffers"))
    accessor = _chosen(accessors, number)
    if (
        _COMPONENTS.get(accessor["componentType"].whole()) != kind
        or _WIDTHS.get(accessor["type"].text()) != width
    ):
        raise _damaged(accessor)
    view = _chosen(views, accessor["bufferView"])
    begin = sum(one["byteOffset"].whole() for one in (view, accessor) if one.has("byteOffset"))
    size = accessor["count"].whole() * width * kind.itemsize
    content = beside(_chosen(buffers, view["buffer"])["uri"].text())[begin : begin + size]
    if len(content) != size or (
        view.has("byteStride") and view["byteStride"].whole() != width * kind.itemsize
    ):
        raise _damaged(accessor)
    return np.frombuffer(content, kind).reshape(-1, width)


def _chosen(entries: list[JsonValue], number: JsonValue) -> JsonValue:
    place = number.whole()
    if place >= len(entries):
        raise _damaged(number)
    return entries[place]


def _damaged(value: JsonValue) -> InputError:
    return InputError(
        "The tie points of the sparse cloud are inconsistent.",
        "Export the project again.",
        file=value.file,
        entity=value.where[-80:],
    )
