"""Joint covariance matrix of any unknowns of an adjusted block, requested by their names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from adjust.arrays import Floats
from adjust.block import Block
from adjust.errors import UnknownNameError
from adjust.one_thread import one_thread
from adjust.parameters import ParameterLayout
from adjust.quality.joint_cofactor import Chosen, joint_cofactors_of
from adjust.solve.full_vectors import FullVectors, solve_full
from adjust.solve.gauss_newton import Solution
from adjust.solve.system import System
from adjust.unknown_names import numbers_of, places_of, unknown_name

_OF_POINT = (("x", "m"), ("y", "m"), ("z", "m"))
_OF_IMAGE = (*_OF_POINT, ("rotation_x", "rad"), ("rotation_y", "rad"), ("rotation_z", "rad"))


class Unknown(NamedTuple):
    """One unknown: its name, the image, object point, camera, flight or strip that has it, its unit."""

    name: str
    entity: str
    unit: str

    def __str__(self) -> str:
        return f"{self.name} of {self.entity}"


@dataclass(frozen=True, eq=False)
class JointCovariance:
    """Covariance matrix of some unknowns.

    Attributes
    ----------
    unknowns : the u unknowns, in the order in which they were requested: images, parameters, object points.
        Centres and points in local axes; the small rotation of an image in its camera frame.
    matrix : (u, u), in the products of their units.
    sigma0 : the factor of the standard deviations that is in it.
    """

    unknowns: tuple[Unknown, ...]
    matrix: Floats
    sigma0: float

    @property
    def sigma(self) -> Floats:
        """(u,) standard deviations, in the unit of each unknown."""
        return np.asarray(np.sqrt(np.diagonal(self.matrix)))

    @property
    def correlation(self) -> Floats:
        """(u, u) correlation matrix."""
        sigma = self.sigma
        return np.asarray(self.matrix / np.outer(sigma, sigma))

    def __repr__(self) -> str:
        first = zip(self.unknowns[:4], self.sigma, strict=False)
        shown = ", ".join(f"{unknown} ± {sigma:.3g} {unknown.unit}" for unknown, sigma in first)
        noun = "unknown" if len(self.unknowns) == 1 else "unknowns"
        more = ", …" if len(self.unknowns) > 4 else ""
        return f"JointCovariance of {len(self.unknowns)} {noun}: {shown}{more}"


def joint_covariance(
    system: System,
    solution: Solution,
    errors: FullVectors | None,
    sigma0: float,
    names: tuple[Sequence[str], Sequence[str], Sequence[str]],
) -> JointCovariance:
    """Covariances of images, parameters and object points, by name.

    In a free network they are those of its datum.

    Parameters
    ----------
    errors : (u, k) what k independent errors of considered parameters and of corrections of image coordinates
        add to the unknowns; None without any.
    sigma0 : factor of all standard deviations but those of these errors.
    names : of images (in a rig of events, whose pose is that of the reference head), parameters and object
        points.

    Raises
    ------
    UnknownNameError : a name does not exist, comes twice, or is of something that is not an unknown.
    """
    chosen, unknowns = _chosen(system, *names)
    with one_thread():
        matrix = joint_cofactors_of(system, solution, chosen)
        if solution.movements is not None:
            vectors = solution.movements.vectors
            g = _rows(vectors, chosen)
            z = solve_full(
                system, solution.linearization, solution.factorization, solution.movements.selected
            )
            f = z.minus(vectors.times(0.5 * solution.movements.selected.dot(z)))
            change = g @ _rows(f, chosen).T
            matrix = matrix - change - change.T
    matrix = sigma0**2 * matrix
    if errors is not None:
        added = _rows(errors, chosen)
        matrix = matrix + added @ added.T
    return JointCovariance(unknowns, 0.5 * (matrix + matrix.T), sigma0)


def _rows(vectors: FullVectors, chosen: Chosen) -> Floats:
    """The rows (u, d) of the chosen unknowns."""
    parts = (
        vectors.of_exposures[chosen.events],
        vectors.of_border[chosen.columns],
        vectors.of_points[chosen.points],
    )
    return np.concatenate([part.reshape(-1, vectors.count) for part in parts])


def _chosen(
    system: System, images: Sequence[str], parameters: Sequence[str], points: Sequence[str]
) -> tuple[Chosen, tuple[Unknown, ...]]:
    """The unknowns of names."""
    block = system.block
    kind = "image" if block.rig is None else "event"
    at_images = places_of(kind, _names("images", images), numbers_of(kind, block.events))
    at_points = places_of("object point", _names("points", points), numbers_of("object point", block.points))
    for j in at_points:
        if not system.active_point[j]:
            raise UnknownNameError(
                f"The object point {block.points[j]!r} was not used in the adjustment, so it has no "
                "covariance.",
                tuple(name for name, active in zip(block.points, system.active_point, strict=True) if active),
            )
    columns = [column for name in _names("parameters", parameters) for column in _columns(block, name)]
    if len(set(columns)) < len(columns):
        raise UnknownNameError(f"A parameter is requested twice by {', '.join(parameters)}.")
    of_border = [Unknown(*item) for item in system.layout.border_names()]
    unknowns = (
        *(Unknown(name, block.events[i], unit) for i in at_images for name, unit in _OF_IMAGE),
        *(of_border[column] for column in columns),
        *(Unknown(name, block.points[j], unit) for j in at_points for name, unit in _OF_POINT),
    )
    return Chosen(*(np.array(item, dtype=np.int64) for item in (at_images, columns, at_points))), unknowns


def _names(argument: str, names: Sequence[str]) -> Sequence[str]:
    """A list of names; a text alone would be taken for a list of letters."""
    if isinstance(names, str):
        raise TypeError(f"{argument} is a list of names: {argument}=[{names!r}].")
    return names


def _columns(block: Block, name: str) -> list[int]:
    """Columns of the border that a name means: a family, a parameter, or ``PARAMETER of ENTITY``."""
    layout = block.layout
    if name in layout.columns:
        found = layout.columns[name].ravel()
    else:
        found = np.array(
            [
                layout.columns[item.family.name][entity, component]
                for item in block.system
                for entity in range(len(item.entities))
                for component, own in enumerate(item.family.components)
                if name in (own, str(item.quantity(entity, component)))
            ],
            dtype=np.int64,
        )
    free = [str(quantity) for quantity in layout.border_quantities]
    if not len(found):
        raise unknown_name("system parameter", name, _known(layout))
    if (found < 0).all():
        estimated = f"Estimated are: {', '.join(free)}." if free else "No system parameter is estimated."
        held = f"{name!r} is held fixed in this adjustment, so it has no covariance."
        raise UnknownNameError(f"{held} {estimated}", tuple(free))
    return [int(column) for column in found if column >= 0]


def _known(layout: ParameterLayout) -> list[str]:
    """Every name that means system parameters: families, parameters, parameters of an entity."""
    names = [item.family.name for item in layout.system]
    names += [component for item in layout.system for component in item.family.components]
    return names + [
        str(item.quantity(entity, component))
        for item in layout.system
        for entity in range(len(item.entities))
        for component in range(len(item.family.components))
    ]
