"""BlocksExchange 2.1 (iTwin Capture, ContextCapture; read by Metashape, RealityScan): photos, control and tie points.

World is east, north, up of ``ENU:latitude,longitude`` at height 0, or Cartesian without a system for a local block. Camera axes are
``XRightYUp``, so ω, φ, κ would be ours; the matrix is written. Pixels count from the centre of the first one. Its P1, P2
are p2, p1 of OpenCV. Tie points have no names there: ``tie_points.csv`` has them, in their order.
"""  # noqa: E501

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.earth import TopocentricFrame
from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.camera_axes import exact, pixels
from tasks.handover.formats.numbers import METRES, fixed
from tasks.handover.formats.short_names import tie_names
from tasks.handover.lens import LensModel

_LENS = {"K1": "k1", "K2": "k2", "K3": "k3", "P1": "p2", "P2": "p1"}
_PIXEL_DECIMALS = 4


def write_blocks_exchange(delivery: Delivery) -> Files:
    """``block.xml``, and the names of its tie points."""
    root = ElementTree.Element("BlocksExchange", version="2.1")
    frame = delivery.results.images.frame
    if isinstance(frame, TopocentricFrame):
        latitude, longitude = np.rad2deg([frame.latitude, frame.longitude])
        system = _add(_add(root, "SpatialReferenceSystems"), "SRS")
        _fill(system, {"Id": "0", "Name": "block", "Definition": f"ENU:{latitude:.12f},{longitude:.12f}"})
    block = _add(root, "Block")
    _fill(block, {"Name": delivery.results.name, "Type": "Aerial"})
    if isinstance(frame, TopocentricFrame):
        _fill(block, {"SRSId": "0"})
    groups = _add(block, "Photogroups")
    for k, model in enumerate(delivery.lenses.models):
        _add_group(groups, delivery, model, np.flatnonzero(delivery.results.images.camera == k))
    ties = _add_points(block, delivery)
    ElementTree.indent(root)
    return {
        "block.xml": ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n",
        **tie_names(ties),
    }


def _add_group(groups: ElementTree.Element, delivery: Delivery, model: LensModel, images: np.ndarray) -> None:
    """A camera with its photos."""
    longer = max(model.columns, model.rows)
    (_, c), (column, row), pose = model.focal, model.principal_point, delivery.handed.pose
    group = _add(groups, "Photogroup")
    _fill(group, {"Name": model.name})
    _fill(_add(group, "ImageDimensions"), {"Width": str(model.columns), "Height": str(model.rows)})
    sensor, focal = (value * model.pixel_size * 1e3 for value in (longer, c))
    _fill(group, {"CameraModelType": "Perspective", "SensorSize": exact(sensor), "FocalLength": exact(focal)})
    _fill(group, {"CameraOrientation": "XRightYUp"})
    _fill(_add(group, "PrincipalPoint"), {"x": exact(column - 0.5), "y": exact(row - 0.5)})
    lens = {key: exact(model.distortion[name]) for key, name in _LENS.items()}
    _fill(_add(group, "Distortion"), lens)
    for k in images:
        photo = _add(group, "Photo")
        _fill(photo, {"Id": str(k), "ImagePath": delivery.names[k], "Component": "1"})
        place = _add(photo, "Pose")
        matrix = pose.map_from_camera[k].T
        _fill(
            _add(place, "Rotation"),
            {f"M_{i}{j}": exact(matrix[i, j]) for i in range(3) for j in range(3)},
        )
        _fill(_add(place, "Center"), _xyz(pose.centre[k], METRES + 2))


def _add_points(block: ElementTree.Element, delivery: Delivery) -> list[str]:
    """Complete surveyed points as control or check points; the names of all others, which are tie points."""
    points, measured = delivery.points, pixels(delivery)
    surveyed = points.surveyed_at
    control, ties = _add(block, "ControlPoints"), _add(block, "TiePoints")
    names = []
    for number, (name, rays) in enumerate(zip(points.names, points.rays_of_points, strict=True)):
        at = surveyed.get(name)
        known = at is not None and np.isfinite(points.surveyed.local[at]).all()
        item = _add(control, "ControlPoint") if known else _add(ties, "TiePoint")
        if at is not None and known:
            if block.find("SRSId") is not None:
                _fill(item, {"SRSId": "0"})
            _fill(item, {"Name": name, "Category": "Full"})
            _fill(_add(item, "Position"), _xyz(points.surveyed.local[at], METRES + 2))
            _fill(item, {"CheckPoint": "true" if points.surveyed.check[at] else "false"})
            plan, height = points.surveyed.sigma[at, :2].max(), points.surveyed.sigma[at, 2]
            accuracy = {"HorizontalAccuracy": plan, "VerticalAccuracy": height}
            _fill(item, {key: exact(value) for key, value in accuracy.items() if np.isfinite(value)})
        else:
            names.append(name)
            _fill(_add(item, "Position"), _xyz(points.local[number], METRES + 2))
        for ray in rays:
            x, y = fixed(measured[ray] - 0.5, _PIXEL_DECIMALS)
            _fill(_add(item, "Measurement"), {"PhotoId": str(points.image[ray]), "x": x, "y": y})
    return names


def _xyz(values: Floats, decimals: int) -> dict[str, str]:
    return dict(zip("xyz", fixed(values, decimals), strict=True))


def _add(parent: ElementTree.Element, name: str) -> ElementTree.Element:
    return ElementTree.SubElement(parent, name)


def _fill(parent: ElementTree.Element, texts: Mapping[str, str]) -> None:
    for name, text in texts.items():
        _add(parent, name).text = text
