"""Remarks of a direct-georeferencing check, the most serious first."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import cast

from tasks.document_kit.table import Number
from tasks.files.json_text import JSON
from tasks.georeferencing.calibration import Calibration
from tasks.georeferencing.difference_statistics import CONFIDENCE
from tasks.georeferencing.directly_oriented import DirectlyOriented
from tasks.georeferencing.shared_observations import SharedExposures
from tasks.plain_text import some_of

_WAYS = ("east", "north", "up")
# A mean beyond this many of its standard deviations cannot be due to chance.
_SYSTEMATIC = 3.3
_POOR = {
    "not_determinable": "could not be determined by the calibration (cannot be separated from others)",
    "prior_only": "was not determined by the calibration but taken from its prior",
}


def difference_remarks(figures: Mapping[str, JSON], of: str) -> Iterator[str]:
    """Root mean squares and means that disagree with the prediction.

    Parameters
    ----------
    of : what the points are, such as "independent check points".
    """
    for axis, way in enumerate(_WAYS):
        rms, low, high, mean, sigma = (
            _number(figures[name], axis)
            for name in (
                "rmse_m",
                "predicted_low_m",
                "predicted_high_m",
                "mean_m",
                "predicted_mean_sigma_m",
            )
        )
        if rms is None or low is None or high is None:
            continue
        if rms > high:
            yield (
                f"The differences {way} at the {of} have a root mean square of {rms:.3f} m; expected "
                f"from the σ of image points, GNSS/INS, calibration and survey: {low:.3f} to {high:.3f} "
                f"m ({100 * CONFIDENCE:g} %). There is an error that the stated σ do not include."
            )
        if mean is not None and sigma is not None and abs(mean) > _SYSTEMATIC * sigma:
            signed = Number(mean, 3, plus=True)
            yield (
                f"The differences {way} at the {of} have a mean of {signed} m, "
                f"{abs(mean) / sigma:.1f} times its standard deviation: a systematic error."
            )


def parallax_remarks(figures: Mapping[str, JSON]) -> Iterator[str]:
    """y-parallaxes that disagree with the prediction, and mismatches among them."""
    rms, low, high = (
        _number(figures[f"y_parallax_{name}_um"]) for name in ("rms", "predicted_low", "predicted_high")
    )
    if rms is not None and low is not None and high is not None:
        expected = f"expected from the σ: {low:.1f} to {high:.1f} µm ({100 * CONFIDENCE:g} %)"
        if rms > high:
            yield f"The y-parallaxes have a root mean square of {rms:.1f} µm; {expected}."
        if rms < low:
            yield (
                f"The y-parallaxes have a root mean square of {rms:.1f} µm only; {expected}. The errors "
                "of GNSS and INS change less between successive exposures than independent errors "
                "would: declare their correlation time (adjustment.gnss_correlation_s, "
                "ins_correlation_s), or the errors common to a strip "
                "(direct_georeferencing.strip_bias_m, strip_bias_deg)."
            )
    used, mismatches = (_number(figures[f"y_parallax{name}"]) or 0.0 for name in ("es", "_mismatches"))
    if mismatches:
        yield (
            f"{mismatches:,.0f} of {used + mismatches:,.0f} y-parallaxes do not follow the relative "
            "orientation of their model. These points are mismatched and are excluded."
        )


def calibration_remarks(oriented: DirectlyOriented, calibration: Calibration) -> Iterator[str]:
    """What a reader must know about the applied calibration."""
    if calibration.is_empty:
        yield (
            "The calibration consists of the camera values in the project. They have no σ, so the "
            "prediction assumes that they are free of error."
        )
        return
    if calibration.sigmas:
        yield _of_which_flight(oriented.from_calibration)
    else:
        yield (
            "The calibration has estimated no parameter. Its values have no σ, so the prediction assumes "
            "that they are free of error."
        )
    cameras = set(oriented.given.mountings.names)
    for (parameter, entity), status in calibration.statuses.items():
        if status in _POOR and (entity in cameras or entity in oriented.flights.values()):
            yield f"{parameter} of {entity} {_POOR[status]}."
    for flight, source in oriented.flights.items():
        if flight != source:
            yield (
                f"The GNSS shift of the calibration's flight '{source}' is applied to "
                + (f"the flight '{flight}'." if flight else "this flight.")
            )


def _of_which_flight(exposures: SharedExposures) -> str:
    """Whether the prediction treats the calibration as one of this flight or of another one."""
    if exposures.of_calibration == 0:
        return (
            "The exposures used for the calibration are not known. The prediction assumes that its "
            "errors are independent of this flight, and is too large if the flight is the same."
        )
    if exposures.shared == 0:
        return (
            "The calibration was made with other exposures. The prediction assumes that its errors are "
            "independent of this flight."
        )
    return (
        f"The calibration was made with this flight ({exposures.shared:,} of its "
        f"{exposures.of_calibration:,} exposures are the same). The prediction accounts for the correlation."
    )


def coverage_remarks(
    oriented: DirectlyOriented, not_intersected: Sequence[str], *, has_models: bool
) -> Iterator[str]:
    """What is not used."""
    if oriented.not_oriented:
        yield (
            f"Measured images without position or attitude are not used ({len(oriented.not_oriented)}): "
            f"{some_of(oriented.not_oriented)}."
        )
    if not_intersected:
        yield (
            "Surveyed points that cannot be intersected (fewer than two rays, or rays nearly parallel) "
            f"are not used ({len(not_intersected)}): {some_of(not_intersected)}."
        )
    if not has_models:
        yield (
            "There are no stereo models and no y-parallaxes: no two consecutive images of a strip have "
            "common points" + ("." if any(oriented.given.strip) else ", and the exposures contain no strips.")
        )


def point_remarks(independent: int, control: int, *, is_known: bool) -> Iterator[str]:
    """Remarks on the points that the accuracy is derived from.

    Parameters
    ----------
    is_known : whether it is known which points the calibration has used; else all control counts as such.
    """
    points, were = ("points", "were") if control > 1 else ("point", "was")
    separately = "The differences there are reported separately and are no evidence of accuracy."
    if control and is_known:
        yield f"{control} surveyed {points} {were} control of the calibration. {separately}"
    elif control:
        yield (
            f"It is not known whether the given camera values were determined with the {control} control "
            f"{points}. {separately} If they were not, declare check points (inputs.control.check_points)."
        )
    if independent == 0:
        yield "There is no independent check point: the accuracy of direct georeferencing was not tested."


def _number(value: JSON, index: int | None = None) -> float | None:
    if index is not None:
        value = cast(Sequence[JSON], value)[index]
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None
