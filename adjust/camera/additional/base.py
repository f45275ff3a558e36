"""What a set of additional parameters is.

An additional parameter a_k corrects the measured image coordinates:

    x_id = x̄ + Σ f_k(x̄, ȳ) a_k,      x̄ = x_measured − x0,  ȳ = y_measured − y0.

f_k is evaluated at measured coordinates, so nothing is iterated in the adjustment. The systematic image
error is the negative of the correction. A form "x' = x − f P" of the literature has the sign turned here.

The terms of a *forward* set are a distortion of the ideal image point, as computer vision has it:

    x̄ + Δ(x̄) = x_id + Σ f_k(x_id, y_id) a_k.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from adjust.arrays import Floats
from adjust.errors import AdditionalParametersError

Status = Literal["published", "reconstructed"]
Perspective = Literal["master4", "outer8", "rotation8"]
Direction = Literal["correction", "forward"]


@dataclass(frozen=True)
class Tiles:
    """Where the CCD images of a composed image meet, in calibration axes, metres.

    Attributes
    ----------
    seams_x, seams_y : ascending coordinates of the seams across x and across y; 3 × 3 tiles have two each.
    blend : width over which neighbouring tiles are mixed linearly; 0 is a hard switch at the seam.
    perspective : which form the perspective terms of the tiles take.
    """

    seams_x: tuple[float, ...]
    seams_y: tuple[float, ...]
    blend: float = 0.0
    perspective: Perspective = "master4"


@dataclass(frozen=True)
class ImageFormat:
    """The image a set is evaluated over, in calibration axes.

    Attributes
    ----------
    half_x, half_y : half the sides of the image, metres.
    tiles : the CCD images it is composed of; None where the set's own default layout holds.
    focal_length : c, metres, by which forward sets divide; None where none of them is used.
    """

    half_x: float
    half_y: float
    tiles: Tiles | None = None
    focal_length: float | None = None

    @property
    def needed_focal_length(self) -> float:
        """The focal length c, for a set that requires it.

        Raises
        ------
        AdditionalParametersError : if it is not known.
        """
        if self.focal_length is None:
            raise AdditionalParametersError(
                "The distortion is normalised by the focal length, which is not known.",
                "Give the focal length with the image format.",
            )
        return self.focal_length


@dataclass(frozen=True)
class Term:
    """One additional parameter.

    Attributes
    ----------
    name : within its set, such as ``7`` or ``K1``; it is reported as ``SET:NAME``.
    meaning : in a few words.
    unit : of its value, as published: ``1``, ``1/mm``, ``1/mm²``, ``mm``, ``µm``, ``1/m²`` …
    status : whether its formula is published, or reconstructed from a description.
    """

    name: str
    meaning: str
    unit: str
    status: Status


Basis = Callable[[Floats, ImageFormat, tuple[str, ...]], Floats]
Column = tuple[Floats, Floats]  # Δx (n,), Δy (n,) of one term


def stacked(columns: Sequence[Column], n: int) -> Floats:
    """The basis (n, 2, k) of the columns of k terms; in memory each column is contiguous."""
    result = np.empty((len(columns), 2, n))
    for term, (dx, dy) in zip(result, columns, strict=True):
        term[0], term[1] = dx, dy
    return result.transpose(2, 1, 0)


@dataclass(frozen=True)
class Combination:
    """A term that is a linear combination of others of its set: all of them together are not determinable."""

    term: str
    of: tuple[str, ...]


def _no_variants(_: ImageFormat) -> tuple[Term, ...]:
    return ()


@dataclass(frozen=True)
class ParameterSet:
    """A named set of additional parameters.

    Attributes
    ----------
    name : as it is written in settings and reports.
    title : in a few words.
    source : where the formulas stand.
    terms : all parameters of the set, in order.
    basis : (xy (n, 2) metres from the principal point in calibration axes, image format, names of k terms of
        the set) → (n, 2, k) correction Δ (of a forward set: distortion) in metres for a value of 1 of each
        term, in its published unit.
        Smooth but for the seams, finite everywhere, zero at the origin where the formula has a limit there.
    note : what one must know to read the values, in whole sentences.
    combinations : terms that are linear combinations of others; all others together have full rank.
    variants : the terms that have another meaning or unit in an image format, by the same names.
    formulas : the formulas and what they mean, a text of paragraphs and indented formulas for the pages of
        the documentation; usually that at the head of the set's file.
    comes_first : the terms that move the point before all others of their direction, which are then
        evaluated where these have moved the point to, in addition to the sums above: between the measured and
        the ideal point the geometry of the pixels is on the side of the former, the lens on that of the
        latter.
    direction : of a correction the point xy is the measured one, of a forward set the ideal one.
    """

    name: str
    title: str
    source: str
    terms: tuple[Term, ...]
    basis: Basis
    note: str = ""
    combinations: tuple[Combination, ...] = ()
    variants: Callable[[ImageFormat], tuple[Term, ...]] = _no_variants
    formulas: str = ""
    comes_first: tuple[str, ...] = ()
    direction: Direction = "correction"

    def terms_in(self, image_format: ImageFormat) -> dict[str, Term]:
        """All terms by name, as they are in an image format."""
        return {term.name: term for term in (*self.terms, *self.variants(image_format))}


@dataclass(frozen=True)
class SetByDegree:
    """A set of additional parameters for each degree (order) of its functions.

    Attributes
    ----------
    name : as it is written in settings, with the degree behind it: ``legendre(5)``.
    of_degree : the set of a degree; it is named ``NAME(DEGREE)``.
    degrees : which there are.
    usual : the degree that pages show and contracts are tested with.
    """

    name: str
    of_degree: Callable[[int], ParameterSet]
    degrees: range
    usual: int
