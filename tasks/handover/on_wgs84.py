"""A block in a frame of WGS 84, for programs whose local frames are always of that datum.

Rotation and shift are those at the origin of the frame; a change of scale between the datums, some
millionths, stays out of the block.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.earth import TopocentricFrame, ecef_from_geodetic
from tasks.coordinates.wgs84 import geodetic_on_wgs84, to_wgs84
from tasks.handover.delivery import Delivery

# Below this, datums are the same to every digit that is written.
_SAME_M = 1e-3


def block_on_wgs84(delivery: Delivery) -> Delivery:
    """The block in a frame east, north, up of WGS 84 at height 0; one that is there, or local, as it is.

    Raises
    ------
    InputError
        As of `to_wgs84`.
    """
    results, images = delivery.results, delivery.results.images
    frame, transfer = images.frame, None if images.map_frame.is_local else to_wgs84(images.map_frame)
    if transfer is None or not isinstance(frame, TopocentricFrame):
        return delivery
    wgs84, given = transfer.target, np.array([[frame.latitude, frame.longitude, frame.height_of_origin_m]])
    origin = images.map_frame.from_geodetic(given)
    place = geodetic_on_wgs84(images.map_frame, origin)
    away = ecef_from_geodetic(wgs84.ellipsoid, place) - ecef_from_geodetic(frame.ellipsoid, given)
    if np.abs(away).max() < _SAME_M:
        return delivery
    there = TopocentricFrame(wgs84.ellipsoid, float(place[0, 0]), float(place[0, 1]))
    turn, shift = transfer.target_enu_from_source_enu(origin)[0], there.from_geodetic(place)[0]

    def moved(local: Floats) -> Floats:
        return np.asarray(local @ turn.T + shift)

    pose, points = delivery.handed.pose, delivery.points
    turned = turn @ pose.map_from_camera
    pose = replace(pose, centre=moved(pose.centre), map_from_camera=turned)
    images = replace(
        images, map_frame=wgs84, frame=there, projection_centre=pose.centre, local_from_camera=turned
    )
    surveyed = replace(points.surveyed, local=moved(points.surveyed.local))
    return replace(
        delivery,
        results=replace(results, images=images),
        handed=replace(delivery.handed, pose=pose),
        points=replace(points, local=moved(points.local), surveyed=surveyed),
    )
