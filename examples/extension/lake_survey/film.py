"""Deformation of film: another scale along each axis, and a shear; additional parameters of one's own.

Δx = a₁ x + a₂ y,   Δy = −a₁ y + a₂ x   (x, y from the principal point)
"""

from __future__ import annotations

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat, ParameterSet, Term, stacked


def _basis(xy: Floats, _: ImageFormat, names: tuple[str, ...]) -> Floats:
    x, y = xy.T
    columns = {"scale": (x, -y), "shear": (y, x)}
    return stacked([columns[name] for name in names], len(xy))


FILM = ParameterSet(
    name="film",
    title="deformation of film",
    source="the head of this file",
    terms=(
        Term("scale", "difference of the scales along x and y, halved", "1", "published"),
        Term("shear", "angle between the axes, halved", "1", "published"),
    ),
    basis=_basis,
)
