"""A block in longitude, latitude and height of WGS 84: GeoJSON, and KMZ for globes."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from typing import TypeAlias
from xml.sax.saxutils import escape

import numpy as np

from adjust.arrays import Floats
from tasks.coordinates.wgs84 import geodetic_on_wgs84
from tasks.errors import InputError
from tasks.handover.delivery import Angles, Delivery, Files
from tasks.handover.footprint import counted_on, counter_clockwise, footprints, geojson_polygon
from tasks.handover.formats.numbers import in_angles

_KML_DECIMALS, _HEIGHT_DECIMALS = 8, 3
# Zip files have no time before it; one of now would make two files of the same block differ.
_LONG_AGO = (1980, 1, 1, 0, 0, 0)
_Shape: TypeAlias = tuple[str, str, Mapping[str, object], Floats]


def write_geojson(delivery: Delivery) -> Files:
    """``cameras.geojson``, ``footprints.geojson`` and ``surveyed_points.geojson`` (RFC 7946)."""
    layers: dict[str, list[dict[str, object]]] = {
        name: [] for name in ("cameras", "footprints", "surveyed_points")
    }
    for layer, name, properties, place in _shapes(delivery):
        rounded = np.column_stack([place[:, :2].round(9), place[:, 2].round(4)])
        geometry = (
            geojson_polygon(rounded)
            if len(rounded) > 1
            else {"type": "Point", "coordinates": rounded[0].tolist()}
        )
        layers[layer].append(
            {"type": "Feature", "properties": {"name": name, **properties}, "geometry": geometry}
        )
    return {
        f"{layer}.geojson": json.dumps(
            {"type": "FeatureCollection", "features": features}, ensure_ascii=False
        )
        + "\n"
        for layer, features in layers.items()
    }


def write_kmz(delivery: Delivery) -> Files:
    """``block.kmz``: a folder for each kind; absolute heights, which KML counts from the sea."""
    folders: dict[str, list[str]] = {name: [] for name in ("cameras", "footprints", "surveyed_points")}
    for layer, name, properties, place in _shapes(delivery, from_sea=True):
        corners = " ".join(
            f"{x:.{_KML_DECIMALS}f},{y:.{_KML_DECIMALS}f},{z:.{_HEIGHT_DECIMALS}f}"
            for x, y, z in counter_clockwise(counted_on(place))
        )
        shape = (
            f"<Point><altitudeMode>absolute</altitudeMode><coordinates>{corners}</coordinates></Point>"
            if len(place) == 1
            else "<Polygon><altitudeMode>absolute</altitudeMode><outerBoundaryIs><LinearRing><coordinates>"
            f"{corners}</coordinates></LinearRing></outerBoundaryIs></Polygon>"
        )
        told = ", ".join(f"{key} {value}" for key, value in properties.items())
        folders[layer].append(
            f"<Placemark><name>{escape(name)}</name><description>{escape(told)}</description>{shape}</Placemark>"
        )
    body = "".join(
        f"<Folder><name>{layer.replace('_', ' ')}</name>{''.join(marks)}</Folder>"
        for layer, marks in folders.items()
    )
    text = (
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"><Document>'
        f"<name>{escape(delivery.results.name)}</name>{body}</Document></kml>\n"
    )
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr(zipfile.ZipInfo("doc.kml", _LONG_AGO), text, zipfile.ZIP_DEFLATED)
    return {"block.kmz": stream.getvalue()}


def _shapes(delivery: Delivery, *, from_sea: bool = False) -> list[_Shape]:
    """Layer, name, properties and longitude, latitude (degrees), height (k, 3) of everything.

    Heights are ellipsoidal; with `from_sea` those of a project with a geoid are its own.
    """
    images = delivery.results.images
    if images.map_frame.is_local:
        raise InputError(
            "The format requires latitude and longitude, but the block is local.",
            "Write geopackage, which supports local blocks.",
            entity="project.crs",
        )

    def on_earth(in_map: Floats) -> Floats:
        geodetic = geodetic_on_wgs84(images.map_frame, in_map)
        from_geoid = from_sea and images.map_frame.heights.geoid is not None
        height = in_map[:, 2] if from_geoid else geodetic[:, 2]
        return np.column_stack([np.rad2deg(geodetic[:, 1::-1]), height])

    pose = delivery.handed.pose
    angles = in_angles(pose.map_from_camera, Angles())
    places = on_earth(pose.centre)
    corners, below = footprints(delivery.results)
    found: list[_Shape] = []
    for k, name in enumerate(delivery.names):
        told = {"camera": delivery.camera_names[k], "strip": delivery.results.strips[k]}
        turn = dict(zip(("omega_deg", "phi_deg", "kappa_deg"), angles[k].round(7).tolist(), strict=True))
        found.append(("cameras", name, {**told, **turn}, places[k : k + 1]))
        if below[k]:
            found.append(("footprints", name, told, on_earth(corners[k])))
    surveyed = delivery.points.surveyed
    for k in np.flatnonzero(np.isfinite(surveyed.in_map).all(axis=1)).tolist():
        role = "check" if surveyed.check[k] else "control"
        place = on_earth(surveyed.in_map[k : k + 1])
        found.append(("surveyed_points", surveyed.names[k], {"role": role}, place))
    return found
