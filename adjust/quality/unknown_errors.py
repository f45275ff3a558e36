"""Errors of everything that is adjusted, other than those of the observations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.observations.base import Linearization
from adjust.observations.image_point import ImagePoints
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT, ParameterLayout
from adjust.solve.full_vectors import FullVectors
from adjust.solve.gauss_newton import Solution


@dataclass(frozen=True, eq=False)
class UnknownErrors:
    """What k independent errors of unit variance change.

    Attributes
    ----------
    of_unknowns : errors (u, k) of the adjusted unknowns; in the datum of a free network.
    of_families : name of the family → (entities, components, k) errors of free and held parameters.
    """

    of_unknowns: FullVectors
    of_families: Mapping[str, Floats]

    def of_computed(self, equations: Linearization) -> Floats:
        """Errors (n, m, k) of what the unknowns compute for observations, in the units of the equations."""
        errors = np.zeros((*equations.misclosure.shape, self.of_unknowns.count))
        for term in equations.terms:
            if term.block == EXTERIOR_ORIENTATION:
                errors += term.jacobian @ self.of_unknowns.of_exposures[term.index]
            elif term.block == OBJECT_POINT:
                errors += term.jacobian @ self.of_unknowns.of_points[term.index]
            else:
                errors += term.jacobian @ self.of_families[term.block][term.index]
        return errors


def in_datum(solution: Solution, layout: ParameterLayout, errors: FullVectors) -> FullVectors:
    """Errors (u, k) of the unknowns of a layout, in the datum of a free network."""
    if solution.movements is not None:
        vectors = solution.movements.vectors
        errors = errors.minus(vectors.times(solution.movements.selected.dot(errors)))
    return replace(errors, of_border=errors.of_border[: layout.border])


def errors_of_families(layout: ParameterLayout, of_border: Floats) -> dict[str, Floats]:
    """Errors (e, d, k) of the system parameters by those (g, k) of the free ones; held ones have none."""
    errors = {}
    for name, columns in layout.columns.items():
        errors[name] = np.zeros((*columns.shape, of_border.shape[1]))
        free = columns >= 0
        errors[name][free] = of_border[columns[free]]
    return errors


@dataclass(frozen=True, eq=False)
class CorrectionErrors(UnknownErrors):
    """What k independent errors of unit variance in the corrections of image coordinates change.

    Attributes
    ----------
    at : errors (r, 2, k) of the corrections themselves, metres, at image points (r, 2) of images (r,).
    sigma : standard deviation that systematic errors of the image coordinates are taken to have, metres, of
        each set of images; None for one without corrections.
    parts : into how many, along each side, the sub-areas of each set were divided to see errors within them.
    """

    at: Callable[[Ints, Floats], Floats]
    sigma: Sequence[float | None]
    parts: Sequence[int | None]

    def of_rays(self, rays: ImagePoints, equations: Linearization) -> Floats:
        """Errors (n, 2, k) of computed − corrected image coordinates, metres; equations not whitened."""
        return self.of_computed(equations) - self.at(rays.image, rays.xy)
