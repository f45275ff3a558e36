"""From the coordinate system of an input into that of the project: positions and axes.

Within one datum this is projection and heights only. Between two datums the best published
transformation is used; if PROJ lacks a grid for it, the input is refused instead of being served the next
best one, which may be metres worse.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pyproj
from pyproj.exceptions import ProjError
from pyproj.transformer import TransformerGroup

from adjust.arrays import Floats
from adjust.geometry.earth import ecef_from_enu, ecef_from_geodetic, geodetic_from_ecef
from adjust.geometry.rotation import about_z
from tasks.coordinates.crs import MapFrame
from tasks.errors import InputError

# Length of the vectors whose images give the rotation between two datums: 1e-8 m are 1e-11 rad.
_PROBE_M = 1000.0


@dataclass(frozen=True)
class Transfer:
    """The way from one map frame into another.

    Attributes
    ----------
    source, target : the frames.

    Raises
    ------
    InputError
        From `between`: if only one of the frames is local, or there is no transformation of full accuracy.
    """

    source: MapFrame
    target: MapFrame

    @classmethod
    def between(cls, source: MapFrame, target: MapFrame) -> Transfer:
        """The transfer, after it was checked that it exists."""
        if source.is_local != target.is_local:
            raise InputError(
                'Coordinates in the CRS "local" cannot be combined with others.',
                'Declare "local" for the project and all its inputs, or for none.',
                entity=source.name if source.is_local else target.name,
            )
        transfer = cls(source, target)
        if not transfer.is_identity and not transfer._same_datum:
            _ = transfer._datum_operation
        return transfer

    @property
    def is_identity(self) -> bool:
        """Whether both frames are the same: then nothing is touched, not even the last digit."""
        return self.source == self.target

    @property
    def keeps_datum(self) -> bool:
        """Whether both frames have the same datum, so that east, north and up are the same."""
        return self.is_identity or self.source.is_local or self._same_datum

    @cached_property
    def _same_datum(self) -> bool:
        source, target = self.source.crs.geodetic_crs, self.target.crs.geodetic_crs
        assert source is not None
        assert target is not None
        return source.datum == target.datum or source.equals(target, ignore_axis_order=True)

    @cached_property
    def _datum_operation(self) -> pyproj.Transformer:
        source, target = (frame.crs.geodetic_crs for frame in (self.source, self.target))
        assert source is not None
        assert target is not None
        remedy = (
            "Convert the coordinates into the datum of the project, or declare a project CRS of their datum."
        )
        what = f"There is no full transformation from {source.name} to {target.name}"
        try:
            with warnings.catch_warnings():
                # PROJ's warning about a missing grid becomes the error below.
                warnings.simplefilter("ignore", UserWarning)
                group = TransformerGroup(source.to_3d(), target.to_3d(), always_xy=True, allow_ballpark=False)
        except ProjError as error:
            raise InputError(f"{what} ({error}).", remedy, entity=self.source.name) from error
        if not group.transformers:
            raise InputError(f"{what}.", remedy, entity=self.source.name)
        if not group.best_available:
            grids = sorted(
                {g.short_name for op in group.unavailable_operations for g in op.grids if not g.available}
            )
            raise InputError(
                f"{what}: PROJ lacks the grid {', '.join(grids)}.", remedy, entity=self.source.name
            )
        return group.transformers[0]

    def _geodetic_in_target(self, geodetic: Floats) -> Floats:
        if self._same_datum:
            return geodetic
        longitude, latitude = self.source.geographic_units(geodetic[:, 0], geodetic[:, 1])
        lon, lat, height = self._datum_operation.transform(
            longitude, latitude, geodetic[:, 2], errcheck=False
        )
        return np.stack([*self.target.from_geographic_units(lon, lat), np.asarray(height)], axis=-1)

    def positions(self, x_in_source: Floats) -> Floats:
        """Positions (n, 3) in the target frame; not finite where there is no image (outside a geoid grid)."""
        if self.is_identity or self.source.is_local:
            return np.asarray(x_in_source, dtype=np.float64)
        return self.target.from_geodetic(self._geodetic_in_target(self.source.to_geodetic(x_in_source)))

    def target_enu_from_source_enu(self, x_in_source: Floats) -> Floats:
        """Rotations (n, 3, 3) between the east, north, up axes of the two datums at each position.

        Identity within one datum; some seconds of arc between two.
        """
        identity = np.broadcast_to(np.eye(3), (len(x_in_source), 3, 3))
        if self.keeps_datum:
            return identity
        geodetic = self.source.to_geodetic(x_in_source)
        origin = ecef_from_geodetic(self.source.ellipsoid, geodetic)
        source_axes = ecef_from_enu(geodetic[:, 0], geodetic[:, 1])
        image = self._geodetic_in_target(geodetic)
        target_origin = ecef_from_geodetic(self.target.ellipsoid, image)
        target_axes = ecef_from_enu(image[:, 0], image[:, 1])
        columns = []
        for axis in range(3):
            probe = geodetic_from_ecef(self.source.ellipsoid, origin + _PROBE_M * source_axes[:, :, axis])
            end = ecef_from_geodetic(self.target.ellipsoid, self._geodetic_in_target(probe))
            columns.append((end - target_origin) / _PROBE_M)
        rotation = np.swapaxes(target_axes, -1, -2) @ np.stack(columns, axis=-1)
        # The nearest rotation: the transformation's scale (parts per million) does not belong to the axes.
        left, _, right = np.linalg.svd(rotation)
        return np.asarray(left @ right)

    def target_grid_from_source_enu(self, x_in_source: Floats, x_in_target: Floats) -> Floats:
        """Rotations (n, 3, 3): grid axes of the target from the east, north, up axes of the source."""
        return about_z(self.target.convergence(x_in_target)) @ self.target_enu_from_source_enu(x_in_source)

    def target_grid_from_source_grid(self, x_in_source: Floats, x_in_target: Floats) -> Floats:
        """Rotations (n, 3, 3): grid axes of the target from grid axes of the source, at each position."""
        return self.target_grid_from_source_enu(x_in_source, x_in_target) @ about_z(
            -self.source.convergence(x_in_source)
        )

    @property
    def accuracy_m(self) -> float | None:
        """Published accuracy of the datum change in metres; None if there is none or it is not known."""
        if self.keeps_datum:
            return None
        return self._datum_operation.accuracy if self._datum_operation.accuracy >= 0.0 else None

    @property
    def description(self) -> str:
        """What is done, in words, for reports."""
        if self.is_identity:
            return "none"
        text = f"{self.source.description} → {self.target.description}"
        if self.source.is_local or self._same_datum:
            return text
        accuracy = "unknown" if self.accuracy_m is None else f"{self.accuracy_m:g} m"
        return f"{text} by {self._datum_operation.description}, accuracy {accuracy}"
