"""Places on WGS 84, for programs and formats that know no other datum.

Longitude and latitude of another datum are up to hundreds of metres away from those of WGS 84, and with its
ellipsoid distances along the ground differ by 0.1 ‰. So positions go through the best published change of
datum, and are refused without one. A CRS of a datum that PROJ does not know is taken as it is if its
ellipsoid has the axis of WGS 84.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from adjust.arrays import Floats
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.datum_change import Transfer
from tasks.errors import InputError
from tasks.settings.coordinates import ELLIPSOIDAL


def geodetic_on_wgs84(place: MapFrame, x_in_map: Floats) -> Floats:
    """Latitude, longitude (radians) and ellipsoidal height (n, 3) of map coordinates (n, 3).

    Raises
    ------
    InputError
        As of `to_wgs84`.
    """
    transfer = to_wgs84(place)
    if transfer is None:
        return place.to_geodetic(x_in_map)
    longitude, latitude, height = transfer.positions(x_in_map).T
    return np.column_stack([np.radians(latitude), np.radians(longitude), height])


@lru_cache(maxsize=8)
def to_wgs84(place: MapFrame) -> Transfer | None:
    """The way from a map to longitude, latitude (degrees) and height; None: it is on WGS 84.

    Raises
    ------
    InputError
        If there is no published transformation of full accuracy.
    """
    wgs84 = MapFrame.of("EPSG:4326", ELLIPSOIDAL)
    try:
        transfer = Transfer.between(place, wgs84)
    except InputError as error:
        if place.ellipsoid.semi_major_m == wgs84.ellipsoid.semi_major_m:
            return None
        raise InputError(
            error.what,
            "Adjust in a CRS of WGS 84 or ETRS89, or write a format without a place on the earth (colmap, "
            "openmvg, opf).",
            entity="project.crs",
        ) from error
    return None if transfer.keeps_datum else transfer
