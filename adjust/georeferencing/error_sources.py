"""Sources of error of direct georeferencing, and how any quantity answers to them.

Three kinds, independent of each other and all scaled to unit variance:

* of an image: the noise of its position and attitude, white or correlated over time along its strip;
* of a strip: what is common to the positions and attitudes of all its images;
* of the calibration: errors of the system parameters, common to all images and correlated with each other.

A quantity y (coordinates of intersected points, y-parallaxes) has the first-order error S ε with the matrix S
of its sensitivities. Because strips and calibration are common to many images, errors at different places are
correlated, and Σ = S Sᵀ says how.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse

from adjust.arrays import Floats, Ints
from adjust.georeferencing.direct_orientation import DirectOrientations
from adjust.observations.base import Term

# Rows whose sensitivities to a dense calibration covariance are multiplied out together.
_ROWS_AT_ONCE = 20_000


@dataclass(frozen=True, eq=False)
class CalibrationErrors:
    """How well the system parameters are known.

    Attributes
    ----------
    columns : family → (entities, components) position of each parameter in the covariance, −1 where it is
        taken to be free of error.
    covariance : (k, k), SI and radians, or the family's own units.
    """

    columns: Mapping[str, Ints]
    covariance: Floats

    @property
    def factor(self) -> Floats:
        """(k, k) L with L Lᵀ = covariance.

        From eigenvalues: correlations of ±1, rounded in a table, leave the matrix with a tiny negative one.
        """
        sigma = np.sqrt(np.diagonal(self.covariance))
        scale = np.where(sigma > 0.0, sigma, 1.0)
        values, vectors = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


@dataclass(frozen=True, eq=False)
class ErrorSources:
    """All sources of error of n directly georeferenced images.

    Attributes
    ----------
    orientations : the images with their noise.
    strip : (n,) index of the strip of each image.
    common_to_strip : (6,) standard deviations of what is common to a strip: positions in the axes they are
        weighted in (metres), attitudes in body axes (radians).
    calibration : errors of the system parameters.
    """

    orientations: DirectOrientations
    strip: Ints
    common_to_strip: Floats
    calibration: CalibrationErrors


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """How q scalar quantities answer to sources of unit variance; every matrix has q rows.

    Attributes
    ----------
    images : (q, 6 n) noise of the images.
    strips : (q, 6 s) errors common to strips.
    parameters : (q, k) system parameters in their own units.
    factor : (k, k) L with the covariance L Lᵀ of these.
    """

    images: scipy.sparse.csr_array
    strips: scipy.sparse.csr_array
    parameters: scipy.sparse.csr_array
    factor: Floats

    def only(self, rows: Ints | slice) -> Sensitivity:
        """The sensitivities of some of the quantities."""
        return Sensitivity(self.images[rows], self.strips[rows], self.parameters[rows], self.factor)

    def variance_by_images(self) -> Floats:
        """(q,) variance that comes from the noise of the images."""
        return _squared_rows(self.images)

    def variance_by_strips(self) -> Floats:
        """(q,) variance that comes from errors common to strips."""
        return _squared_rows(self.strips)

    def variance_by_calibration(self) -> Floats:
        """(q,) variance that comes from the calibration."""
        q = self.parameters.shape[0]
        parts = [slice(first, first + _ROWS_AT_ONCE) for first in range(0, q, _ROWS_AT_ONCE)]
        squares = [np.sum((self.parameters[part] @ self.factor) ** 2, axis=1) for part in parts]
        return np.concatenate([np.zeros(0), *squares])

    def variance(self) -> Floats:
        """(q,) variance from all sources."""
        return self.variance_by_images() + self.variance_by_strips() + self.variance_by_calibration()

    def matrix(self) -> scipy.sparse.csr_array:
        """S (q, 6 n + 6 s + k), all sources of unit variance side by side."""
        calibration = scipy.sparse.csr_array(self.parameters @ scipy.sparse.csr_array(self.factor))
        return scipy.sparse.csr_array(scipy.sparse.hstack([self.images, self.strips, calibration]))


def sensitivity(
    sources: ErrorSources,
    quantities: int,
    quantity: Ints,
    image: Ints,
    of_orientation: Floats,
    of_system: tuple[Term, ...] = (),
) -> Sensitivity:
    """Sensitivities of quantities with c components each, from what they take from single images.

    Parameters
    ----------
    quantities : how many there are; component a of quantity i has the row c i + a.
    quantity, image : (r,) which quantity takes something from which image; contributions add up.
    of_orientation : (r, c, 6) derivatives of the quantity by the elements of the image's orientation.
    of_system : derivatives (r, c, d) by system parameters that do not go through the orientation.
    """
    orientations, calibration = sources.orientations, sources.calibration
    rows = quantities * of_orientation.shape[1]
    k = len(calibration.covariance)
    six = np.arange(6)
    strips = int(sources.strip.max(initial=-1)) + 1
    common = orientations.of_observations[image] * sources.common_to_strip
    through_orientation = [
        Term(term.block, term.index[image], of_orientation @ term.jacobian[image])
        for term in orientations.terms
    ]
    parameters = scipy.sparse.csr_array((rows, k))
    for term in (*through_orientation, *of_system):
        if term.block in calibration.columns:
            column = calibration.columns[term.block][term.index]
            parameters = parameters + _scattered(quantity, column, term.jacobian, (rows, k))
    noise = _scattered(
        quantity,
        6 * image[:, None] + six,
        of_orientation @ orientations.of_noise[image],
        (rows, 6 * orientations.images),
    )
    if orientations.over_time is not None:
        noise = scipy.sparse.csr_array(noise @ orientations.over_time)
    return Sensitivity(
        noise,
        _scattered(
            quantity, 6 * sources.strip[image][:, None] + six, of_orientation @ common, (rows, 6 * strips)
        ),
        scipy.sparse.csr_array(parameters),
        calibration.factor,
    )


def _scattered(
    quantity: Ints, column: Ints, values: Floats, shape: tuple[int, int]
) -> scipy.sparse.csr_array:
    """Values (r, c, d) summed into the rows of their quantities and columns (r, d); −1 is left out."""
    components = values.shape[1]
    row = components * quantity[:, None, None] + np.arange(components)[None, :, None]
    row, place = np.broadcast_arrays(row, column[:, None, :])
    kept = (place >= 0) & (values != 0.0)
    return scipy.sparse.csr_array(
        scipy.sparse.coo_array((values[kept], (row[kept], place[kept])), shape=shape)
    )


def _squared_rows(matrix: scipy.sparse.csr_array) -> Floats:
    """Sum of squares of each row."""
    return np.asarray(matrix.multiply(matrix).sum(axis=1), dtype=np.float64).ravel()
