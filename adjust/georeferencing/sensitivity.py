"""Sensitivity of any quantity to the sources of error of direct georeferencing.

A quantity y (coordinates of intersected points, y-parallaxes) has the first-order error S ε with the matrix S
of its sensitivities. Because strips and calibration are common to many images, errors at different places are
correlated, and Σ = S Sᵀ says how. With a calibration that shares sources with the flight, dy = T ε + T_p dp
and dp = K ε + L η: S = (T + T_p K, T_p L).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse

from adjust.arrays import Floats, Ints
from adjust.georeferencing.error_sources import ErrorSources
from adjust.observations.base import Term

# Rows whose sensitivities to a dense calibration covariance are multiplied out together.
_ROWS_AT_ONCE = 20_000


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """How q scalar quantities answer to sources of unit variance; every sparse matrix has q rows.

    Attributes
    ----------
    images : (q, 6 n) noise of the images.
    strips : (q, 6 s) errors common to strips.
    parameters : (q, k) system parameters in their own units.
    factor : (k, k) L; L Lᵀ is the part of their covariance that is independent of all else.
    survey : (q, 3 c) surveyed coordinates that were used in the calibration; None: there are none.
    taken : (k, 6 n + 6 s + 3 c) what the parameters take from images, strips and survey, or (k, 0): nothing.
    """

    images: scipy.sparse.csr_array
    strips: scipy.sparse.csr_array
    parameters: scipy.sparse.csr_array
    factor: Floats
    survey: scipy.sparse.csr_array | None = None
    taken: Floats | None = None

    def only(self, rows: Ints | slice) -> Sensitivity:
        """The sensitivities of some of the quantities."""
        survey = None if self.survey is None else self.survey[rows]
        return replace(
            self,
            images=self.images[rows],
            strips=self.strips[rows],
            parameters=self.parameters[rows],
            survey=survey,
        )

    @cached_property
    def direct(self) -> scipy.sparse.csr_array:
        """T (q, w) answers to images, strips and survey that do not go through the calibration."""
        survey = self.survey
        if survey is None:
            count = self.taken_from_all.shape[1] - self.images.shape[1] - self.strips.shape[1]
            survey = scipy.sparse.csr_array((self.images.shape[0], count))
        return scipy.sparse.csr_array(scipy.sparse.hstack([self.images, self.strips, survey]))

    @cached_property
    def taken_from_all(self) -> Floats:
        """K (k, w), zeros where nothing is taken."""
        if self.taken is None or self.taken.shape[1] == 0:
            survey = 0 if self.survey is None else self.survey.shape[1]
            width = self.images.shape[1] + self.strips.shape[1] + survey
            return np.zeros((len(self.factor), width))
        return self.taken

    @property
    def covariance_of_calibration(self) -> Floats:
        """(k, k) of the parameters, from all sources."""
        return self.factor @ self.factor.T + self.taken_from_all @ self.taken_from_all.T

    def variance_by_images(self) -> Floats:
        """(q,) variance that the noise of the images alone gives."""
        return _squared_rows(self.images)

    def variance_by_strips(self) -> Floats:
        """(q,) variance that errors common to strips alone give."""
        return _squared_rows(self.strips)

    def variance_by_survey(self) -> Floats:
        """(q,) variance that surveyed coordinates of the calibration's control alone give."""
        if self.survey is None:
            return np.zeros(self.images.shape[0])
        return _squared_rows(self.survey)

    def variance_by_calibration(self) -> Floats:
        """(q,) variance that the calibration alone gives."""
        covariance = self.covariance_of_calibration
        q = self.parameters.shape[0]
        parts = [slice(first, first + _ROWS_AT_ONCE) for first in range(0, q, _ROWS_AT_ONCE)]
        squares = [
            np.asarray(self.parameters[part].multiply(self.parameters[part] @ covariance).sum(axis=1)).ravel()
            for part in parts
        ]
        return np.concatenate([np.zeros(0), *squares])

    def shared_variance(self) -> Floats:
        """(q,) diagonal of X + Xᵀ: what the calibration shares with the rest; mostly negative."""
        both = self.parameters.multiply(self.direct @ self.taken_from_all.T)
        return 2.0 * np.asarray(both.sum(axis=1)).ravel()

    def variance(self) -> Floats:
        """(q,) variance from all sources; what rounding leaves below zero is zero."""
        alone = self.variance_by_images() + self.variance_by_strips() + self.variance_by_survey()
        return np.maximum(alone + self.variance_by_calibration() + self.shared_variance(), 0.0)

    def draws(self, random: np.random.Generator, count: int) -> Floats:
        """Errors (q, count) of as many flights."""
        count_of_sources = self.direct.shape[1]
        every = random.standard_normal((count_of_sources + self.factor.shape[1], count))
        sources, rest = every[:count_of_sources], every[count_of_sources:]
        of_calibration = self.taken_from_all @ sources + self.factor @ rest
        return np.asarray(self.direct @ sources + self.parameters @ of_calibration)

    def trace_of_square(self) -> float:
        """Tr (S Sᵀ)², without forming what a calibration from all images makes dense.

        S Sᵀ = T Tᵀ + U C Uᵀ with U = (T Kᵀ, T_p) and C = ((0, I), (I, Cov p̂)).
        """
        direct, k = self.direct, len(self.factor)
        wide = direct.shape[1] > direct.shape[0]
        products = scipy.sparse.csr_array(direct @ direct.T if wide else direct.T @ direct)
        through = np.hstack([direct @ self.taken_from_all.T, self.parameters.toarray()])
        middle = np.block([[np.zeros((k, k)), np.eye(k)], [np.eye(k), self.covariance_of_calibration]])
        across = direct.T @ through
        of_through = middle @ (through.T @ through)
        return float(
            np.sum(products.data**2)
            + 2.0 * np.sum(middle * (across.T @ across))
            + np.sum(of_through * of_through.T)
        )

    def variance_of_sum(self) -> float:
        """Variance of the sum of all quantities."""
        by_parameters = np.asarray(self.parameters.sum(axis=0)).ravel()
        by_sources = np.asarray(self.direct.sum(axis=0)).ravel() + by_parameters @ self.taken_from_all
        by_rest = by_parameters @ self.factor
        return float(by_sources @ by_sources + by_rest @ by_rest)

    def matrix(self) -> scipy.sparse.csr_array:
        """S (q, w + k), all sources of unit variance side by side."""
        direct = self.direct
        if self.taken_from_all.any():
            direct = direct + self.parameters @ scipy.sparse.csr_array(self.taken_from_all)
        calibration = scipy.sparse.csr_array(self.parameters @ scipy.sparse.csr_array(self.factor))
        return scipy.sparse.csr_array(scipy.sparse.hstack([direct, calibration]))


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
    shared = calibration.shared
    rows = quantities * of_orientation.shape[1]
    k = len(calibration.covariance)
    six = np.arange(6)
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
            quantity,
            6 * sources.strip[image][:, None] + six,
            of_orientation @ common,
            (rows, 6 * sources.strips),
        ),
        scipy.sparse.csr_array(parameters),
        sources.factor,
        None if shared is None else scipy.sparse.csr_array((rows, 3 * shared.of_survey.shape[1])),
        sources.taken,
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
