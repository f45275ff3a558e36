"""The additional parameters of the Hannover program system BLUH, one set of numbered terms.

Their formulas are in a file for each part: the general ones 1–12, those of the DMC's quarters 29–41, 79
and 80, those of the UltraCam's tiles 42–73, those of the corners 81–88. All but the last are defined in
normalised millimetres, and their values and units are too.
"""

from __future__ import annotations

from types import ModuleType

from adjust.arrays import Floats
from adjust.camera.additional import bluh_corners, bluh_general, bluh_quarters, bluh_tiles
from adjust.camera.additional.base import Column, Combination, ImageFormat, ParameterSet, stacked

_PARTS: tuple[ModuleType, ...] = (bluh_general, bluh_quarters, bluh_tiles, bluh_corners)
_PART_OF = {term.name: part for part in _PARTS for term in part.TERMS}

PRESETS = {
    "bluh12": "bluh:1-12",
    "jacobsen_radial": "bluh:9-11",
    "uc": "bluh:42-73",
    "corner": "bluh:81-88",
    "dmc": "bluh:1-12+34-41+80",
}


def _basis(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:
    """Correction (n, 2, k) of terms of any part, see ``base.ParameterSet``."""
    columns: dict[str, Column] = {}
    for part in _PARTS:
        of_part = tuple(name for name in names if _PART_OF[name] is part)
        if of_part:
            columns.update(zip(of_part, part.columns(xy, image_format, of_part), strict=True))
    return stacked([columns[name] for name in names], len(xy))


SET = ParameterSet(
    name="bluh",
    title="BLUH",
    source="Jacobsen, program system BLUH, University of Hannover: tables of the general (1–12) and of the "
    "camera-specific additional parameters; 42–73 after the layout of UltraCam cameras in Leberl and Gruber "
    "(2004) and Sandau (2010)",
    terms=tuple(sorted((term for part in _PARTS for term in part.TERMS), key=lambda term: int(term.name))),
    basis=_basis,
    combinations=(
        Combination("33", of=("2", "29", "30")),
        Combination("79", of=tuple(str(number) for number in range(34, 42))),
    ),
    note="Millimetres are normalised: the corner of the image lies at r = 162.6 mm. Only those of 81–88 are "
    "millimetres on the image. x is along flight.",
    variants=bluh_tiles.variants,
    formulas="\n".join(part.__doc__ or "" for part in _PARTS),
)
