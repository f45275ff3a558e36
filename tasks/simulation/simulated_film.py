"""Simulated film: how each image is deformed and placed in the scanner, and its measured fiducial marks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.simulate.random_streams import RandomStreams, Source
from tasks.settings.simulation import SimulatedFilm

_UM, _MM = 1e-6, 1e-3


@dataclass(frozen=True, eq=False)
class DeformedFilm:
    """The film of n images with k marks.

    Attributes
    ----------
    stretch, shift : (n, 2, 2), (n, 2) scan from camera, x_s = stretch x + shift; metres.
    marks : names of the marks.
    calibrated : (k, 2) coordinates in the camera, metres.
    measured : (n, k, 2) coordinates in the scan, with noise.
    """

    stretch: Floats
    shift: Floats
    marks: tuple[str, ...]
    calibrated: Floats
    measured: Floats

    def scanned(self, image: Ints, xy: Floats) -> Floats:
        """Coordinates (m, 2) in the scan of points (m, 2) in the images (m,)."""
        return np.asarray(np.einsum("mij,mj->mi", self.stretch[image], xy) + self.shift[image])

    @property
    def coefficients(self) -> Floats:
        """(n, 2, 3) true transformation to the camera: a0, a1, a2 and b0, b1, b2, metres."""
        back = np.linalg.inv(self.stretch)
        return np.concatenate([-np.einsum("nij,nj->ni", back, self.shift)[:, :, None], back], axis=2)


def deformed_film(film: SimulatedFilm, images: int, seed: int, level: float) -> DeformedFilm:
    """The film of a simulation; `level` is a factor of the noise of the marks, not of the deformation."""
    streams = RandomStreams(seed)
    drawn = streams.of(Source.FILM).standard_normal((images, 6))
    own = drawn[:, :4].reshape(-1, 2, 2) * film.affine_ppm * 1e-6
    stretch = np.eye(2) * (1.0 - film.shrinkage_ppm * 1e-6) + own
    shift = drawn[:, 4:] * film.shift_mm * _MM
    calibrated = np.array(list(film.fiducials_mm.values()), dtype=np.float64) * _MM
    placed = np.einsum("nij,kj->nki", stretch, calibrated) + shift[:, None]
    noise = streams.of(Source.FIDUCIAL_NOISE).standard_normal(placed.shape) * film.fiducial_um * _UM
    return DeformedFilm(stretch, shift, tuple(film.fiducials_mm), calibrated, placed + level * noise)
