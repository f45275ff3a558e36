"""Points in the coordinates of the program's world, and image points as classical programs take them."""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from tasks.handover.delivery import Delivery


def surveyed_points(delivery: Delivery) -> Floats:
    """(s, 3) surveyed coordinates; NaN where one is not known. In a local frame a point is known or not."""
    points = delivery.points.surveyed
    return points.local if delivery.handed.world == "local" else points.in_map


def object_points(delivery: Delivery) -> Floats:
    """(p, 3) object points."""
    return delivery.points.local if delivery.handed.world == "local" else delivery.points.in_map


def corrected_image_points(delivery: Delivery) -> Floats:
    """(m, 2) metres from the principal point, x right, y up, with all corrections of the camera."""
    return _corrected(delivery, delivery.points.xy)


def straight_image_points(delivery: Delivery) -> Floats:
    """The same without refraction, unless the orientations contain it.

    As in the adjustment it is taken from what was measured, for the height of each object point.
    """
    points, results = delivery.points, delivery.results
    if delivery.handed.refitted:
        return _corrected(delivery, points.xy)
    principal_point = np.array([one.frame.principal_point for one in results.cameras])
    x0 = principal_point[results.images.camera[points.image]]
    height = points.in_map[points.point, 2]
    return _corrected(delivery, results.images.straight_rays(points.image, points.xy - x0, height) + x0)


def _corrected(delivery: Delivery, xy: Floats) -> Floats:
    """Image points (m, 2) of the delivery from the principal point."""
    points, results = delivery.points, delivery.results
    found = np.zeros_like(xy)
    camera = results.images.camera[points.image]
    for number, one in enumerate(results.cameras):
        of_camera = camera == number
        found[of_camera] = one.corrected(xy[of_camera])
    return found


def image_lists(delivery: Delivery) -> list[tuple[int, slice]]:
    """Each image with the rows of its image points."""
    ends = np.searchsorted(delivery.points.image, np.arange(len(delivery.names) + 1))
    return [(k, slice(int(ends[k]), int(ends[k + 1]))) for k in range(len(delivery.names))]
