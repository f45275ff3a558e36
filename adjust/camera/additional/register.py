"""The register of all sets of additional parameters, and what a selection from it computes.

A new set takes one line here. Sets that come in degrees go to the second list. Other packages add sets by
entry points, see ``adjust.extensions``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from adjust.arrays import Bools, Floats
from adjust.camera.additional import (
    balanced_radial,
    bluh,
    brown,
    brown_forward,
    chebyshev,
    ebner,
    fourier,
    gruen,
    legendre,
    pixel,
)
from adjust.camera.additional.base import Direction, ImageFormat, ParameterSet, SetByDegree, Term
from adjust.camera.additional.calibration_axes import calibration_from_image
from adjust.camera.additional.selection import Register, SelectedTerms, joined, selected
from adjust.extensions import Extended

_SETS: tuple[ParameterSet, ...] = (
    bluh.SET,
    brown.SET,
    brown.SET_IN_MILLIMETRES,
    brown_forward.SET,
    balanced_radial.SET,
    ebner.SET,
    gruen.SET,
    pixel.SET,
)

_SETS_BY_DEGREE: tuple[SetByDegree, ...] = (
    SetByDegree("legendre", legendre.legendre, legendre.DEGREES, usual=5),
    SetByDegree("chebyshev", chebyshev.chebyshev, chebyshev.DEGREES, usual=5),
    SetByDegree("fourier", fourier.fourier, fourier.ORDERS, usual=2),
)


def _trouble(name: str, value: object) -> str | None:
    """What is wrong with the set of an extension."""
    if not isinstance(value, ParameterSet):
        return f"is a {type(value).__name__}, not a ParameterSet."
    return None if value.name == name else f"is a set named {value.name!r}; both names must be the same."


REGISTER = Register(
    sets=Extended("parameter_sets", {item.name: item for item in _SETS}, _trouble),
    by_degree={item.name: item for item in _SETS_BY_DEGREE},
    presets={
        **bluh.PRESETS,
        "ebner12": "ebner",
        "gruen44": "gruen",
    },
)

# Points that are evaluated together: the columns of some 60 terms stay in the processor's cache. No power of
# two, with which all columns would fall on the same lines of the cache (5 times slower).
_POINTS_AT_ONCE = 1000


@dataclass(frozen=True)
class AdditionalParameters:
    """Selected additional parameters of one camera.

    Attributes
    ----------
    parts : the selected terms, set by set.
    image_format : of the camera, in calibration axes.
    turn_deg : 0, 90, 180 or 270, from image axes to calibration axes, see ``calibration_axes``.
    """

    parts: tuple[SelectedTerms, ...]
    image_format: ImageFormat
    turn_deg: int = 0

    @cached_property
    def terms(self) -> tuple[tuple[str, Term], ...]:
        """Name of the set, and the term, of each of the k parameters."""
        result: list[tuple[str, Term]] = []
        for part in self.parts:
            terms = part.set.terms_in(self.image_format)
            result += [(part.set.name, terms[name]) for name in part.names]
        return tuple(result)

    @property
    def names(self) -> tuple[str, ...]:
        """Name ``SET:NAME`` of each of the k parameters, as it is reported."""
        return tuple(f"{set_name}:{term.name}" for set_name, term in self.terms)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of the value of each of the k parameters, as published."""
        return tuple(term.unit for _, term in self.terms)

    @cached_property
    def first(self) -> Bools:
        """(k,) which parameters come first: the others are evaluated where these have moved the point to."""
        first = [name in part.set.comes_first for part in self.parts for name in part.names]
        return np.array(first, dtype=np.bool_)

    @cached_property
    def forward(self) -> Bools:
        """(k,) which parameters are a distortion of the ideal point, not a correction of the measured one."""
        forward = [part.set.direction == "forward" for part in self.parts for _ in part.names]
        return np.array(forward, dtype=np.bool_)

    def only(self, direction: Direction) -> AdditionalParameters:
        """Those of one direction, in the same order."""
        return replace(self, parts=tuple(part for part in self.parts if part.set.direction == direction))

    def basis(self, xy: Floats) -> Floats:
        """Correction Δ, or distortion, (n, 2, k) for a value of 1 of each parameter, metres in image axes.

        Parameters
        ----------
        xy : (n, 2) metres from the principal point, image axes.
        """
        result = np.empty((len(xy), 2, len(self.terms)))
        turn = calibration_from_image(self.turn_deg)
        for first in range(0, len(xy), _POINTS_AT_ONCE):
            rows = slice(first, first + _POINTS_AT_ONCE)
            self._fill(result[rows], xy[rows] @ turn.T, image_from_calibration=turn.T)
        return result

    def _fill(self, result: Floats, xy: Floats, image_from_calibration: Floats) -> None:
        """Write the basis at points xy in calibration axes into ``result``, turned back."""
        first = 0
        for part in self.parts:
            columns = slice(first, first + len(part.names))
            basis = part.set.basis(xy, self.image_format, part.names)
            if self.turn_deg == 0:
                result[:, :, columns] = basis
            else:
                for axis, row in enumerate(image_from_calibration):
                    source = int(np.flatnonzero(row)[0])
                    np.multiply(basis[:, source], row[source], out=result[:, axis, columns])
            first = columns.stop


def additional_parameters(
    selection: str, image_format: ImageFormat, turn_deg: int = 0, known: tuple[str, ...] = ()
) -> AdditionalParameters:
    """The additional parameters that a text selects, for images of a format.

    Parameters
    ----------
    selection : such as ``bluh:1-12+42-73``, see ``selection``.
    image_format : in calibration axes, see ``calibration_axes.format_in_calibration_axes``.
    turn_deg : 0, 90, 180 or 270, from image axes to calibration axes.
    known : names ``SET:NAME`` of others in addition to them, which have a value and are not determined: they
    may be
        linear combinations of those that are selected.

    Raises
    ------
    AdditionalParametersError : if the text names what does not exist, or one parameter twice, or a set
        whose tiles the format does not have.
    ValueError : if turn_deg is another angle.
    """
    beside = (part for name in known for part in selected(name, REGISTER))
    parts = joined((*selected(selection, REGISTER), *beside))
    parameters = AdditionalParameters(parts, image_format, turn_deg)
    # A format that a set cannot be evaluated over is refused here and not in the middle of an adjustment.
    parameters.basis(np.zeros((1, 2)))
    return parameters
