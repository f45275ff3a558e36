"""Terrain: flat, or a sum of sines whose amplitudes grow with their wavelength."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.earth import LocalFrame

_WAVES = 12


@dataclass(frozen=True)
class TerrainShape:
    """What the terrain is like; metres.

    Attributes
    ----------
    mean : mean elevation, in the frame's sense of height.
    relief : root mean square of the elevations about it; 0: flat.
    shortest, longest : wavelengths.
    """

    mean: float = 0.0
    relief: float = 0.0
    shortest: float = 400.0
    longest: float = 3000.0


@dataclass(frozen=True, eq=False)
class Terrain:
    """Elevation = mean + Σ a_k sin(k_k · x + φ_k).

    Attributes
    ----------
    mean : metres.
    amplitude : (w,) metres.  wave : (w, 2) radians per metre.  phase : (w,) radians.
    """

    mean: float
    amplitude: Floats
    wave: Floats
    phase: Floats

    def elevation(self, place: Floats) -> Floats:
        """Elevation (n,) in metres at plan positions (n, 2)."""
        result = np.full(len(place), float(self.mean))
        for amplitude, wave, phase in zip(self.amplitude, self.wave, self.phase, strict=True):
            result += amplitude * np.sin(place @ wave + phase)
        return result


def terrain_of(shape: TerrainShape, random: np.random.Generator) -> Terrain:
    """A terrain of a shape; its mean square over all the plane is the relief squared."""
    length = np.geomspace(shape.shortest, shape.longest, _WAVES)
    direction = random.uniform(0.0, np.pi, _WAVES)
    phase = random.uniform(0.0, 2.0 * np.pi, _WAVES)
    # Each sine has the mean square a²/2.
    amplitude = shape.relief * length * np.sqrt(2.0 / np.sum(length**2))
    wave = (2.0 * np.pi / length)[:, None] * np.stack([np.cos(direction), np.sin(direction)], -1)
    return Terrain(shape.mean, amplitude, wave, phase)


def raised(place: Floats, height: Floats, frame: LocalFrame) -> Floats:
    """Points (n, 3) of the local frame at plan positions (n, 2) with given heights (n,).

    The third coordinate is corrected until the frame's height agrees to 1e-10 m; the earth's curvature
    makes that two or three steps, a Cartesian frame none.
    """
    x_in_local = np.column_stack([place, height])
    for _ in range(10):
        difference = height - frame.height(x_in_local)
        x_in_local[:, 2] += difference
        if np.max(np.abs(difference), initial=0.0) < 1e-10:
            break
    return x_in_local
