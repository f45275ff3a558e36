"""Values of one set of additional parameters from those of another: another direction or convention.

Coefficients are never copied between directions. The given values make measured points over the format ideal;
the values of the other set are those that do so with the least squares of

    r = x̄ + Δ(x̄) − x_id − D(x_id),

and what is left of r, in the measured image, is the misfit of the conversion. Focal length and principal
point are the same before and after.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.calibration_axes import calibration_from_image
from adjust.camera.additional.correction import distortion_at, ideal_from_measured, is_invertible
from adjust.camera.additional.evaluation import correction_and_derivatives, total_correction
from adjust.camera.additional.forward import Distortion
from adjust.camera.additional.register import AdditionalParameters
from adjust.errors import AdditionalParametersError

#: A larger misfit, metres, is worth a warning: a tenth of what the best cameras are measured with.
NOTEWORTHY = 1e-7
_POINTS_ACROSS = 51
_MOST_STEPS = 10
# Of the largest effect of a step, metres.
_SETTLED = 1e-12


@dataclass(frozen=True, eq=False)
class Conversion:
    """Values of other additional parameters with the same effect on the image.

    Attributes
    ----------
    parameters, values : what was requested, and its values (k,).
    xy : (n, 2) measured points over the format, edges included, metres from the principal point, image axes.
    misfit : (n, 2) what the values leave at these points, metres in the measured image.
    """

    parameters: AdditionalParameters
    values: Floats
    xy: Floats
    misfit: Floats

    @property
    def largest(self) -> float:
        """Length of the largest misfit, metres."""
        return float(np.linalg.norm(self.misfit, axis=1).max())

    @property
    def rms(self) -> float:
        """Root mean square length of the misfit, metres."""
        return float(np.sqrt(np.mean(np.sum(self.misfit**2, axis=1))))


def converted(
    given: AdditionalParameters,
    values: Floats,
    wanted: AdditionalParameters,
    principal_point: tuple[float, float] = (0.0, 0.0),
) -> Conversion:
    """Values of wanted parameters for given ones (k,).

    Parameters
    ----------
    given, wanted : of the same image format.
    principal_point : (x0, y0) from the format centre, metres.

    Raises
    ------
    AdditionalParametersError
        If the given distortion folds the image over, or the wanted parameters cannot be separated from each
        other over the format.
    """
    xy = refuse_folded(given, values, np.array(principal_point))
    return fitted(wanted, xy, ideal_from_measured(given, values, xy))


def fitted(wanted: AdditionalParameters, xy: Floats, ideal: Floats) -> Conversion:
    """Values of parameters that make measured points (n, 2) ideal ones (n, 2).

    Both count from the principal point, metres.

    Raises
    ------
    AdditionalParametersError
        If the parameters cannot be separated from each other with these points.
    """
    found = np.zeros(len(wanted.names))
    for _ in range(_MOST_STEPS):
        residual, derivatives = _equations(wanted, found, xy, ideal)
        step = _least_squares(derivatives.reshape(-1, len(found)), -residual.ravel())
        found = found + step
        if np.abs(derivatives @ step).max(initial=0.0) < _SETTLED:
            break
    corrected = xy + total_correction(wanted.only("correction"), xy, found[~wanted.forward])
    return Conversion(wanted, found, xy, corrected - ideal - distortion_at(wanted, found, ideal))


def refuse_folded(parameters: AdditionalParameters, values: Floats, principal_point: Floats) -> Floats:
    """Points (n, 2) over the format, metres from a principal point (2,), each of which has an ideal point.

    Raises
    ------
    AdditionalParametersError : if the distortion folds the image over.
    """
    xy = _grid(parameters) - principal_point
    if not is_invertible(parameters, values, xy).all():
        raise AdditionalParametersError(
            "The given distortion folds the image over: points of the format have no ideal point.",
            "Check the coefficients, their convention and the focal length.",
        )
    return xy


def _grid(parameters: AdditionalParameters) -> Floats:
    """Points (n, 2) over the format in image axes, from its centre, edges included."""
    image_format, turn = parameters.image_format, calibration_from_image(parameters.turn_deg)
    half_x, half_y = np.abs(turn.T @ [image_format.half_x, image_format.half_y])
    x, y = np.meshgrid(*(np.linspace(-half, half, _POINTS_ACROSS) for half in (half_x, half_y)))
    return np.column_stack([x.ravel(), y.ravel()])


def _equations(
    wanted: AdditionalParameters, values: Floats, xy: Floats, ideal: Floats
) -> tuple[Floats, Floats]:
    """Residuals r (n, 2) of values (k,), and their derivatives (n, 2, k), metres."""
    forward = wanted.forward
    residual, derivatives = xy - ideal, np.zeros((len(xy), 2, len(values)))
    if not forward.all():
        corrections = wanted.only("correction")
        correction, derivatives[:, :, ~forward] = correction_and_derivatives(
            corrections, xy, values[~forward]
        )
        residual = residual + correction
    if forward.any():
        c = wanted.image_format.needed_focal_length
        d, basis = correction_and_derivatives(Distortion.of(wanted), ideal / c, values[forward])
        residual, derivatives[:, :, forward] = residual - c * d, -c * basis
    return residual, derivatives


def _least_squares(columns: Floats, right: Floats) -> Floats:
    """Solution with the columns brought to the same length: powers of metres are of all sizes."""
    length = np.linalg.norm(columns, axis=0)
    solution, _, rank, _ = np.linalg.lstsq(columns / length, right, rcond=1e-12)
    if rank < len(length):
        raise AdditionalParametersError(
            "The additional parameters to convert to cannot be separated from each other over the image.",
            "Choose fewer of them.",
        )
    return np.asarray(solution / length)
