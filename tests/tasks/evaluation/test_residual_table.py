"""The table of residuals beside its naive twin, which builds one row after the other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adjust.adjustment import adjust_block
from adjust.observations.direct import DirectObservations
from adjust.options import AdjustmentOptions
from adjust.parameters import GNSS_STRIP_BIAS, LEVER_ARM
from adjust.result import ObservationStatus
from adjust.solve.system import Observations
from tasks.block.block_input import SurveyedPoints
from tasks.coordinates.crs import MapFrame
from tasks.evaluation.residual_table import write_residuals
from tasks.evaluation.result_tables import AdjustedBlock, reported_unit_of, write_object_points
from tasks.settings.coordinates import ELLIPSOIDAL
from tasks.store.artifact import artifact_of
from tasks.tables.parquet import read_table
from tests.adjust.scenes import ALL_FREE, two_strips

KEY = ["group", "image", "point", "component"]
NOTHING = np.zeros((0, 3))
NO_SURVEY = SurveyedPoints(
    (), np.zeros(0, dtype=bool), NOTHING, np.zeros(0), np.zeros((0, 3, 3)), NOTHING > 0.0
)


def adjusted_block(unused: pd.DataFrame) -> AdjustedBlock:
    """Two strips with every group of observations, some gross errors, and names that are not in order."""
    scene = two_strips(
        cameras=2, flights=2, free=ALL_FREE, priors={GNSS_STRIP_BIAS: 0.1, LEVER_ARM: 0.2}, noise_seed=5
    )
    block = scene.block
    images = tuple(f"img{k}" for k in reversed(range(len(block.images))))
    points = tuple(str(97 * k % 1009) for k in range(len(block.points)))
    block = replace(block, images=images, points=points)
    rays = scene.observations.image_points
    xy = rays.xy.copy()
    xy[::53] += 3e-4
    observations = Observations(replace(rays, xy=xy), scene.observations.others)
    result = adjust_block(block, observations, AdjustmentOptions(critical_value=4.13))
    assert result.groups[0].rejected >= 3
    frame = MapFrame.of("EPSG:32632", ELLIPSOIDAL)
    return AdjustedBlock(block, result, frame, block.frame, 1.0, NO_SURVEY, unused)


def naive_rows(adjusted: AdjustedBlock) -> pd.DataFrame:
    status = {status: status.name.lower() for status in ObservationStatus}
    block, rows = adjusted.block, []
    for result in adjusted.result.groups:
        group = result.group
        for n, k in np.argwhere(np.isfinite(result.sigma)):
            title = group.name
            if isinstance(group, DirectObservations):
                (entities,) = (p.entities for p in block.system if p.family.name == group.family.name)
                title += f":{entities[group.entity[n]]}"
            image, point = group.event[n], group.point[n]
            unit, factor = reported_unit_of(group, int(k))
            rows.append(
                {
                    "group": title,
                    "image": block.images[image] if image >= 0 else None,
                    "point": block.points[point] if point >= 0 else None,
                    "component": group.components[k],
                    "residual": result.residual[n, k] * factor,
                    "sigma": result.sigma[n, k] * factor,
                    "unit": unit,
                    "redundancy": result.redundancy[n, k],
                    "standardized": result.standardized[n, k],
                    "mdb": result.detectable[n, k] * factor,
                    "external": result.external[n, k],
                    "status": status[ObservationStatus(result.status[n, k])],
                }
            )
    for ray in adjusted.unused.itertuples():
        for component, sigma in (("x", ray.sigma_x_mm), ("y", ray.sigma_y_mm)):
            names = {"group": "image_points", "image": ray.image, "point": ray.point, "component": component}
            rows.append(names | {"sigma": sigma * 1e3, "unit": "um", "status": "not_used"})
    table = pd.DataFrame(rows)
    keys = table[KEY].astype(object).where(table[KEY].notna(), None).to_numpy()
    order = sorted(range(len(table)), key=lambda row: [(name is None, name or "") for name in keys[row]])
    return table.loc[order].reset_index(drop=True)


@pytest.fixture(scope="module")
def unused() -> pd.DataFrame:
    """Known and unknown images and points, between the others in the order and behind them."""
    return pd.DataFrame(
        {
            "image": ["img3", "img3", "a", "zz", "img0"],
            "point": ["5000", "single", "5000", "0", "single"],
            "sigma_x_mm": [0.002, 0.003, 0.002, 0.004, 0.002],
            "sigma_y_mm": [0.001, 0.003, 0.005, 0.004, 0.002],
        }
    )


@pytest.mark.parametrize("with_unused", [True, False])
def test_every_component_of_every_observation_has_its_row(
    tmp_path: Path, unused: pd.DataFrame, with_unused: bool
) -> None:
    adjusted = adjusted_block(unused if with_unused else unused[:0])
    write_residuals(tmp_path, adjusted)
    found = read_table(artifact_of(tmp_path / "residuals.parquet"))
    expected = naive_rows(adjusted)
    assert {"used", "rejected", "uncontrolled"} <= set(found["status"])
    assert list(found.columns) == list(expected.columns)
    for name in found.columns:
        if found[name].dtype == np.float64:
            np.testing.assert_array_equal(found[name], expected[name], err_msg=name)
        else:
            mine, other = (t[name].astype(object).where(t[name].notna(), None) for t in (found, expected))
            assert mine.tolist() == other.tolist(), name


def test_the_bytes_do_not_depend_on_the_pieces_a_table_is_written_in(
    tmp_path: Path, unused: pd.DataFrame
) -> None:
    adjusted = adjusted_block(unused)
    for name, piece in (("small", 7), ("large", 100_000)):
        (tmp_path / name).mkdir()
        write_residuals(tmp_path / name, adjusted, piece)
        write_object_points(tmp_path / name, adjusted, piece)
    for table in ("residuals", "object_points"):
        small, large = (tmp_path / name / f"{table}.parquet" for name in ("small", "large"))
        assert small.read_bytes() == large.read_bytes(), table
