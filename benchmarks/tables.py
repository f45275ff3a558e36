"""The tables of an adjusted problem: what a run would leave behind of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from adjust.block import Block
from adjust.geometry.earth import TopocentricFrame
from adjust.result import AdjustmentResult
from tasks.block.block_input import SurveyedPoints
from tasks.coordinates.crs import MapFrame
from tasks.evaluation.residual_table import write_residuals
from tasks.evaluation.result_tables import AdjustedBlock, write_exterior_orientations, write_object_points
from tasks.settings.coordinates import ELLIPSOIDAL

# Any place on the earth makes the way to map coordinates as long as it is for a delivery.
_CRS, _LATITUDE_DEG, _LONGITUDE_DEG = "EPSG:32632", 48.9, 8.9


def write_tables(folder: Path, block: Block, result: AdjustmentResult) -> float:
    """Write orientations, object points and residuals with all of their statistics; how many MiB they are."""
    map_frame = MapFrame.of(_CRS, ELLIPSOIDAL)
    frame = TopocentricFrame(map_frame.ellipsoid, np.deg2rad(_LATITUDE_DEG), np.deg2rad(_LONGITUDE_DEG))
    nothing = np.zeros((0, 3))
    surveyed = SurveyedPoints(
        (), np.zeros(0, dtype=bool), nothing, np.zeros(0), np.zeros((0, 3, 3)), nothing.astype(bool)
    )
    unused = pd.DataFrame({name: [] for name in ("image", "point", "sigma_x_mm", "sigma_y_mm")})
    adjusted = AdjustedBlock(block, result, map_frame, frame, result.test.sigma0, surveyed, unused)
    for write in (write_exterior_orientations, write_object_points, write_residuals):
        write(folder, adjusted)
    return sum(file.stat().st_size for file in folder.iterdir()) / 2**20
