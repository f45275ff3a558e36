"""Seven UltraCam Eagle images of IGN's Borea test set: datum, geoid, projection and angle conventions.

Expected values: README.md of the data folder.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from flows.stories.examination import examine_everything
from tasks.settings.load import load_project
from tasks.store.store import Store

PROJECT = Path(__file__).resolve().parents[2] / "examples" / "ign_borea" / "project.toml"


@pytest.fixture
def reprojection(test_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """RMS in pixels of the control points projected with the given orientations."""
    monkeypatch.setenv("AEROCAL_TEST_DATA", str(test_data))

    def run(*overrides: str) -> list[float]:
        store = Store.of(tmp_path / "out")
        store.begin_run()
        approximate = examine_everything(load_project(PROJECT, overrides), store).findings[-1]
        return approximate.figures["given_orientations"]["control_reprojection_rms_px"]

    return run


def test_control_fits_the_given_orientations(reprojection) -> None:
    assert reprojection() == pytest.approx([0.70, 0.35], abs=0.05)


def test_the_linear_alteration_is_worth_three_pixels(reprojection) -> None:
    geoid = "${AEROCAL_TEST_DATA}/ign_borea_uce_m3/fr_ign_RAF20.tif"
    without = reprojection(f'inputs.exposures.heights={{geoid="{geoid}"}}')
    assert without == pytest.approx([3.30, 1.55], abs=0.05)
