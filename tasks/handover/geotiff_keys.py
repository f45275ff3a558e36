"""The keys by which a GeoTIFF names its CRS (OGC 19-008r4): a code, or projection, datum and ellipsoid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import degrees

import pyproj
from pyproj.enums import WktVersion

from tasks.coordinates.crs import MapFrame

_USER_DEFINED = 32_767
_METRE, _DEGREE = 9001, 9102
_SHORTS, _DOUBLES, _TEXTS = 0, 34736, 34737
# EPSG's parameters of a method with a natural origin, and with a false one: → key.
_NATURAL = {8801: 3081, 8802: 3080, 8805: 3092, 8806: 3082, 8807: 3083}
_FALSE = {8821: 3085, 8822: 3084, 8823: 3078, 8824: 3079, 8826: 3086, 8827: 3087}
_ANGLES = frozenset({8801, 8802, 8821, 8822, 8823, 8824})
# EPSG's method → GeoTIFF's projection, and the keys of its parameters: transverse Mercator, Mercator A,
# Lambert's conformal conic with one and two parallels, oblique stereographic.
_PROJECTIONS: dict[int, tuple[int, Mapping[int, int]]] = {
    9807: (1, _NATURAL),
    9804: (7, _NATURAL),
    9802: (8, _FALSE),
    9801: (9, _NATURAL),
    9809: (16, _NATURAL),
}


@dataclass
class GeoKeys:
    """Keys with their values, as three tags hold them.

    Attributes
    ----------
    keys : key, tag of its value (0: in place), number of values, and the value or where it begins.
    doubles, texts : values of the other two tags.
    """

    keys: list[tuple[int, int, int, int]] = field(default_factory=list)
    doubles: list[float] = field(default_factory=list)
    texts: str = ""

    def add(self, key: int, value: int) -> None:
        """A code."""
        self.keys.append((key, _SHORTS, 1, value))

    def add_numbers(self, key: int, *values: float) -> None:
        """Real numbers."""
        self.keys.append((key, _DOUBLES, len(values), len(self.doubles)))
        self.doubles.extend(values)

    def add_text(self, key: int, text: str) -> None:
        """A text, without the character that ends it."""
        plain = text.encode("ascii", "replace").decode().replace("|", "/")
        self.keys.append((key, _TEXTS, len(plain) + 1, len(self.texts)))
        self.texts += f"{plain}|"

    @property
    def directory(self) -> list[int]:
        """The values of the tag of the keys."""
        return [1, 1, 0, len(self.keys)] + [number for key in sorted(self.keys) for number in key]


def geo_keys(frame: MapFrame) -> GeoKeys:
    """The keys of a CRS without an EPSG code are its parameters, where GeoTIFF has its projection.

    Of another projection they are the definition as a text in Esri's form; GDAL 3.10 shows it, but takes the
    system for a local one.
    """
    found = GeoKeys()
    found.add(1025, 1)  # a value stands for an area
    if frame.is_local:
        found.add(1024, _USER_DEFINED)
        found.add_text(1026, frame.description)
        found.add(3076, _METRE)
        return found
    crs, code = frame.crs, _code_of(frame.crs)
    found.add(1024, 2 if crs.is_geographic else 1)
    key = 2048 if crs.is_geographic else 3072
    if not crs.is_geographic:
        found.add(3076, _METRE)
    if code is None and not crs.is_geographic and _add_projection(found, crs):
        return found
    found.add(key, _USER_DEFINED if code is None else code)
    if code is None:
        found.add_text(key + 1, f"ESRI PE String = {crs.to_wkt(WktVersion.WKT1_ESRI)}")
    else:
        found.add_text(1026, crs.name)
    return found


def _add_projection(found: GeoKeys, crs: pyproj.CRS) -> bool:
    """Add a map projection by its parameters; False: GeoTIFF cannot have it."""
    own = crs.source_crs if crs.is_bound and crs.source_crs is not None else crs
    projection, below = own.coordinate_operation, own.geodetic_crs
    if projection is None or projection.method_auth_name != "EPSG" or below is None:
        return False
    code, keys = _PROJECTIONS.get(int(projection.method_code), (0, {}))
    parameters = {int(one.code or 0): one for one in projection.params}
    if set(parameters) != set(keys):
        return False
    found.add(3072, _USER_DEFINED)
    found.add_text(3073, own.name)
    found.add(3074, _USER_DEFINED)
    found.add(3075, code)
    for number, one in parameters.items():
        value = float(one.value) * one.unit_conversion_factor
        found.add_numbers(keys[number], degrees(value) if number in _ANGLES else value)
    _add_datum(found, below)
    shift = crs.coordinate_operation.towgs84 if crs.is_bound and crs.coordinate_operation else []
    if shift:
        found.add_numbers(2062, *shift)
    return True


def _add_datum(found: GeoKeys, geographic: pyproj.CRS) -> None:
    """Add longitude and latitude below a projection: a code, or ellipsoid and prime meridian."""
    code = _code_of(geographic)
    found.add(2048, _USER_DEFINED if code is None else code)
    ellipsoid, meridian = geographic.ellipsoid, geographic.prime_meridian
    if code is not None or ellipsoid is None:
        return
    found.add_text(2049, geographic.name)
    for key in (2050, 2056):
        found.add(key, _USER_DEFINED)
    found.add(2054, _DEGREE)
    found.add_numbers(2057, ellipsoid.semi_major_metre)
    found.add_numbers(2058, ellipsoid.semi_minor_metre)
    if meridian is not None and meridian.longitude:
        found.add(2051, _USER_DEFINED)
        found.add_numbers(2061, degrees(meridian.longitude * float(meridian.unit_conversion_factor)))


def _code_of(crs: pyproj.CRS) -> int | None:
    code = crs.to_epsg()
    return code if code is not None and code < _USER_DEFINED else None
