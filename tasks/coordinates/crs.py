"""Coordinate systems: map coordinates and heights to latitude, longitude, ellipsoidal height and back.

Everything that could be wrong silently is refused instead: transformations that ignore a datum
(``allow_ballpark=False``), grids from the network, geoid undulations taken as zero, CRSs in feet or with
other axes than east and north. Map coordinates are x = east, y = north, z = up whatever the CRS's own axis
order.

Formulas: h = H + N with a geoid grid; IGN's linear alteration H = Zg + (Z − Zg)/k with the point scale k.
The meridian convergence γ is taken from the projection itself, by differences along the meridian, and
grid = true + γ: R_grid = R_z(γ) R_enu. In degrees at 40.13 N, 74.94 W in UTM 18: +0.03867.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pyproj
from pyproj.exceptions import ProjError

from adjust.arrays import Bools, Floats
from adjust.geometry.earth import Ellipsoid
from tasks.errors import InputError, Location
from tasks.formats.crs_definition import check_usable, known_crs
from tasks.settings.coordinates import LOCAL, Heights

# Half the step of differences along a meridian: 64 m. Truncation stays below 1e-10 rad, rounding below 1e-10.
_STEP = 1e-5
# A coordinate this far (degrees) outside a CRS's area of use is taken for a mistake. Less is practice: whole
# countries are mapped in one UTM zone (Bornholm, 15° E, in the zone that ends at 12° E).
_AREA_MARGIN_DEG = 4.0


@dataclass(frozen=True)
class MapFrame:
    """A coordinate system of inputs or results: CRS and height system.

    Attributes
    ----------
    name : the CRS as declared, e.g. ``EPSG:2154``, or ``local``.
    heights : the height system as declared.
    """

    name: str
    heights: Heights

    @classmethod
    def of(cls, crs: str, heights: Heights) -> MapFrame:
        """The frame, after the CRS and the geoid grid were checked.

        Raises
        ------
        InputError
            If the CRS is unknown or not usable, or the geoid grid is missing or not one.
        """
        frame = cls(crs, heights)
        if frame.is_local:
            if heights.geoid is not None or heights.linear_alteration is not None:
                raise InputError(
                    'A geoid cannot be used with the CRS "local".',
                    'Write heights = "ellipsoidal".',
                    entity=crs,
                )
            return frame
        check_usable(frame._crs, crs)
        if heights.geoid is not None:
            _geoid_transformer(heights.geoid)
        if heights.linear_alteration is not None and (heights.geoid is None or frame._crs.is_geographic):
            raise InputError(
                "The linear alteration applies to altitudes above a geoid in a map projection.",
                "Also give the geoid grid, or remove linear_alteration.",
                entity=crs,
            )
        return frame

    @property
    def is_local(self) -> bool:
        """Whether coordinates are declared as metric Cartesian, unrelated to the earth."""
        return self.name == LOCAL

    @property
    def is_projected(self) -> bool:
        """Whether coordinates are metres in a map projection."""
        return not self.is_local and not self._crs.is_geographic

    @cached_property
    def _crs(self) -> pyproj.CRS:
        return known_crs(self.name)

    @cached_property
    def ellipsoid(self) -> Ellipsoid:
        """The ellipsoid of the CRS.

        Raises
        ------
        ValueError
            If the frame is local.
        """
        ellipsoid = self._earthly().ellipsoid
        assert ellipsoid is not None  # every CRS that passed `of` has one
        inverse = ellipsoid.inverse_flattening
        return Ellipsoid(ellipsoid.semi_major_metre, 1.0 / inverse if inverse else 0.0)

    @cached_property
    def _projection(self) -> pyproj.Transformer:
        """From map coordinates to longitude and latitude of the same datum: the projection only."""
        crs = self._earthly()
        return _transformer(crs, _geographic(crs), self.name)

    @cached_property
    def _radians_per_unit(self) -> float:
        return float(_geographic(self._earthly()).axis_info[0].unit_conversion_factor)

    @cached_property
    def _prime_meridian(self) -> float:
        """Longitude of the prime meridian from Greenwich, radians."""
        meridian = _geographic(self._earthly()).prime_meridian
        return 0.0 if meridian is None else meridian.longitude * float(meridian.unit_conversion_factor)

    def _earthly(self) -> pyproj.CRS:
        if self.is_local:
            raise ValueError("a local frame has no location on the earth")
        return self._crs

    def to_geodetic(self, x_in_map: Floats) -> Floats:
        """Latitude, longitude (radians, from Greenwich) and ellipsoidal height (metres), (n, 3).

        Not finite where the coordinates cannot be in the CRS or lie outside the geoid grid.
        """
        x_in_map = np.asarray(x_in_map, dtype=np.float64)
        latitude, longitude = self._to_latitude_longitude(x_in_map[:, 0], x_in_map[:, 1])
        height = self._ellipsoidal(latitude, longitude, x_in_map[:, 2])
        return np.stack([latitude, longitude, height], axis=-1)

    def from_geodetic(self, geodetic: Floats) -> Floats:
        """Map coordinates (n, 3) of latitude, longitude (radians), ellipsoidal height (metres)."""
        latitude, longitude, height = np.moveaxis(np.asarray(geodetic, dtype=np.float64), -1, 0)
        x, y = self._from_latitude_longitude(latitude, longitude)
        return np.stack([x, y, self._from_ellipsoidal(latitude, longitude, height)], axis=-1)

    def _to_latitude_longitude(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        return self.from_geographic_units(*self._projection.transform(x, y, errcheck=False))

    def _from_latitude_longitude(self, latitude: Floats, longitude: Floats) -> tuple[Floats, Floats]:
        longitude, latitude = self.geographic_units(latitude, longitude)
        x, y = self._projection.transform(longitude, latitude, direction="INVERSE", errcheck=False)
        return np.asarray(x), np.asarray(y)

    def geographic_units(self, latitude: Floats, longitude: Floats) -> tuple[Floats, Floats]:
        """Longitude and latitude in the unit and from the prime meridian of the datum's geographic CRS."""
        factor = self._radians_per_unit
        return (longitude - self._prime_meridian) / factor, latitude / factor

    def from_geographic_units(self, longitude: Floats, latitude: Floats) -> tuple[Floats, Floats]:
        """Latitude and longitude in radians from Greenwich; the inverse of `geographic_units`."""
        factor = self._radians_per_unit
        return np.asarray(latitude) * factor, np.asarray(longitude) * factor + self._prime_meridian

    def _ellipsoidal(self, latitude: Floats, longitude: Floats, z: Floats) -> Floats:
        if self.heights.geoid is None:
            return z
        if self.heights.linear_alteration is not None:
            ground = self.heights.linear_alteration.ground_m
            z = ground + (z - ground) / self.point_scale(latitude, longitude)
        return z + self.geoid_undulation(latitude, longitude)

    def _from_ellipsoidal(self, latitude: Floats, longitude: Floats, height: Floats) -> Floats:
        if self.heights.geoid is None:
            return height
        z = height - self.geoid_undulation(latitude, longitude)
        if self.heights.linear_alteration is not None:
            ground = self.heights.linear_alteration.ground_m
            z = ground + (z - ground) * self.point_scale(latitude, longitude)
        return z

    def geoid_undulation(self, latitude: Floats, longitude: Floats) -> Floats:
        """Undulation N (n,) of the declared geoid, metres; not finite outside the grid; radians in.

        Raises
        ------
        ValueError
            If the frame has no geoid.
        """
        if self.heights.geoid is None:
            raise ValueError("heights are ellipsoidal: there is no geoid")
        zero = np.zeros_like(latitude)
        shift = _geoid_transformer(self.heights.geoid)
        undulation = np.asarray(shift.transform(longitude, latitude, zero, radians=True, errcheck=False)[2])
        return np.where(np.isfinite(undulation), undulation, np.nan)

    def _meridian_step(self, latitude: Floats, longitude: Floats) -> tuple[Floats, Floats]:
        """Map vector of a step of 2e-5 rad along the meridian: its x and y components, (n,)."""
        x_north, y_north = self._from_latitude_longitude(latitude + _STEP, longitude)
        x_south, y_south = self._from_latitude_longitude(latitude - _STEP, longitude)
        return x_north - x_south, y_north - y_south

    def convergence(self, x_in_map: Floats) -> Floats:
        """Meridian convergence γ (n,) in radians: grid = true + γ for angles counted like κ.

        Zero for a geographic CRS and for a local frame.
        """
        x_in_map = np.asarray(x_in_map, dtype=np.float64)
        if not self.is_projected:
            return np.zeros(len(x_in_map))
        latitude, longitude = self._to_latitude_longitude(x_in_map[:, 0], x_in_map[:, 1])
        dx, dy = self._meridian_step(latitude, longitude)
        return np.arctan2(-dx, dy)

    def point_scale(self, latitude: Floats, longitude: Floats) -> Floats:
        """Point scale k (n,) of the projection: map length over length on the ellipsoid; radians in."""
        dx, dy = self._meridian_step(latitude, longitude)
        e2 = self.ellipsoid.eccentricity_squared
        radius = self.ellipsoid.semi_major_m * (1.0 - e2) / (1.0 - e2 * np.sin(latitude) ** 2) ** 1.5
        return np.hypot(dx, dy) / (2.0 * _STEP * radius)

    def inside_area_of_use(self, x_in_map: Floats) -> Bools:
        """Which plan positions (n, ≥ 2) can be in this CRS: within 4° of its area of use."""
        x_in_map = np.asarray(x_in_map, dtype=np.float64)
        if self.is_local:
            return np.asarray(np.isfinite(x_in_map[:, :2]).all(axis=1))
        latitude, longitude = self._to_latitude_longitude(x_in_map[:, 0], x_in_map[:, 1])
        inside = np.isfinite(latitude) & np.isfinite(longitude)
        area = self._crs.area_of_use
        if area is None:
            return inside
        margin = _AREA_MARGIN_DEG
        with np.errstate(invalid="ignore"):
            degrees_lat, degrees_lon = np.degrees(latitude), np.degrees(longitude)
            span = (area.east - area.west) % 360.0 or 360.0
            from_west = (degrees_lon - area.west + margin) % 360.0
            inside &= (degrees_lat >= area.south - margin) & (degrees_lat <= area.north + margin)
            inside &= (from_west <= span + 2.0 * margin) | (span + 2.0 * margin >= 360.0)
        return inside

    @property
    def description(self) -> str:
        """CRS and height system in words, for reports and file metadata; names of grids, never paths."""
        if self.is_local:
            return "metric Cartesian (local)"
        return f"{self.name} ({self._crs.name}), {self.heights_description}"

    @property
    def heights_description(self) -> str:
        """The height system in words."""
        if self.is_local:
            return "z as given"
        if self.heights.geoid is None:
            return "ellipsoidal heights"
        text = f"heights above the geoid {self.heights.geoid.name}"
        if self.heights.linear_alteration is not None:
            text += f", linear alteration with ground at {self.heights.linear_alteration.ground_m:g} m"
        return text

    @property
    def projjson(self) -> str | None:
        """The horizontal CRS as PROJJSON text; None for a local frame."""
        return None if self.is_local else self._crs.to_json()

    @property
    def crs(self) -> pyproj.CRS:
        """The horizontal CRS.

        Raises
        ------
        ValueError
            If the frame is local.
        """
        return self._earthly()


def _geographic(crs: pyproj.CRS) -> pyproj.CRS:
    geographic = crs.geodetic_crs
    assert geographic is not None  # projected and geographic CRSs have one
    return geographic if geographic.is_geographic and len(geographic.axis_info) == 2 else geographic.to_2d()


def _transformer(source: pyproj.CRS, target: pyproj.CRS, name: str) -> pyproj.Transformer:
    try:
        return pyproj.Transformer.from_crs(source, target, always_xy=True, allow_ballpark=False)
    except ProjError as error:
        raise InputError(
            f"There is no transformation from {source.name} to {target.name} ({error}).",
            "Declare a CRS of the same datum.",
            entity=name,
        ) from error


def _geoid_transformer(grid: Path) -> pyproj.Transformer:
    """Adds the undulation of a grid to a height.

    Raises
    ------
    InputError
        If the grid is missing or PROJ cannot read it.
    """
    remedy = "Give the GeoTIFF of the geoid as PROJ publishes it; undulations are never assumed to be zero."
    if not grid.is_file():
        raise Location(grid).error("The geoid grid is missing.", remedy)
    if any(mark in str(grid) for mark in '",\n'):
        raise Location(grid).error(
            "PROJ cannot open a grid whose path has commas or quotation marks.", "Rename it."
        )
    try:
        return pyproj.Transformer.from_pipeline(f'+proj=vgridshift +grids="{grid}" +multiplier=1')
    except ProjError as error:
        raise Location(grid).error("The geoid grid cannot be read.", remedy) from error
