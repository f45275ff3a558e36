"""The residuals of an adjusted block as a table: the largest table of all, so written piece by piece.

The rows of a group are sorted by indices; names, and the values in the units of the contract, exist only for
the piece that is being written.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from adjust.arrays import Floats, Ints, order_of_numbers
from adjust.block import Block
from adjust.observations.base import ObservationGroup
from adjust.observations.direct import DirectObservations
from adjust.observations.distance import Distances
from adjust.observations.image_point import ImagePoints
from adjust.result import GroupResult, ObservationStatus
from tasks.evaluation.result_tables import PIECE, AdjustedBlock, reported_unit_of
from tasks.tables.names import Names
from tasks.tables.parquet import write_row_groups
from tasks.tables.places import places_of
from tasks.tables.schemas.adjustment import RESIDUALS

_STATUS = {
    ObservationStatus.USED: "used",
    ObservationStatus.REJECTED: "rejected",
    ObservationStatus.UNCONTROLLED: "uncontrolled",
    ObservationStatus.NOT_USED: "not_used",
}
_STATUS_NAMES = pa.array([_STATUS[status] for status in ObservationStatus])


@dataclass(frozen=True, eq=False)
class _Rows:
    """The observations of one group, and image points that never entered the adjustment.

    Attributes
    ----------
    result : the n observations that were adjusted.
    titles, images, points : the names; of what belongs to an event of a rig that of the event.
    title, image, point : (n + k,) indices into them.
    unused_sigma : (k, m) in the unit of the table, of those that never entered.
    """

    result: GroupResult
    titles: Names
    images: Names
    points: Names
    title: Ints
    image: Ints
    point: Ints
    unused_sigma: Floats

    def order(self) -> Ints:
        """The observations in the order of the table."""
        keys = (self.points.rank[self.point], self.images.rank[self.image], self.titles.rank[self.title])
        return order_of_numbers(*keys)

    def columns(self, rows: Ints) -> Mapping[str, Any]:
        """The columns of these observations, one row for each component observed."""
        result, group = self.result, self.result.group
        units = [reported_unit_of(group, component) for component in range(len(group.components))]
        factors = np.array([factor for _, factor in units])
        entered = rows < len(group.event)
        own = rows[entered]
        sigma = np.empty((len(rows), len(factors)))
        sigma[entered] = result.sigma[own] * factors
        sigma[~entered] = self.unused_sigma[rows[~entered] - len(group.event)]
        by_name = np.argsort(np.array(group.components))
        row, place = np.nonzero(np.isfinite(sigma[:, by_name]))
        component, observation = by_name[place], rows[row]
        known = entered[row]
        of_known, factor = (observation[known], component[known]), factors[component]

        def complete(values: Floats) -> Floats:
            every = np.full(len(row), np.nan)
            every[known] = values
            return every

        status = np.full(len(row), int(ObservationStatus.NOT_USED))
        status[known] = result.status[of_known]
        # Where each observation of the group stands among those of this piece.
        piece = np.cumsum(entered)[row[known]] - 1
        return {
            "group": self.titles.take(self.title[observation]),
            "image": self.images.take(self.image[observation]),
            "point": self.points.take(self.point[observation]),
            "component": pa.array(group.components).take(pa.array(component)),
            "residual": complete(result.residual[of_known]) * factor,
            "sigma": sigma[row, component],
            "unit": pa.array([unit for unit, _ in units]).take(pa.array(component)),
            "redundancy": complete(result.redundancy[of_known]),
            "standardized": complete(result.standardized[of_known]),
            "mdb": complete(result.detectable[of_known]) * factor,
            "external": complete(result.external_of(own)[piece, component[known]]),
            "status": _STATUS_NAMES.take(pa.array(status)),
        }


def write_residuals(folder: Path, adjusted: AdjustedBlock, piece: int = PIECE) -> None:
    """residuals.parquet: every component of every observation, also what was rejected or never used.

    Parameters
    ----------
    piece : how many observations are put into columns at once; nothing but memory depends on it.
    """
    write_row_groups(folder / "residuals.parquet", RESIDUALS, _pieces(adjusted, piece))


def _pieces(adjusted: AdjustedBlock, piece: int) -> Iterator[Mapping[str, Any]]:
    """Columns of consecutive rows."""
    unused = adjusted.unused
    image_names, image = _extended(adjusted.block.images, unused["image"])
    point_names, point = _extended(adjusted.block.points, unused["point"])
    images, points = Names.of(image_names), Names.of(point_names)
    events = images if adjusted.block.rig is None else Names.of(adjusted.block.events)
    nobody = np.zeros(0, dtype=np.int64)
    for result in sorted(adjusted.result.groups, key=lambda item: item.group.name):
        group = result.group
        titles, title = _titles(adjusted.block, group)
        if isinstance(group, ImagePoints):
            names, own, more_images, more_points = images, group.image, image, point
            sigma = unused[["sigma_x_mm", "sigma_y_mm"]].to_numpy(np.float64) * 1e3
        else:
            names, own, more_images, more_points = events, group.event, nobody, nobody
            sigma = np.zeros((0, len(group.components)))
        rows = _Rows(
            result,
            titles,
            names,
            points,
            np.concatenate([title, np.zeros_like(more_images)]),
            np.concatenate([own, more_images]),
            np.concatenate([group.point, more_points]),
            sigma,
        )
        order = rows.order()
        for start in range(0, len(order), piece):
            yield rows.columns(order[start : start + piece])


def _extended(names: tuple[str, ...], more: pd.Series) -> tuple[tuple[str, ...], Ints]:
    """The names and those of ``more`` (k,) that are not among them; the indices (k,) of ``more``."""
    if len(more) == 0:
        return names, np.zeros(0, dtype=np.int64)
    index = places_of(more, names)
    new, place = np.unique(more[index < 0].to_numpy(object), return_inverse=True)
    index[index < 0] = len(names) + place
    return (*names, *new), index


def _titles(block: Block, group: ObservationGroup) -> tuple[Names, Ints]:
    """Names of the observations of a group in the table: those of priors include their entity.

    Distances have the point at their other end.
    """
    if isinstance(group, DirectObservations):
        of = next(p for p in block.system if p.family.name == group.family.name)
        entities = [of.quantity(number, 0).entity for number in range(len(of.entities))]
        return Names.of([f"{group.name}:{entity}" for entity in entities]), group.entity
    if isinstance(group, Distances):
        others, row = np.unique(group.other_point, return_inverse=True)
        return Names.of([f"{group.name}:{block.points[point]}" for point in others]), row.astype(np.int64)
    return Names.of([group.name]), np.zeros(len(group.event), dtype=np.int64)
