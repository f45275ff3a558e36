"""Calibrated quantities in the words and units of a certificate, and what may be said about each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from tasks.calibration.record import CalibratedParameter
from tasks.report.correlations import natural_key
from tasks.report.system_parameters import parameter_words

#: Customary unit and its size in units of the record: of the value, and of change and σ.
_MM = ("mm", 1.0)
_UM_OF_MM = ("µm", 1e3)
_DEG = ("°", 1.0)
_M = ("m", 1.0)
_MS_OF_S = ("ms", 1e3)


@dataclass(frozen=True)
class Quantity:
    """How a parameter is printed.

    Attributes
    ----------
    words, symbol : for people.
    unit, factor : of the value, and how many of it one unit of the record is.
    fine_unit, fine_factor : the same of change and σ.
    """

    words: str
    symbol: str
    unit: str
    factor: float
    fine_unit: str
    fine_factor: float


def _quantity(words: str, symbol: str, of_value: tuple[str, float], fine: tuple[str, float]) -> Quantity:
    return Quantity(words, symbol, *of_value, *fine)


INTERIOR: Mapping[str, Quantity] = {
    "focal_length": _quantity("focal length (principal distance)", "c", _MM, _UM_OF_MM),
    "principal_point_x": _quantity("principal point, along columns", "x0", _UM_OF_MM, _UM_OF_MM),
    "principal_point_y": _quantity("principal point, against rows", "y0", _UM_OF_MM, _UM_OF_MM),
}
BORESIGHT: Mapping[str, Quantity] = {
    "boresight_roll": _quantity("roll", "about forward", _DEG, _DEG),
    "boresight_pitch": _quantity("pitch", "about right", _DEG, _DEG),
    "boresight_yaw": _quantity("yaw", "about down", _DEG, _DEG),
}
LEVER_ARM: Mapping[str, Quantity] = {
    "lever_arm_x": _quantity("forward", "l x", _M, _M),
    "lever_arm_y": _quantity("right", "l y", _M, _M),
    "lever_arm_z": _quantity("down", "l z", _M, _M),
}
GNSS_SHIFT: Mapping[str, Quantity] = {
    "gnss_shift_x": _quantity("east", "s x", _M, _M),
    "gnss_shift_y": _quantity("north", "s y", _M, _M),
    "gnss_shift_z": _quantity("up", "s z", _M, _M),
}
TIME_OFFSET: Mapping[str, Quantity] = {
    "time_offset": _quantity("time offset", "Δt", _MS_OF_S, _MS_OF_S),
}
_NAMED = {**INTERIOR, **BORESIGHT, **LEVER_ARM, **GNSS_SHIFT, **TIME_OFFSET}


def is_additional(parameter: CalibratedParameter) -> bool:
    """Whether it is an additional parameter, ``SET:NAME``."""
    return ":" in parameter.parameter


def quantity_of(parameter: CalibratedParameter) -> Quantity:
    """How a parameter is printed; one without customary units as in the record."""
    found = _NAMED.get(parameter.parameter)
    if found is not None:
        return found
    unit = "" if parameter.unit == "1" else parameter.unit
    return Quantity(parameter_words(parameter.parameter), "", unit, 1.0, unit, 1.0)


def short_name(parameter: CalibratedParameter) -> str:
    """A name for rows of matrices: ``c``, ``x0``, ``boresight roll``, ``bluh:7``."""
    name = parameter.parameter
    if name in INTERIOR or name in TIME_OFFSET:
        return _NAMED[name].symbol
    for words, group in (("lever arm", LEVER_ARM), ("shift", GNSS_SHIFT)):
        if name in group:
            return f"{words} {group[name].words}"
    return parameter_words(name)


def in_order(parameters: tuple[CalibratedParameter, ...]) -> tuple[CalibratedParameter, ...]:
    """Interior orientation, boresight, lever arm, shift, time offset, the others; numbers by size."""
    names = list(_NAMED)

    def place(item: CalibratedParameter) -> tuple[int, str, tuple[tuple[int, int, str], ...]]:
        known = names.index(item.parameter) if item.parameter in _NAMED else len(names)
        return known, item.entity, natural_key(item.parameter)

    return tuple(sorted(parameters, key=place))


def has_result(parameter: CalibratedParameter) -> bool:
    """Whether the calibration says something about it: estimated, and determined by this flight."""
    if parameter.sigma is None or parameter.verdict not in ("determined", "weak"):
        return False
    return parameter.status in ("significant", "not_significant")


def change_over_sigma(parameter: CalibratedParameter) -> float | None:
    """t: change against the value before over its σ; None without a result."""
    if parameter.sigma is None or not parameter.sigma > 0.0 or not has_result(parameter):
        return None
    return (parameter.value - parameter.given) / parameter.sigma


def finding(parameter: CalibratedParameter) -> str:
    """What may be said about a parameter, in the words of a certificate."""
    if parameter.status == "eliminated":
        return "eliminated"
    if parameter.verdict == "not_determinable" or parameter.status == "not_determinable":
        return "not determinable"
    if parameter.status == "prior_only":
        return "not determinable: known from its prior only"
    if parameter.sigma is None:
        return "held"
    words = "significant" if parameter.status == "significant" else "not significant"
    return f"{words}, weakly determined" if parameter.verdict == "weak" else words
