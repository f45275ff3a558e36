"""Points of an adjusted block: measured in images, adjusted on the ground, surveyed."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Floats, Ints
from tasks.coordinates.local_frame import local_from_map
from tasks.handover.results import Results, read_result_table
from tasks.tables.schemas.adjustment import CHECK_POINTS, CONTROL_RESIDUALS, OBJECT_POINTS, RESIDUALS
from tasks.tables.schemas.deliveries import CONTROL_POINTS, IMAGE_POINTS

_XYZ = ["x_m", "y_m", "z_m"]
_SIGMA = ["sigma_x_m", "sigma_y_m", "sigma_z_m"]
_DIFFERENCE = ["dx_m", "dy_m", "dz_m"]


@dataclass(frozen=True, eq=False)
class SurveyedPoints:
    """s control and check points.

    Attributes
    ----------
    names : of the points.
    in_map, local : (s, 3) as surveyed, metres; NaN where a coordinate is not known, and then all of
        a point in the local frame.
    sigma : (s, 3) metres.
    check : (s,) whether it entered no adjustment.
    difference : (s, 3) adjusted − surveyed, map axes, metres; NaN where there is none.
    """

    names: tuple[str, ...]
    in_map: Floats
    local: Floats
    sigma: Floats
    check: np.ndarray
    difference: Floats


@dataclass(frozen=True, eq=False)
class BlockPoints:
    """m image points of p object points.

    Attributes
    ----------
    names : of the object points.
    in_map, local : (p, 3) adjusted, metres.
    sigma : (p, 3) metres.
    image, point : (m,) index of the image and of the object point; sorted by image, then point.
    xy, sigma_xy : (m, 2) measured, and its σ before the adjustment, metres in the image system.
    surveyed : control and check points; none if nothing was surveyed.
    """

    names: tuple[str, ...]
    in_map: Floats
    local: Floats
    sigma: Floats
    image: Ints
    point: Ints
    xy: Floats
    sigma_xy: Floats
    surveyed: SurveyedPoints

    @property
    def rays(self) -> Ints:
        """(p,) number of image points of each object point."""
        return np.bincount(self.point, minlength=len(self.names)).astype(np.int64)

    @property
    def rays_of_points(self) -> list[Ints]:
        """The image points of each point, in the order of their images."""
        order = np.argsort(self.point, kind="stable")
        ends = np.searchsorted(self.point[order], np.arange(len(self.names) + 1))
        return [order[first:end] for first, end in pairwise(ends)]

    @property
    def surveyed_at(self) -> dict[str, int]:
        """Place of each surveyed point among the surveyed ones."""
        return {name: k for k, name in enumerate(self.surveyed.names)}

    def numbered(self, first: int = 0) -> list[list[object]]:
        """Number, name and role (check, control or tie) of each point."""
        role = {k: "check" if check else "control" for k, check in enumerate(self.surveyed.check)}
        at = self.surveyed_at
        return [[k, name, role.get(at.get(name, -1), "tie")] for k, name in enumerate(self.names, first)]

    @property
    def is_surveyed(self) -> np.ndarray:
        """(p,) whether an object point is a control or check point."""
        return np.isin(np.array(self.names, dtype=object), np.array(self.surveyed.names, dtype=object))


def no_points() -> BlockPoints:
    """For formats without points."""
    none, index = np.zeros((0, 3)), np.zeros(0, dtype=np.int64)
    surveyed = SurveyedPoints((), none, none, none, np.zeros(0, dtype=bool), none)
    return BlockPoints((), none, none, none, index, index, np.zeros((0, 2)), np.zeros((0, 2)), surveyed)


def read_points(folder: Path, results: Results) -> BlockPoints:
    """The points of the results in a folder; image points that were rejected are left out.

    Raises
    ------
    InputError
        If a table is missing.
    """
    objects = read_result_table(folder, OBJECT_POINTS)
    measured = read_result_table(folder, IMAGE_POINTS)
    residuals = read_result_table(folder, RESIDUALS)
    bad = residuals[(residuals["group"] == "image_points") & (residuals["status"] == "rejected")]
    rejected = pd.MultiIndex.from_frame(bad[["image", "point"]].astype(str))
    measured = measured[~pd.MultiIndex.from_frame(measured[["image", "point"]]).isin(rejected)]
    given = read_result_table(folder, CONTROL_POINTS)
    return block_points(results, objects, measured, given, _differences(folder))


def block_points(
    results: Results,
    objects: pd.DataFrame,
    measured: pd.DataFrame,
    given: pd.DataFrame,
    differences: pd.DataFrame | None = None,
) -> BlockPoints:
    """The points of a block from its tables.

    Parameters
    ----------
    objects : point, x_m, y_m, z_m, and their σ where they are adjusted.
    measured : image_points.parquet; only points among the objects are taken.
    given : control_points.parquet.
    differences : adjusted − surveyed by point; None: nothing is adjusted.
    """
    image = pd.Index(results.images.names).get_indexer(pd.Index(measured["image"]))
    point = pd.Index(objects["point"]).get_indexer(pd.Index(measured["point"]))
    kept = (image >= 0) & (point >= 0)
    order = np.lexsort((point[kept], image[kept]))
    in_map = objects[_XYZ].to_numpy(np.float64)
    sigma = objects.reindex(columns=_SIGMA).to_numpy(np.float64)
    return BlockPoints(
        tuple(str(name) for name in objects["point"]),
        in_map,
        _local(results, in_map),
        sigma,
        image[kept][order].astype(np.int64),
        point[kept][order].astype(np.int64),
        measured[["x_mm", "y_mm"]].to_numpy(np.float64)[kept][order] * 1e-3,
        measured[["sigma_x_mm", "sigma_y_mm"]].to_numpy(np.float64)[kept][order] * 1e-3,
        _surveyed(results, given, differences),
    )


def _differences(folder: Path) -> pd.DataFrame:
    tables = (CONTROL_RESIDUALS, CHECK_POINTS)
    columns = ["point", *_DIFFERENCE]
    return pd.concat([read_result_table(folder, schema)[columns] for schema in tables]).set_index("point")


def _surveyed(results: Results, given: pd.DataFrame, differences: pd.DataFrame | None) -> SurveyedPoints:
    in_map = given[_XYZ].to_numpy(np.float64)
    return SurveyedPoints(
        tuple(str(name) for name in given["point"]),
        in_map,
        _local(results, in_map),
        given[_SIGMA].to_numpy(np.float64),
        (given["role"] == "check").to_numpy(),
        np.full_like(in_map, np.nan)
        if differences is None
        else differences.reindex(given["point"]).to_numpy(np.float64),
    )


def _local(results: Results, in_map: Floats) -> Floats:
    local = np.full_like(in_map, np.nan)
    known = np.isfinite(in_map).all(axis=1)
    local[known] = local_from_map(results.images.map_frame, results.images.frame, in_map[known])
    return local
