"""Coordinate reference systems as files and projects name them: known, and usable for map coordinates."""

from __future__ import annotations

import re

import pyproj
from pyproj import network
from pyproj.exceptions import CRSError

from tasks.errors import InputError

# Grids are inputs that a project names; a network that happens to answer must not change a result.
network.set_network_enabled(active=False)  # type: ignore[attr-defined]  # pyproj exports it tacitly

# "+init=FILE:…", "+nadgrids=FILE", PARAMETERFILE["…","FILE"].
_NAMES_FILE = re.compile(r"\binit\s*=|grids\s*=|PARAMETERFILE", re.IGNORECASE)

#: How the text of a CRS begins, horizontal or with heights.
WELL_KNOWN = ("PROJCS", "GEOGCS", "COMPD_CS", "PROJCRS", "GEODCRS", "GEOGCRS", "COMPOUNDCRS")


def known_crs(name: str) -> pyproj.CRS:
    """The CRS of a name, code, WKT or PROJ string.

    Raises
    ------
    InputError
        If PROJ does not know it, or if it names a file: PROJ would open that wherever it lies.
    """
    if _NAMES_FILE.search(name):
        raise _names_file(name)
    try:
        crs = pyproj.CRS.from_user_input(name)
    except CRSError as error:
        raise InputError(
            "This coordinate reference system is not known to PROJ.",
            'Give one that PROJ knows, e.g. crs = "EPSG:2154", or "local".',
            entity=name,
        ) from error
    if _NAMES_FILE.search(crs.to_wkt()):
        raise _names_file(name)
    return crs


def without_heights(name: str) -> str:
    """The CRS of a name without the heights that it may include: its code, or else its text.

    Raises
    ------
    InputError
        As of `known_crs`.
    """
    crs = known_crs(name)
    if not crs.is_compound:
        return name
    horizontal = crs.sub_crs_list[0]
    code = horizontal.to_authority()
    return horizontal.to_wkt() if code is None else ":".join(code)


def _names_file(crs: str) -> InputError:
    return InputError(
        "This CRS refers to a file.",
        'Give it by its code, e.g. crs = "EPSG:2154"; the grid of a geoid goes into `heights`.',
        entity=crs,
    )


def check_usable(crs: pyproj.CRS, name: str) -> None:
    """Refuse what is not a horizontal CRS in metres or degrees with axes to east and north.

    Raises
    ------
    InputError
    """
    if crs.is_compound or len(crs.axis_info) > 2 or crs.is_geocentric:
        raise InputError(
            "This CRS includes heights; the height system must be declared separately.",
            "Give the horizontal CRS, and `heights`.",
            entity=name,
        )
    if not (crs.is_projected or crs.is_geographic) or crs.ellipsoid is None:
        raise InputError(
            "This CRS is neither a map projection nor geographic.",
            'Give one that is, or "local".',
            entity=name,
        )
    if {axis.direction.lower() for axis in crs.axis_info} != {"east", "north"}:
        raise InputError(
            "The axes of this CRS do not point east and north.",
            "Convert the coordinates into a CRS whose axes do.",
            entity=name,
        )
    if crs.is_projected and any(abs(axis.unit_conversion_factor - 1.0) > 1e-12 for axis in crs.axis_info):
        raise InputError(
            f"This CRS is in {crs.axis_info[0].unit_name}, but coordinates must be in metres.",
            "Give the metric CRS of the same zone, and length_unit for coordinates in feet.",
            entity=name,
        )
