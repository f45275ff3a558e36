"""A block with approximate values: its object points intersected from the orientations, and its tables."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.approximate.intersection import IntersectionStatus
from adjust.arrays import Floats, Ints
from adjust.observations.image_point import ImagePoints
from adjust.parameters import State
from tasks.block.given_orientations import GivenOrientations
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, map_from_local
from tasks.tables.parquet import write_stage_table
from tasks.tables.schemas.deliveries import APPROXIMATE_BORESIGHT, APPROXIMATE_POINTS, IMAGES

USED = "used"
WEAK_ANGLE = "weak_angle"
MISMATCH = "mismatch"
STATUS = {
    IntersectionStatus.INTERSECTED: USED,
    IntersectionStatus.FEWER_THAN_TWO_RAYS: "single_ray",
    IntersectionStatus.PARALLEL_RAYS: "parallel_rays",
    IntersectionStatus.BEHIND_A_CAMERA: "behind_a_camera",
}
_NOT_ORIENTED = "not_oriented"


@dataclass(frozen=True, eq=False)
class Approximation:
    """A block with its object points intersected, and the outcome for every point.

    Attributes
    ----------
    point : names of the m points measured in images of the block, ascending.
    x_in_local : (m, 3) NaN where there is no approximate value.
    angle : (m,) largest angle between two rays, radians.  rays : (m,).
    status : (m,) texts, "used" or why not.
    residual_px : (n, 2) column, row residuals of the image points at the intersections.
    height : median flying height above the intersections, metres.
    suspicions : slips of the orientations that the tie points suggest.
    remarks : what was found about them that is not a mistake.
    """

    given: GivenOrientations
    frame: AdjustmentFrame
    image_points: ImagePoints
    state: State
    point: tuple[str, ...]
    x_in_local: Floats
    angle: Floats
    rays: Ints
    status: np.ndarray
    residual_px: Floats
    height: float
    suspicions: tuple[str, ...]
    remarks: tuple[str, ...]


def write_points(folder: Path, found: Approximation, map_frame: MapFrame) -> None:
    """approximate_points.parquet."""
    x_in_map = np.full_like(found.x_in_local, np.nan)
    known = np.isfinite(found.x_in_local).all(axis=1)
    if known.any():
        x_in_map[known] = map_from_local(map_frame, found.frame, found.x_in_local[known])
    columns = {
        "point": found.point,
        **{f"{axis}_m": x_in_map[:, k] for k, axis in enumerate("xyz")},
        "rays": found.rays,
        "angle_deg": np.rad2deg(found.angle),
        "status": found.status,
    }
    write_stage_table(folder, APPROXIMATE_POINTS, columns, map_frame)


def write_boresight(folder: Path, given: GivenOrientations) -> None:
    """approximate_boresight.parquet: where the adjustment begins."""
    angles = np.rad2deg(given.mountings.boresight)
    columns = {
        "camera": list(given.mountings.names),
        **{f"{name}_deg": angles[:, k] for k, name in enumerate(("roll", "pitch", "yaw"))},
    }
    write_stage_table(folder, APPROXIMATE_BORESIGHT, columns)


def write_images(folder: Path, found: Approximation, absent: pd.DataFrame) -> None:
    """images.parquet: heading and height above the object points of every image of the block.

    Parameters
    ----------
    absent : exposures of the images that could not be oriented.
    """
    given = found.given
    used = (found.status == USED)[found.image_points.point]
    ground = np.full(len(given.image), np.nan)
    frame = pd.DataFrame(
        {
            "image": found.image_points.image[used],
            "z": found.frame.height(found.x_in_local[found.image_points.point[used]]),
        }
    )
    medians = frame.groupby("image")["z"].median()
    ground[medians.index.to_numpy()] = medians.to_numpy()
    above = found.frame.height(found.state.projection_centre) - ground
    nothing = np.full(len(absent), np.nan)
    names = given.mountings.names
    columns = {
        "image": [*given.image, *absent["image"]],
        "camera": [*(names[i] for i in given.camera), *absent["camera"]],
        "strip": [*(s or None for s in given.strip), *absent["strip"]],
        "flight": [*(f or None for f in given.flight), *absent["flight"]],
        "heading_deg": np.concatenate([np.rad2deg(given.headings()) % 360.0, nothing]),
        "height_above_ground_m": np.concatenate([above, nothing]),
        "status": [USED] * len(given.image) + [_NOT_ORIENTED] * len(absent),
    }
    write_stage_table(folder, IMAGES, columns)
