"""Sources of error of direct georeferencing, and the sensitivity of any quantity to them.

Three kinds, independent of each other and all scaled to unit variance:

* of an image: the noise of its position and attitude, white or correlated over time along its strip;
* of a strip: what is common to the positions and attitudes of all its images;
* of the calibration: errors of the system parameters, common to all images and correlated with each other.

A quantity y (coordinates of intersected points, y-parallaxes) has the first-order error S ε with the matrix S
of its sensitivities. Because strips and calibration are common to many images, errors at different places are
correlated, and Σ = S Sᵀ says how.

A calibration from an adjustment of the same flight has seen the same errors of GNSS, INS and control. Then
its parameters answer to the sources of images, strips and survey as well, dp = K ε + rest, and what is
left of its covariance is independent of them. Of a quantity with dy = T ε + T_p dp the variance is that of
independent sources and X + Xᵀ, X = T Kᵀ T_pᵀ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.georeferencing.direct_orientation import DirectOrientations


@dataclass(frozen=True, eq=False)
class SharedErrors:
    """What k calibrated parameters have taken from the observations of the flight they are applied to.

    Attributes
    ----------
    of_images : (k, n, 6) derivatives of the parameters by the position (three components in the axes it is
        weighted in, metres) and attitude (small rotations in body axes, radians) of each image.
    of_survey : (k, c, 3) by the coordinates of c surveyed points, east, north, up.
    survey_spread : (c, 3, 3) L with the covariance L Lᵀ of these.
    in_adjustment : (n, 6) standard deviations the observations had there over those they have here.
    strips_in_adjustment : (s, 6) standard deviations of what is common to a strip that the adjustment knew.
    survey_in_adjustment : (c, 3) likewise over those here.
    """

    of_images: Floats
    of_survey: Floats
    survey_spread: Floats
    in_adjustment: Floats
    strips_in_adjustment: Floats
    survey_in_adjustment: Floats


@dataclass(frozen=True, eq=False)
class CalibrationErrors:
    """How well the system parameters are known.

    Attributes
    ----------
    columns : family → (entities, components) position of each parameter in the covariance, −1 where it is
        taken to be free of error.
    covariance : (k, k), SI and radians, or the family's own units.
    shared : what they have in common with the flight; None: nothing.
    """

    columns: Mapping[str, Ints]
    covariance: Floats
    shared: SharedErrors | None = None

    @property
    def factor(self) -> Floats:
        """(k, k) L with L Lᵀ = covariance."""
        return _root(self.covariance)


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

    @property
    def strips(self) -> int:
        """Number of strips s."""
        return int(self.strip.max(initial=-1)) + 1

    @cached_property
    def taken(self) -> Floats:
        """K (k, 6 n + 6 s + 3 c): what the parameters take from the sources of unit variance."""
        shared = self.calibration.shared
        if shared is None:
            return np.zeros((len(self.calibration.covariance), 0))
        images, strips = self._taken(np.ones_like(shared.in_adjustment))
        survey = _by_survey(shared, np.ones_like(shared.survey_in_adjustment))
        return np.hstack([images, strips * np.tile(self.common_to_strip, self.strips), survey])

    @cached_property
    def factor(self) -> Floats:
        """(k, k) L with L Lᵀ = covariance of the parameters less what is taken from the sources."""
        shared, covariance = self.calibration.shared, self.calibration.covariance
        if shared is None:
            return self.calibration.factor
        images, strips = self._taken(shared.in_adjustment)
        survey = _by_survey(shared, shared.survey_in_adjustment)
        known = np.hstack([images, strips * shared.strips_in_adjustment.ravel(), survey])
        return _root(covariance - known @ known.T)

    def _taken(self, factor: Floats) -> tuple[Floats, Floats]:
        """(k, 6 n) by the noise of the images, its σ times (n, 6) factors; (k, 6 s) by errors of strips.

        What is common to a strip acts by all of its exposures.
        """
        shared, orientations = self.calibration.shared, self.orientations
        assert shared is not None
        k, n = len(shared.of_images), orientations.images
        spread = np.linalg.solve(orientations.of_observations, orientations.of_noise)
        noise = (np.einsum("kni,nij->knj", shared.of_images * factor, spread)).reshape(k, 6 * n)
        if orientations.over_time is not None:
            noise = noise @ orientations.over_time
        strips = np.zeros((self.strips, k, 6))
        np.add.at(strips, self.strip, np.swapaxes(shared.of_images, 0, 1))
        return noise, np.swapaxes(strips, 0, 1).reshape(k, 6 * self.strips)


def _by_survey(shared: SharedErrors, factor: Floats) -> Floats:
    """(k, 3 c) by surveyed coordinates, their σ times (c, 3) factors."""
    by_unit = np.einsum("kci,cij->kcj", shared.of_survey * factor, shared.survey_spread)
    return np.asarray(by_unit.reshape(len(by_unit), -1))


def _root(covariance: Floats) -> Floats:
    """L (k, k) with L Lᵀ = covariance.

    From eigenvalues: correlations of ±1, rounded in a table, leave the matrix with a tiny negative one.
    """
    sigma = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    scale = np.where(sigma > 0.0, sigma, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
