"""A simulated trajectory and its events through the command line: its time offset is found, it is shown."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from tests.command_line import aerocal

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


def test_the_time_offset_of_a_trajectory_is_found(tmp_path: Path) -> None:
    (tmp_path / "spec.toml").write_text(SPEC, encoding="utf-8")
    folder = tmp_path / "flown"
    for words in (
        ("simulate", tmp_path / "spec.toml", "--out", folder),
        ("run", folder / "project.toml", "--server", "none"),
    ):
        done = aerocal(*words)
        assert done.returncode == 0, done.stderr
    found = pd.read_parquet(folder / "results" / "parameters.parquet").set_index("parameter")["value"]
    # The velocities are those of the block: differences of positions some seconds apart.
    assert abs(found["time_offset"] - 0.003) < 5e-5
    for name, true in (("roll", 0.01), ("pitch", -0.02), ("yaw", 0.03)):
        assert abs(found[f"boresight_{name}"] - true) < 1e-4
    page = (folder / "results" / "report.html").read_text(encoding="utf-8")
    assert 'id="figure-trajectory"' in page
    assert "16 events interpolated between samples 0.005 s apart" in page
