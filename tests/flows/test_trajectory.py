"""A simulated trajectory and its events through the command line: its time offset is found, it is shown."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from flows.runs.project_run import RunRequest, carry_out
from tests.command_line import aerocal
from tests.flows.adjustment_alone import adjustment_alone

SPEC = """
preset = "uce-high"
[project]
crs = "EPSG:25832"
latitude_deg = 48.9
longitude_deg = 9.3
[[flight]]
name = "S"
height_m = 1950.0
heading_deg = 70.0
exposures = [4, 4]
speed_m_s = 60.0
[[flight]]
name = "X"
height_m = 1950.0
heading_deg = 160.0
exposures = [4, 4]
speed_m_s = 60.0
[points]
count = 100
[control]
control = 9
[trajectory]
sbet_hz = 200.0
[truth]
time_offset_s = 0.003
boresight_deg = [0.01, -0.02, 0.03]
gnss_shift_m = [0.0, 0.0, 0.0]
[noise]
level = 0
"""


def _simulated(tmp_path: Path) -> Path:
    """The folder of the simulated project."""
    (tmp_path / "spec.toml").write_text(SPEC, encoding="utf-8")
    folder = tmp_path / "flown"
    done = aerocal("simulate", tmp_path / "spec.toml", "--out", folder)
    assert done.returncode == 0, done.stderr
    return folder


def test_the_time_offset_of_a_trajectory_is_found(tmp_path: Path) -> None:
    folder = _simulated(tmp_path)
    done = aerocal("run", folder / "project.toml", "--server", "none")
    assert done.returncode == 0, done.stderr
    found = pd.read_parquet(folder / "results" / "parameters.parquet").set_index("parameter")["value"]
    # The positions move by the velocities of the trajectory.
    assert abs(found["time_offset"] - 0.003) < 1e-6
    for name, true in (("roll", 0.01), ("pitch", -0.02), ("yaw", 0.03)):
        assert abs(found[f"boresight_{name}"] - true) < 1e-4
    page = (folder / "results" / "report.html").read_text(encoding="utf-8")
    assert 'id="figure-trajectory"' in page
    assert "16 events interpolated between samples 0.005 s apart" in page


def test_it_is_found_by_the_delivered_velocities_where_no_strips_are_known(tmp_path: Path) -> None:
    folder = _simulated(tmp_path)
    events = pd.read_csv(folder / "events.csv")
    # Rows in no order, and nothing to tell the strips by.
    events.drop(columns="strip").sample(frac=1.0, random_state=7).to_csv(folder / "events.csv", index=False)
    outcome = carry_out(adjustment_alone, RunRequest(folder / "project.toml"))
    assert outcome.error is None, outcome.error
    found = pd.read_parquet(folder / "results" / "parameters.parquet").set_index("parameter")["value"]
    assert abs(found["time_offset"] - 0.003) < 1e-6
    delivered = pd.read_parquet(folder / "results" / "exposures.parquet")
    speed = np.linalg.norm(delivered[[f"velocity_{way}_m_s" for way in ("east", "north", "up")]], axis=1)
    np.testing.assert_allclose(speed, 60.0, rtol=0.02)
