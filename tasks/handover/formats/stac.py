"""STAC 1.0 with the extension perspective-imagery 1.0.0: ``collection.json`` and an item for every image.

Positions and angles are the true ones in the map. The matrix is image from object, row by row, as in the published example. The
format has the distortion of no convention that is published, so none is written. Footprints are longitude and latitude
of WGS 84. The time of an image is known as the day of the flight.
"""  # noqa: E501

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from adjust.arrays import Floats
from tasks.coordinates.wgs84 import geodetic_on_wgs84
from tasks.errors import InputError
from tasks.files.json_text import from_json
from tasks.handover.delivery import Angles, Delivery, Files
from tasks.handover.footprint import box, footprints, geojson_polygon
from tasks.handover.formats.numbers import ANGLES, METRES, ROTATION, in_angles
from tasks.handover.formats.short_names import stem, uri_of

_EXTENSION = "https://stac-extensions.github.io/perspective-imagery/v1.0.0/schema.json"
_VERSION = "1.0.0"


def write_stac(delivery: Delivery) -> Files:
    """The collection and its items; images that see the horizon have no footprint and are refused."""
    place = delivery.results.images.map_frame
    if place.is_local:
        raise InputError(
            "STAC requires longitude and latitude, but the block is local.",
            "Write a GeoPackage (--to geopackage), which supports local coordinates.",
            entity="project.crs",
        )
    corners, below = footprints(delivery.results)
    if not below.all():
        raise InputError(
            "The image sees the horizon and has no footprint.",
            "Write another format for such images.",
            entity=f"image {delivery.names[int(np.argmin(below))]}",
        )
    geodetic = geodetic_on_wgs84(place, corners.reshape(-1, 3))
    rings = np.rad2deg(geodetic[:, 1::-1]).reshape(len(below), -1, 2).round(9)
    items = [f"item_{k}.json" for k in range(1, len(rings) + 1)]
    files = {
        name: json.dumps(_item(delivery, k, identifier, rings[k]), indent=1, ensure_ascii=False) + "\n"
        for k, (name, identifier) in enumerate(zip(items, _identifiers(delivery.names), strict=True))
    }
    return {**files, "collection.json": json.dumps(_collection(delivery, rings, items), indent=1) + "\n"}


def _identifiers(names: Sequence[str]) -> list[str]:
    """Names without folder and ending of the file; whole names if these are not unique in the collection."""
    short = [stem(name) for name in names]
    return short if len(set(short)) == len(short) else list(names)


def _item(delivery: Delivery, k: int, identifier: str, ring: Floats) -> dict[str, object]:
    pose, place = delivery.handed.pose, delivery.results.images.map_frame
    begin, end = _day(delivery)
    angles = in_angles(pose.map_from_camera[k : k + 1], Angles())[0].round(ANGLES).tolist()
    authority = place.crs.to_authority()
    epsg = authority is not None and authority[0] == "EPSG"
    return {
        "type": "Feature",
        "stac_version": _VERSION,
        "stac_extensions": [_EXTENSION],
        "id": identifier,
        "collection": delivery.results.name,
        "bbox": box(ring),
        "geometry": geojson_polygon(ring),
        "properties": {
            "datetime": None,
            "start_datetime": begin,
            "end_datetime": end,
            **dict(zip(("pers:omega", "pers:phi", "pers:kappa"), angles, strict=True)),
            "pers:perspective_center": pose.centre[k].round(METRES).tolist(),
            "pers:crs": int(authority[1]) if authority and epsg else from_json(place.projjson or "null"),
            "pers:rotation_matrix": pose.map_from_camera[k].T.round(ROTATION).ravel().tolist(),
            "pers:interior_orientation": _camera(delivery, k),
        },
        "links": [
            {"rel": "self", "href": f"./item_{k + 1}.json", "type": "application/geo+json"},
            {"rel": "collection", "href": "./collection.json", "type": "application/json"},
        ],
        "assets": {"image": {"href": uri_of(delivery.names[k]), "roles": ["data"]}},
    }


def _camera(delivery: Delivery, k: int) -> dict[str, object]:
    frame = delivery.results.cameras[delivery.results.images.camera[k]].frame
    pitch = round(frame.pixel_size * 1e3, 9)
    return {
        "camera_id": frame.name,
        "sensor_array_dimensions": [frame.columns, frame.rows],
        "pixel_spacing": [pitch, pitch],
        "focal_length": round(frame.focal_length * 1e3, 6),
        "principal_point_offset": [round(value * 1e3, 6) for value in frame.principal_point],
    }


def _collection(delivery: Delivery, rings: Floats, items: list[str]) -> dict[str, object]:
    links = [{"rel": "item", "href": f"./{name}", "type": "application/geo+json"} for name in items]
    return {
        "type": "Collection",
        "stac_version": _VERSION,
        "stac_extensions": [],
        "id": delivery.results.name,
        "description": f"Adjusted images of {delivery.results.name}",
        "license": "other",
        "extent": {
            "spatial": {"bbox": [box(rings.reshape(-1, 2))]},
            "temporal": {"interval": [list(_day(delivery))]},
        },
        "links": [{"rel": "self", "href": "./collection.json", "type": "application/json"}, *links],
    }


def _day(delivery: Delivery) -> tuple[str, str]:
    day = delivery.results.needed_date.isoformat()
    return f"{day}T00:00:00Z", f"{day}T23:59:59Z"
