"""Calibration certificates of single camera heads, written out as TOML with the numbers as they are printed.

    [head]
    serial = "00110011"
    columns = 7168
    rows = 4096
    pixel_um = 12.0
    nominal_focal_length_mm = 120.0
    unit = "m"                              # of the printed lengths: "m" or "mm"
    band = "PAN1"                           # as printed, if it is
    software = "5.1"                        # version of the software that made the images, if it is printed

    [parameters]                            # value and standard deviation, or "eliminated"
    dc = [-3.158e-4, 1.424e-6]
    K1 = [6.164e-1, 2.083e-2]
    K3 = "eliminated"                       # also [0.0, 1e-31]

    [correlations]                          # of those that are known
    "K1 K2" = -0.93

dxp, dyp are the principal point, dc is added to the nominal focal length, K1 … b2 are Brown's parameters
(`adjust.camera.additional.brown`). What was eliminated is held at zero, and not known to be zero.

Certificates of the DMC print their tables in mm, and hold metres. In a wrong unit the radial distortion of
such a lens is larger than its image or smaller than any noise, so the file is refused with both numbers.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from adjust.arrays import Floats
from tasks.errors import Location
from tasks.formats.records import CameraRecord
from tasks.formats.text_table import read_bytes

#: Printed name → parameter of the tables, and the power of a length in its unit.
_PARAMETERS = {
    "dxp": ("principal_point_x", 1),
    "dyp": ("principal_point_y", 1),
    "dc": ("focal_length", 1),
    "K1": ("brown:K1", -2),
    "K2": ("brown:K2", -4),
    "K3": ("brown:K3", -6),
    "P1": ("brown:P1", -1),
    "P2": ("brown:P2", -1),
    "b1": ("brown:B1", 0),
    "b2": ("brown:B2", 0),
}
_ELIMINATED = "eliminated"
# A standard deviation that nothing has: it stands for a parameter that was fixed.
_FIXED_SIGMA = 1e-20
# A change of the focal length is at most this part of it; radial distortion this part of the radius.
_MOST_CHANGE, _MOST_DISTORTION = 0.05, 0.5
# Standard deviation of a principal distance that no laboratory reaches, and one that is no calibration, m.
_FINEST, _COARSEST = 2e-8, 1e-4
#: Value over σ from which a parameter is significant, at 5 %.
SIGNIFICANT = 1.96


@dataclass(frozen=True)
class HeadCertificate:
    """One certificate, in metres.

    Attributes
    ----------
    serial : number of the head.
    columns, rows, pixel_um : its image.
    nominal_focal_length : metres.
    names : printed names of the k parameters that were estimated.
    values : of them.
    covariance : (k, k).
    eliminated : printed names of those that were held at zero.
    band, software : spectral band and version of the software, as printed; None: not stated.
    """

    serial: str
    columns: int
    rows: int
    pixel_um: float
    nominal_focal_length: float
    names: tuple[str, ...]
    values: tuple[float, ...]
    covariance: Floats
    eliminated: tuple[str, ...]
    band: str | None = None
    software: str | None = None

    @property
    def insignificant(self) -> Mapping[str, float]:
        """Parameters that a test at 5 % would eliminate, with value over σ."""
        t = np.abs(np.array(self.values)) / np.sqrt(np.diagonal(self.covariance))
        return {name: float(size) for name, size in zip(self.names, t, strict=True) if size < SIGNIFICANT}

    @property
    def camera(self) -> CameraRecord:
        """The camera it describes."""
        value = dict(zip(self.names, self.values, strict=True))
        return CameraRecord(
            self.columns,
            self.rows,
            self.pixel_um,
            round(1e3 * (self.nominal_focal_length + value.get("dc", 0.0)), 9),
            (round(1e3 * value.get("dxp", 0.0), 9), round(1e3 * value.get("dyp", 0.0), 9)),
            {_PARAMETERS[name][0]: number for name, number in value.items() if _PARAMETERS[name][1] <= 0},
        )

    @property
    def known(self) -> tuple[tuple[str, ...], tuple[tuple[float, ...], ...]]:
        """Names of the parameters in the tables, and their covariance in units of these."""
        factor = np.array([1e3 if _PARAMETERS[name][1] > 0 else 1.0 for name in self.names])
        matrix = self.covariance * np.outer(factor, factor)
        return tuple(_PARAMETERS[name][0] for name in self.names), tuple(map(tuple, matrix.tolist()))


def read_head_certificate(path: Path) -> HeadCertificate:
    """Read a certificate.

    Raises
    ------
    InputError
        If it is no such file, a value is missing or impossible, or the unit cannot be the stated one.
    """
    try:
        content = tomllib.loads(read_bytes(path, "settings").decode("utf-8"))
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise Location(path).error(f"This is not TOML: {error}.", "Correct it.") from error
    head, parameters = _table(content, "head", path), _table(content, "parameters", path)
    serial = head.get("serial")
    if not isinstance(serial, str) or not serial:
        raise Location(path).error("The serial number of the head is missing.", 'Add serial = "…".')
    unit = head.get("unit")
    if unit not in ("m", "mm"):
        raise Location(path).error(
            "The unit of the printed lengths is missing.", 'Add unit = "m" or unit = "mm".'
        )
    nominal = _number(head, "nominal_focal_length_mm", path) * 1e-3
    size = [_number(head, name, path) for name in ("columns", "rows", "pixel_um")]
    printed = {name: _value(parameters, name, path) for name in _PARAMETERS if name in parameters}
    unknown = next((name for name in parameters if name not in _PARAMETERS), None)
    if unknown is not None:
        raise Location(path).error(
            f"The parameter '{unknown}' is not known.", f"Known are {', '.join(_PARAMETERS)}."
        )
    half_diagonal = 0.5 * math.hypot(size[0], size[1]) * size[2] * 1e-6
    _refuse_other_unit(printed, unit, nominal, half_diagonal, path)
    metre = 1.0 if unit == "m" else 1e-3
    estimated = {name: item for name, item in printed.items() if item is not None}
    factor = np.array([metre ** _PARAMETERS[name][1] for name in estimated])
    values, sigma = (factor * np.array([item[k] for item in estimated.values()]) for k in (0, 1))
    return HeadCertificate(
        serial,
        round(size[0]),
        round(size[1]),
        size[2],
        nominal,
        tuple(estimated),
        tuple(values.tolist()),
        _correlations(content, tuple(estimated), path) * np.outer(sigma, sigma),
        tuple(name for name, item in printed.items() if item is None),
        _text(head, "band", path),
        _text(head, "software", path),
    )


def _text(head: Mapping[str, Any], name: str, path: Path) -> str | None:
    """A text that may be missing."""
    found = head.get(name)
    if found is not None and (not isinstance(found, str) or not found):
        raise Location(path).error(f"{name} is not a text.", f'Write {name} = "…", or leave it out.')
    return found


def _refuse_other_unit(
    printed: Mapping[str, tuple[float, float] | None],
    unit: Literal["m", "mm"],
    nominal: float,
    half_diagonal: float,
    path: Path,
) -> None:
    """Refuse a unit in which the lens is impossible; the message shows the numbers in the other unit."""
    other = "m" if unit == "mm" else "mm"
    wrong = _impossible(printed, unit, nominal, half_diagonal)
    if not wrong:
        return
    in_other = _impossible(printed, other, nominal, half_diagonal)
    dc, k1 = printed.get("dc"), printed.get("K1")
    says = []
    if k1 is not None:
        says.append(_said("K1 shifts a point in the corner by", _radial(k1[0], unit, half_diagonal)))
        says.append(_said(f"in {other} by", _radial(k1[0], other, half_diagonal)))
    if dc is not None:
        metres = {"m": 1.0, "mm": 1e-3}
        says += [_said(f"dc is known to (in {unit})", dc[1] * metres[unit])]
        says += [_said(f"in {other}", dc[1] * metres[other])]
    numbers = "; ".join(says)
    if in_other:
        raise Location(path).error(
            f"The numbers do not describe a lens in either unit: {wrong} ({numbers}).", "Check them."
        )
    raise Location(path, entity="unit").error(
        f"The numbers cannot be in {unit}: {wrong} ({numbers}). They are in {other}, regardless of the "
        "heading of the table.",
        f'Write unit = "{other}". A focal length printed as a sum of mm and these numbers is also wrong.',
    )


def _impossible(
    printed: Mapping[str, tuple[float, float] | None], unit: str, nominal: float, half_diagonal: float
) -> str:
    """Why the numbers cannot be in a unit; empty where they can."""
    metre = 1.0 if unit == "m" else 1e-3
    dc, k1 = printed.get("dc"), printed.get("K1")
    if k1 is not None and abs(_radial(k1[0], unit, half_diagonal)) > _MOST_DISTORTION * half_diagonal:
        return "the radial distortion would be larger than that of any camera lens"
    if dc is not None and abs(dc[0]) * metre > _MOST_CHANGE * nominal:
        return "the focal length would be far from its nominal value"
    if dc is not None and not _FINEST < dc[1] * metre < _COARSEST:
        return "no calibration knows a focal length like this"
    return ""


def _radial(k1: float, unit: str, radius: float) -> float:
    """K1 r³ in metres."""
    metre = 1.0 if unit == "m" else 1e-3
    return k1 * metre**-2 * radius**3


def _said(words: str, metres: float) -> str:
    return f"{words} {metres * 1e6:.3g} µm"


def _table(content: Mapping[str, Any], name: str, path: Path) -> Mapping[str, Any]:
    found = content.get(name)
    if not isinstance(found, Mapping):
        raise Location(path).error(f"The table [{name}] is missing.", "Add it.")
    return found


def _number(table: Mapping[str, Any], name: str, path: Path) -> float:
    value = table.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < 1e6:
        raise Location(path).error(f"{name} of the head is missing or no size.", f"Add {name} = NUMBER.")
    return float(value)


def _value(parameters: Mapping[str, Any], name: str, path: Path) -> tuple[float, float] | None:
    """Value and σ of a parameter; None if it was eliminated."""
    given = parameters[name]
    if given == _ELIMINATED:
        return None
    numbers: list[Any] = given if isinstance(given, list) and len(given) == 2 else [None]
    if any(isinstance(item, bool) or not isinstance(item, int | float) for item in numbers):
        raise Location(path, entity=name).error(
            "A parameter is a value with its standard deviation, or it was eliminated.",
            f'Write {name} = [VALUE, SIGMA] or {name} = "{_ELIMINATED}".',
        )
    value, sigma = (float(item) for item in numbers)
    if not (math.isfinite(value) and math.isfinite(sigma) and sigma > 0.0):
        raise Location(path, entity=name).error(
            f"The value {value:g} with the standard deviation {sigma:g} is invalid.", "Correct them."
        )
    if sigma < _FIXED_SIGMA:
        if value != 0.0:
            raise Location(path, entity=name).error(
                f"The value {value:g} is stated to ± {sigma:g}, which nothing is known to.",
                f'Write {name} = "{_ELIMINATED}" if it was held, or its standard deviation.',
            )
        return None
    return value, sigma


def _correlations(content: Mapping[str, Any], names: tuple[str, ...], path: Path) -> Floats:
    """Correlation matrix of the estimated parameters; what is not stated is zero."""
    matrix = np.eye(len(names))
    for pair, value in content.get("correlations", {}).items():
        both = pair.split()
        if len(both) != 2 or not set(both) <= set(names) or both[0] == both[1]:
            raise Location(path).error(
                f"'{pair}' is not a pair of estimated parameters.",
                f'Write "{names[0]} {names[-1]}" = CORRELATION.',
            )
        if isinstance(value, bool) or not isinstance(value, int | float) or not -1.0 < value < 1.0:
            raise Location(path).error(f"The correlation of {pair} is invalid.", "It lies between −1 and 1.")
        one, other = (names.index(name) for name in both)
        matrix[one, other] = matrix[other, one] = float(value)
    if np.linalg.eigvalsh(matrix)[0] <= 0.0:
        raise Location(path).error("The correlations contradict each other.", "Correct them.")
    return matrix
