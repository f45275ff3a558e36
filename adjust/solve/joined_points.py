"""Observations that join two object points, although object points are eliminated one by one.

A whitened row a·dx + b·dy − l = v between the object points x and y is cut in two at an unknown t of its own:

    √2 (a·dx + t − l/2) = v′,    √2 (b·dy − t − l/2) = v″,    min over t of v′² + v″² = v².

Each half touches one object point only. The unknowns t stand behind the system parameters at the end of the
border; nothing observes them, they count neither as unknowns nor as observations, and no result knows them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.observations.base import JoinsPoints, Linearization, ObservationGroup
from adjust.parameters import OBJECT_POINT


@dataclass(frozen=True, eq=False)
class Joins:
    """Whitened rows that join two object points, in the order of the groups.

    Attributes
    ----------
    point, other_point : (k,) the object points x and y.
    of_point, of_other : (k, 3) a and b.
    misclosure : (k,) l.
    """

    point: Ints
    other_point: Ints
    of_point: Floats
    of_other: Floats
    misclosure: Floats

    @classmethod
    def of(cls, whitened: Linearization) -> Joins | None:
        """Of the whitened equations of one group; None if they do not join object points."""
        terms = [term for term in whitened.terms if term.block == OBJECT_POINT]
        if len(terms) < 2:
            return None
        one, other = terms
        return cls(
            one.index, other.index, one.jacobian[:, 0], other.jacobian[:, 0], whitened.misclosure[:, 0]
        )

    def add_to(self, point_normal: Floats, point_rhs: Floats) -> None:
        """Add what both halves give to N_pp (m, 3, 3) and b_p (m, 3) of each object point."""
        for point, rows in ((self.point, self.of_point), (self.other_point, self.of_other)):
            np.add.at(point_normal, point, 2.0 * rows[:, :, None] * rows[:, None, :])
            np.add.at(point_rhs, point, rows * self.misclosure[:, None])

    def moved(self, of_points: Floats) -> Floats:
        """Changes (k, d) of the unknowns t that keep both halves as they are while points (m, 3, d) move."""
        return np.asarray(-np.einsum("ki,kid->kd", self.of_point, of_points[self.point]))


@dataclass(frozen=True, eq=False)
class Couplings:
    """N_tp: what joins the object points to the columns of the unknowns t, sorted by object point.

    Attributes
    ----------
    start : (m + 1,) where those of each object point begin.
    number : (c,) which of the unknowns t, counted from 0.
    vector : (c, 3) derivatives of the normal equations.
    """

    start: Ints
    number: Ints
    vector: Floats

    @property
    def joins(self) -> int:
        """Number k of the unknowns t."""
        return len(self.number) // 2

    def columns(self, first: int) -> tuple[Ints, Ints, Floats]:
        """What the kernels take, with the columns of the unknowns t counted from a first one."""
        return self.start, self.number + first, self.vector

    @classmethod
    def of(cls, joins: list[Joins], points: int) -> Couplings:
        """Of all joins of a block; an empty list is none."""
        point = np.concatenate(
            [np.zeros(0, dtype=np.int64), *(j.point for j in joins), *(j.other_point for j in joins)]
        )
        vector = np.concatenate(
            [np.zeros((0, 3)), *(2.0 * j.of_point for j in joins), *(-2.0 * j.of_other for j in joins)]
        )
        number = np.tile(np.arange(len(point) // 2, dtype=np.int64), 2)
        order = np.argsort(point, kind="stable")
        start = np.searchsorted(point[order], np.arange(points + 1))
        return cls(start.astype(np.int64), number[order], np.ascontiguousarray(vector[order]))


def joined_points(groups: tuple[ObservationGroup, ...]) -> tuple[Ints, Ints]:
    """The object points (k,) and (k,) that observations of the groups join."""
    found = [group for group in groups if isinstance(group, JoinsPoints)]
    nothing = np.zeros(0, dtype=np.int64)
    return (
        np.concatenate([nothing, *(group.point for group in found)]),
        np.concatenate([nothing, *(group.other_point for group in found)]),
    )
