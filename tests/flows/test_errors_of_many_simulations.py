"""Whether the covariances that a run publishes are those of its errors: a small block, simulated many times.

Files, map projection, refraction and the settings of the project are between truth and estimate, so that an
error of any of them shows as χ² above its degrees of freedom.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from flows.runs.project_run import RunRequest, carry_out
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tasks.tables.covariance import correlation_pairs, covariance_of, sigmas_of
from tests.flows.adjustment_alone import adjustment_alone

SEEDS = 40
FIRST_SEED = 100_000
FALSE_ALARM = 1e-3
#: Two heights and three speeds tell c, x0, y0, lever arm and time offset apart.
SPECIFICATION = """
project = { name = "many", crs = "EPSG:25832", latitude_deg = 48.9, longitude_deg = 8.9 }
camera = { name = "C", columns = 9000, rows = 12000, pixel_um = 6.0, focal_length_mm = 80.0 }
flight = [
  { name = "E", height_m = 1e3, heading_deg = 90.0, exposures = [4, 4], directions = "both" },
  { name = "N", height_m = 1e3, heading_deg = 0.0, exposures = [4, 4], directions = "both", speed_m_s = 5e1 },
  { name = "H", height_m = 2e3, heading_deg = 90.0, exposures = [3], directions = "both", speed_m_s = 110.0 },
  { name = "I", height_m = 2e3, heading_deg = 0.0, exposures = [3], directions = "both", speed_m_s = 110.0 },
]
trajectory = { rate_deg_s = [1.0, 1.0, 1.0] }
terrain = { relief_m = 30.0 }
points = { count = 250, detection = 0.6, min_rays = 3 }
control = { layout = "grid", columns = 4, rows = 4 }
noise = { image_um = 1.5, control_m = 0.02, gnss_m = 0.05, ins_deg = [0.003, 0.003, 0.008] }

[truth]
refraction = true
focal_length_change_mm = -0.020
principal_point_change_mm = [0.015, -0.012]
boresight_deg = [0.3, -0.2, 0.4]
lever_arm_m = [0.3, -0.2, 0.0]
gnss_shift_m = [-0.5, 0.3, 0.6]
time_offset_s = 0.005
strip_bias_m = 0.03
strip_drift_m_s = 0.001
ins_strip_bias_deg = 0.003
ins_drift_deg_s = 0.0001
"""


def squares_of(seed: int, folder: Path) -> tuple[float, int]:
    """eᵀ C⁻¹ e of all system parameters, and their number."""
    (folder / "many.toml").write_text(SPECIFICATION)
    project = simulate_project(load_simulation(str(folder / "many.toml"), (), seed), folder / "block")
    found = carry_out(adjustment_alone, RunRequest(project.project_file, folder / "out"))
    assert found.error is None, found.error
    tables = [pd.read_parquet(found.directory / f"{name}.parquet") for name in ("parameters", "correlations")]
    true = pd.read_parquet(folder / "block" / "truth" / "parameters.parquet")
    keys = ["parameter", "entity", "unit"]
    both = tables[0][tables[0]["sigma"].notna()].merge(true, on=keys, suffixes=("", "_true"))
    names = list(zip(both["parameter"], both["entity"], strict=True))
    covariance = covariance_of(names, sigmas_of(tables[0]), correlation_pairs(tables[1]))
    error = (both["value"] - both["value_true"]).to_numpy(np.float64)
    return float(error @ np.linalg.solve(covariance, error)), len(error)


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_errors_of_all_system_parameters_have_the_published_covariance(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    rows = [
        squares_of(seed, tmp_path_factory.mktemp("seed")) for seed in range(FIRST_SEED, FIRST_SEED + SEEDS)
    ]
    squares, freedom = np.sum(rows, axis=0)
    # Of cameras and flight 13, of the twelve strips twelve each.
    assert freedom == SEEDS * (13 + 12 * 12)
    low, high = stats.chi2.ppf([0.5 * FALSE_ALARM, 1.0 - 0.5 * FALSE_ALARM], freedom)
    assert 0.94 * freedom < low < squares < high < 1.06 * freedom
