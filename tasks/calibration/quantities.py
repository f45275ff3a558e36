"""The quantities of a calibration: which parameters they are, their limits, and how their σ is written."""

from __future__ import annotations

import numpy as np

from tasks.settings.calibration import AcceptanceLimits

INTERIOR = ("focal_length", "principal_point_x", "principal_point_y")
#: What belongs to one flight only and to no calibration: random, but estimated with it.
OF_STRIPS = tuple(f"{kind}_{axis}" for kind in ("gnss_strip_bias", "gnss_drift") for axis in "xyz")

_MM, _DEGREE = "mm", "deg"


def is_calibrated(parameter: str) -> bool:
    """Whether a parameter is a quantity of the calibration, and none of a strip."""
    return parameter not in OF_STRIPS


def sigma_limit(parameter: str, limits: AcceptanceLimits) -> float | None:
    """Largest σ that is accepted, in the unit of parameters.parquet; None where there is no limit."""
    if parameter == "focal_length":
        return limits.focal_length_um * 1e-3
    if parameter.startswith("principal_point"):
        return limits.principal_point_um * 1e-3
    if parameter.startswith("boresight"):
        return limits.yaw_deg if parameter.endswith("yaw") else limits.roll_pitch_deg
    if parameter.startswith("gnss_shift"):
        return limits.shift_m
    if parameter.startswith("lever_arm"):
        return limits.lever_arm_m
    return None


def written_sigma(value: float, unit: str) -> str:
    """A standard deviation with its unit, in the size people speak of: µm, °, cm, ms."""
    if unit == _MM:
        return f"{value * 1e3:.3g} µm"
    if unit == _DEGREE:
        return f"{np.format_float_positional(value, precision=2, fractional=False, trim='-')}°"
    scaled = {"m": (100.0, "cm"), "s": (1000.0, "ms"), "m/s": (100.0, "cm/s")}
    factor, name = scaled.get(unit, (1.0, unit))
    return f"{value * factor:.3g} {name}" if name != "1" else f"{value * factor:.3g}"
