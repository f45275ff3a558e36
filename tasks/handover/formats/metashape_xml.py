"""Metashape: calibrated cameras, orientations and markers as its XML (Import Cameras, Import Markers).

The chunk is east, north, up of the middle of the block, and the transform of the component carries it to
geocentric WGS 84; a local block has none. A camera's transform is that of its axes x right, y down, z forward
to the chunk, row by row. f is along rows; cx, cy count from the middle of the image, and P1, P2 are p2, p1.
Markers are the surveyed points that were measured, in longitude, latitude, ellipsoidal height (local: in the
chunk); check points are switched off, and pixels count from the corner of the first one. Heads of a rig are
slave sensors of their reference head, and their images slave cameras of its image.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping

import numpy as np
import pyproj

from adjust.arrays import Floats
from adjust.geometry.earth import TopocentricFrame, ecef_from_enu, ecef_from_geodetic
from tasks.coordinates.local_frame import AdjustmentFrame
from tasks.formats.earth_poses import WGS84
from tasks.formats.plain_records import CV_AXES
from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.camera_axes import exact, pixels
from tasks.handover.formats.numbers import fixed
from tasks.handover.formats.rigs import WrittenRigs, written_rigs
from tasks.handover.lens import LensModel

_LENS = {"k1": "k1", "k2": "k2", "k3": "k3", "p1": "p2", "p2": "p1"}
# Decimals of pixels.
_PIXEL = 4
# Of the chunk; its heights are ellipsoidal.
_DATUM = 4326


def write_metashape_xml(delivery: Delivery) -> Files:
    """``metashape_cameras.xml``, and ``metashape_markers.xml`` where surveyed points were measured."""
    document = ElementTree.Element("document", version="2.0.0")
    chunk = _add(document, "chunk", label=delivery.results.name, enabled="true")
    sensors = _add(chunk, "sensors")
    rigs = written_rigs(delivery)
    for number, model in enumerate(delivery.lenses.models):
        _add_mounting(_add_sensor(sensors, number, model), number, rigs)
    frame = delivery.results.images.frame
    component = _add(_add(chunk, "components", active_id="0"), "component", id="0", label="aerocal")
    if isinstance(frame, TopocentricFrame):
        _add_transform(component, frame)
    cameras, pose = _add(chunk, "cameras"), delivery.handed.pose
    matrix = np.tile(np.eye(4), (len(delivery.names), 1, 1))
    matrix[:, :3, :3], matrix[:, :3, 3] = pose.map_from_camera @ CV_AXES, pose.centre
    events = [] if rigs is None else rigs.with_reference()
    master = {int(k): first for first, images in events for k in images if k != first}
    for k, name in enumerate(delivery.names):
        known = {"id": str(k), "sensor_id": str(delivery.results.images.camera[k]), "component_id": "0"}
        slave = {"master_id": str(master[k])} if k in master else {}
        camera = _add(cameras, "camera", **known, **slave, label=name, enabled="true")
        if not slave:
            _add(camera, "transform").text = _numbers(matrix[k].ravel())
        _add(camera, "orientation").text = "1"
    return {"metashape_cameras.xml": _finished(document, chunk, frame), **_markers(delivery, frame)}


def _markers(delivery: Delivery, frame: AdjustmentFrame) -> dict[str, str]:
    points, measured = delivery.points, pixels(delivery)
    of_name = {name: k for k, name in enumerate(points.names)}
    known = [(k, name) for k, name in enumerate(points.surveyed.names) if name in of_name]
    if not known:
        return {}
    document = ElementTree.Element("document", version="2.0.0")
    chunk = _add(document, "chunk", label=delivery.results.name, enabled="true")
    cameras, markers = _add(chunk, "cameras"), _add(chunk, "markers")
    for k, name in enumerate(delivery.names):
        _add(cameras, "camera", id=str(k), label=name)
    places = _add(_add(_add(chunk, "frames"), "frame", id="0"), "markers")
    for number, (at, name) in enumerate(known):
        marker = _add(markers, "marker", id=str(number), label=name)
        place = points.surveyed.local[at]
        if np.isfinite(place).all():
            enabled = "false" if points.surveyed.check[at] else "true"
            xyz = dict(zip("xyz", map(exact, _in_chunk(place, frame)), strict=True))
            _add(marker, "reference", **xyz, enabled=enabled)
        own = _add(places, "marker", marker_id=str(number))
        for ray in np.flatnonzero(points.point == of_name[name]):
            x, y = fixed(measured[ray], _PIXEL)
            _add(own, "location", camera_id=str(points.image[ray]), pinned="true", x=x, y=y)
    return {"metashape_markers.xml": _finished(document, chunk, frame)}


def _in_chunk(place: Floats, frame: AdjustmentFrame) -> list[float]:
    """Longitude, latitude (degrees) and height of local coordinates (3,), or these."""
    if not isinstance(frame, TopocentricFrame):
        return [float(value) for value in place]
    latitude, longitude, height = frame.to_geodetic(place)
    return [float(np.rad2deg(longitude)), float(np.rad2deg(latitude)), float(height)]


def _finished(document: ElementTree.Element, chunk: ElementTree.Element, frame: AdjustmentFrame) -> str:
    """The text of a document after its chunk has been given the CRS."""
    if isinstance(frame, TopocentricFrame):
        _add(chunk, "reference").text = pyproj.CRS.from_epsg(_DATUM).to_wkt("WKT1_GDAL")
    ElementTree.indent(document)
    return ElementTree.tostring(document, encoding="unicode", xml_declaration=True) + "\n"


def _add_mounting(sensor: ElementTree.Element, number: int, rigs: WrittenRigs | None) -> None:
    """The master of a head, and how it sits beside it."""
    if rigs is None or rigs.reference[number] == number:
        return
    sensor.set("master_id", str(rigs.reference[number]))
    turn, place = rigs.back
    _add(sensor, "rotation", fixed="true").text = _numbers(turn[number].ravel())
    _add(sensor, "location", fixed="true").text = _numbers(place[number])


def _add_sensor(sensors: ElementTree.Element, number: int, model: LensModel) -> ElementTree.Element:
    size = {"width": str(model.columns), "height": str(model.rows)}
    pixel = exact(model.pixel_size * 1e3)
    (fx, fy), (column, row) = model.focal, model.principal_point
    sensor = _add(sensors, "sensor", id=str(number), label=model.name, type="frame")
    _add(sensor, "resolution", **size)
    for name in ("pixel_width", "pixel_height"):
        _add(sensor, "property", name=name, value=pixel)
    calibration = _add(sensor, "calibration", **{"type": "frame", "class": "adjusted"})
    _add(calibration, "resolution", **size)
    values: Mapping[str, float] = {
        "f": fy,
        "cx": column - 0.5 * model.columns,
        "cy": row - 0.5 * model.rows,
        "b1": fx - fy,
        **{theirs: model.distortion[ours] for theirs, ours in _LENS.items()},
    }
    for name, value in values.items():
        _add(calibration, name).text = exact(value)
    return sensor


def _add_transform(component: ElementTree.Element, frame: TopocentricFrame) -> None:
    """From the chunk to the earth."""
    transform = _add(component, "transform")
    place = np.array([frame.latitude, frame.longitude, frame.height_of_origin_m])
    _add(transform, "rotation").text = _numbers(ecef_from_enu(frame.latitude, frame.longitude).ravel())
    _add(transform, "translation").text = _numbers(ecef_from_geodetic(WGS84, place))
    _add(transform, "scale").text = "1"


def _numbers(values: Iterable[float]) -> str:
    return " ".join(exact(float(value)) for value in values)


def _add(parent: ElementTree.Element, tag: str, **attributes: str) -> ElementTree.Element:
    return ElementTree.SubElement(parent, tag, attributes)
