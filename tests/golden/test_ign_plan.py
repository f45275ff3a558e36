"""``aerocal plan`` on the real UltraCam Eagle block of IGN France: what its adjustment finds, foretold."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from flows.stories.project_plan import plan_of_project

PROJECT = Path(__file__).resolve().parents[2] / "examples" / "ign_ultracam_eagle" / "project.toml"
FREE = ("boresight", "lever_arm")

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def _environment(test_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AEROCAL_TEST_DATA", str(test_data))


def test_the_focal_length_is_refused_because_one_height_cannot_tell_it_from_the_shift() -> None:
    expectation = plan_of_project(str(PROJECT), propose=False).expectation
    pattern = expectation.pattern
    assert (len(pattern.directions), len(pattern.heights)) == (2, 1)
    assert len(pattern.opposite) == 1
    assert expectation.flight.verdict == "refused"
    focal_length = next(item for item in expectation.quantities if item.parameter == "focal_length")
    assert focal_length.verdict == "not_determinable"
    assert focal_length.strongest is not None
    assert focal_length.strongest.parameter == "gnss_shift_z"
    assert focal_length.strongest.correlation < -0.999
    assert "a second flying height" in focal_length.because
    assert any("one height" in reason for reason in expectation.flight.reasons)


def test_standard_deviations_before_the_adjustment_are_those_after_it(tmp_path: Path) -> None:
    """A posteriori σ over σ0 against the plan, which knows the geometry from intersections only.

    With additional parameters, all of which are kept.
    """
    own = ('adjustment.self_calibration={parameters="brown:K1,K2,P1,P2", elimination="none"}',)
    plan = plan_of_project(str(PROJECT), own, free=FREE, strip_bias_m=0.0, propose=False)
    before = plan.expectation.parameters.set_index("parameter")["sigma"]
    overrides = (*own, 'adjustment.rejection="none"', f"adjustment.free={list(FREE)}")
    outcome = carry_out(aerial_triangulation, RunRequest(PROJECT, tmp_path / "results", overrides))
    assert outcome.error is None, outcome.error
    assert outcome.summary.sigma0 is not None
    table = pd.read_parquet(tmp_path / "results" / "parameters.parquet")
    after = table[table["sigma"].notna()].set_index("parameter")["sigma"] / outcome.summary.sigma0
    assert set(after.index) == set(before.index)
    for name in after.index:
        assert before[name] == pytest.approx(after[name], rel=0.02)
    assert "brown:K1" in before.index
