"""Limits in words."""

from __future__ import annotations

_GATE_WORDS = {
    "sigma0": "σ0",
    "rmse_control_m": "RMS at control points",
    "max_control_m": "largest residual at control points",
    "rmse_check_m": "RMS at check points",
    "check_over_limit": "check points beyond their limits",
    "max_check_m": "largest difference at check points",
    "direct_georeferencing_rmse_m": "RMS at check points, direct georeferencing",
    "direct_georeferencing_max_m": "largest difference at check points, direct georeferencing",
    "y_parallax_rms_um": "RMS of the y-parallaxes",
    "y_parallax_max_um": "largest y-parallax",
    "registered_calibration": "agreement with the calibration of the registry",
    "trust_map_plan_m": "horizontal σ of new points",
    "trust_map_height_m": "vertical σ of new points",
    "trust_map_external_m": "effect of undetected errors on new points",
    "missed_limits_of_calibration": "limits not met by the calibration flight",
}


def gate_words(name: str) -> str:
    """The name of a limit in words; that of a component ends with its axis."""
    for known, words in _GATE_WORDS.items():
        if name == known:
            return words
        if name.startswith(f"{known}_"):
            return f"{words}, {name.removeprefix(known).lstrip('_')}"
    return name.replace("_", " ")
