"""Systematic image errors: radial, shifts of CCD tiles with seams, bent corners, additional parameters.

The error e(x̄, ȳ) of reduced measured coordinates is the negative of the correction Δ: the ideal point is
x_id = x̄ − e(x̄). The measured point of an ideal one is the fixed point x̄ ← x_id + e(x̄); as e changes by
far less than its argument, a few steps settle it. At a seam between tiles there may be no such point, or
two: nothing is measured there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Bools, Floats
from adjust.camera.additional.base import ImageFormat, Tiles
from adjust.camera.additional.calibration_axes import format_in_calibration_axes
from adjust.camera.additional.correction import correction
from adjust.camera.additional.effect import effects
from adjust.camera.additional.register import AdditionalParameters, additional_parameters
from adjust.camera.additional.selection import NOTHING
from adjust.camera.interior import FrameCamera

# Zero of the radial error, as a part of the half diagonal (r³ term that vanishes at 128/162.6).
_RADIAL_ZERO = 128.0 / 162.6
_MOST_STEPS = 30
_SETTLED = 1e-15
# Less than any number that is written, metres.
_EXACT = 1e-12


@dataclass(frozen=True)
class ImageErrorSpecification:
    """Size of the systematic image errors, metres in the image.

    Attributes
    ----------
    radial : error in the corner of the format, outward positive.
    tile_shift : root mean square of the shifts of the eight outer tiles of a 3 × 3 layout.
    corner : root mean square of the displacements of the four corners.
    seams : distance of the seams from the centre along image x and y; None: the format in thirds.
    additional : additional parameters, "bluh:10" or several at once, defined in the image axes, and the
        largest error of each in the format; a negative number turns the error round.
    """

    radial: float = 0.0
    tile_shift: float = 0.0
    corner: float = 0.0
    seams: tuple[float, float] | None = None
    additional: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, eq=False)
class ImageErrors:
    """The errors of one camera.

    Attributes
    ----------
    half_format : (2,) metres.
    radial : error in the corner.
    seams : (2,) metres.
    tile_shift : (3, 3, 2) of the tiles by their place along x and y; the central one is zero.
    corner : (2, 2, 2) displacement of the corners by the signs − and + of x and y.
    additional, values : additional parameters (k) and their values (k,), which make the measured point ideal
        by −e.
    reach : how far from a seam a point may be shifted across it, metres.
    """

    half_format: Floats
    radial: float
    seams: Floats
    tile_shift: Floats
    corner: Floats
    additional: AdditionalParameters
    values: Floats
    reach: float

    def error(self, reduced: Floats) -> Floats:
        """Error e (n, 2) at reduced measured coordinates (n, 2), metres."""
        part = reduced / self.half_format
        tile = 1 + (reduced > self.seams).astype(np.int64) - (reduced < -self.seams).astype(np.int64)
        side = (reduced > 0.0).astype(np.int64)
        # Quadratic in both directions towards the corner, zero and smooth on the axes.
        weight = np.prod(part, axis=1, keepdims=True) ** 2
        bent = weight * self.corner[side[:, 0], side[:, 1]]
        error = self._radial(reduced) + self.tile_shift[tile[:, 0], tile[:, 1]] + bent
        return np.asarray(error - correction(self.additional, self.values, reduced))

    def _radial(self, reduced: Floats) -> Floats:
        diagonal = np.hypot(*self.half_format)
        rho_squared = np.sum((reduced / diagonal) ** 2, axis=1, keepdims=True)
        scale = self.radial / diagonal / (1.0 - _RADIAL_ZERO**2)
        return np.asarray(scale * reduced * (rho_squared - _RADIAL_ZERO**2))

    def ideal_from_measured(self, reduced: Floats) -> Floats:
        """Ideal coordinates (n, 2) of reduced measured ones."""
        return np.asarray(reduced - self.error(reduced))

    def measured_from_ideal(self, ideal: Floats) -> tuple[Floats, Bools]:
        """Reduced measured coordinates (n, 2) of ideal ones, and whether there is exactly one (n,)."""
        # Errors that grow too fast with the distance from the middle have no such point in the corners.
        with np.errstate(over="ignore", invalid="ignore"):
            reduced = ideal + self.error(ideal)
            for _ in range(_MOST_STEPS):
                following = ideal + self.error(reduced)
                moved = np.abs(following - reduced).max(axis=1, initial=0.0)
                reduced = following
                if np.all(moved < _SETTLED):
                    break
            distance = np.min(np.abs(np.abs(reduced) - self.seams), axis=1)
        return reduced, np.asarray((distance > self.reach) & (moved < _EXACT))


def image_errors_of(
    specification: ImageErrorSpecification, camera: FrameCamera, random: np.random.Generator
) -> ImageErrors:
    """The errors of a camera; directions of tile shifts and corners are drawn, their RMS is as specified."""
    half = np.array(camera.half_format)
    tiles, corners = random.standard_normal((3, 3, 2)), random.standard_normal((2, 2, 2))
    tiles[1, 1] = 0.0
    # RMS over the shifted tiles (corners) of the length in one coordinate.
    tiles *= specification.tile_shift / np.sqrt(np.sum(tiles**2) / 16.0)
    corners *= specification.corner / np.sqrt(np.mean(corners**2))
    seams = _seams(specification, camera)
    parameters, values = _additional(specification, image_format_of(specification, camera))
    # The distortion of the ideal point has no seams.
    jumping = effects(parameters).largest[~parameters.forward] * np.abs(values[~parameters.forward])
    jump = float(np.abs(tiles).max()) + len(jumping) * float(jumping.max(initial=0.0))
    reach = 2.0 * jump + _SETTLED if jump > 0.0 else -1.0
    return ImageErrors(half, specification.radial, seams, tiles, corners, parameters, values, reach)


def _seams(specification: ImageErrorSpecification, camera: FrameCamera) -> Floats:
    if specification.seams is None:
        return np.asarray(np.array(camera.half_format) / 3.0)
    return np.array(specification.seams)


def image_format_of(specification: ImageErrorSpecification, camera: FrameCamera) -> ImageFormat:
    """The image of a camera with the seams of its tiles; calibration axes are image axes."""
    x, y = (float(seam) for seam in _seams(specification, camera))
    return format_in_calibration_axes(camera.half_format, 0, Tiles((-x, x), (-y, y)), camera.focal_length)


def _additional(
    specification: ImageErrorSpecification, image_format: ImageFormat
) -> tuple[AdditionalParameters, Floats]:
    """The additional parameters of a camera and the values that have the given effects."""
    sizes = {
        name: size
        for selection, size in specification.additional
        for name in additional_parameters(selection, image_format).names
    }
    parameters = additional_parameters("+".join(sizes) or NOTHING, image_format)
    largest = np.array([sizes[name] for name in parameters.names])
    return parameters, largest / effects(parameters).largest if sizes else largest
