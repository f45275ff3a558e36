"""Brown's radial, tangential and affine parameters, in metres (``brown``) and millimetres (``brown_mm``).

    Δx = x (K1 r² + K2 r⁴ + K3 r⁶) + P1 (r² + 2 x²) + 2 P2 x y + B1 x + B2 y
    Δy = y (K1 r² + K2 r⁴ + K3 r⁶) + 2 P1 x y + P2 (r² + 2 y²)

The sign is that of Australis: Δ is added to the measurement. P1 belongs to x; OpenCV calls it p2. The two
sets differ in units only: a value per mmⁿ is 1000ⁿ times as large per mⁿ. Certificates of the DMC print
metres, Australis and most laboratories millimetres.

B1 is linear here: it scales x in addition to the distortion. DBAT's models with an aspect parameter stretch
before (3, 5) or after it (4), which differs by B1 times the distortion.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import Basis, ImageFormat, ParameterSet, Term

Length = Literal["m", "mm"]

_SUPERSCRIPT = {1: "", 2: "²", 4: "⁴", 6: "⁶"}

#: Name, meaning, and n of the unit 1/lengthⁿ.
_TERMS = (
    ("K1", "radial, r³", 2),
    ("K2", "radial, r⁵", 4),
    ("K3", "radial, r⁷", 6),
    ("P1", "tangential, along x", 1),
    ("P2", "tangential, along y", 1),
    ("B1", "affinity: x is stretched", 0),
    ("B2", "shear: x grows with y", 0),
)

#: (7,) factors that turn values of K1 … B2 per mmⁿ into values per mⁿ.
PER_METRE_FROM_PER_MILLIMETRE: Floats = np.array([1000.0**power for *_, power in _TERMS])


def _terms(length: Length) -> tuple[Term, ...]:
    return tuple(
        Term(name, meaning, f"1/{length}{_SUPERSCRIPT[power]}" if power else "1", "published")
        for name, meaning, power in _TERMS
    )


def _basis(length: Length) -> Basis:
    """Basis for values in units of a length; Δ is always in metres."""
    metres = {"m": 1.0, "mm": 1e-3}[length]
    factor = {name: metres**-power for name, _, power in _TERMS}

    def basis(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:  # noqa: ARG001
        x, y = xy[:, 0], xy[:, 1]
        square = x * x + y * y
        radial = {"K1": square, "K2": square * square, "K3": square * square * square}
        # Column after column, as they are made.
        result = np.zeros((len(names), len(xy), 2))
        for correction, name in zip(result, names, strict=True):
            f = factor[name]
            match name:
                case "K1" | "K2" | "K3":
                    correction[:] = (f * radial[name])[:, None] * xy
                case "P1":
                    correction[:, 0], correction[:, 1] = f * (square + 2.0 * x * x), 2.0 * f * x * y
                case "P2":
                    correction[:, 0], correction[:, 1] = 2.0 * f * x * y, f * (square + 2.0 * y * y)
                case "B1":
                    correction[:, 0] = x
                case "B2":
                    correction[:, 0] = y
        return np.moveaxis(result, 0, 2)

    return basis


_SOURCE = "Brown (1971), Close-range camera calibration, Photogrammetric Engineering 37(8), 855–866"

_NOTE = (
    "A value per mmⁿ is 1000ⁿ times as large per mⁿ. Signs are those of Australis and PhotoModeler; P1, P2 "
    "are OpenCV's p2, p1. K1, K2 and K3 are strongly correlated with each other and with the focal length."
)

SET = ParameterSet(
    "brown", "Brown, in metres", _SOURCE, _terms("m"), _basis("m"), _NOTE, formulas=__doc__ or ""
)
SET_IN_MILLIMETRES = ParameterSet(
    "brown_mm", "Brown, in millimetres", _SOURCE, _terms("mm"), _basis("mm"), _NOTE, formulas=__doc__ or ""
)
