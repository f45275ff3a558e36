"""Two flights that number their strips alike: motion, biases and names belong to the strips of each."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from flows.stories.project_plan import plan_of_project
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.flows.adjustment_alone import adjustment_alone
from tests.flows.second_head import add_second_head

CHANGES = (
    "points.count=350",
    "points.detection=0.6",
    *(f"flight.{low}.{name}={number}" for low in (0, 1) for name, number in (("lines", 3), ("exposures", 8))),
    *(f"flight.{high}.exposures=4" for high in (2, 3)),
    'flight.1.flight="2"',
    'flight.3.flight="2"',
    "truth.time_offset_s=0.004",
)
FREE = (
    'adjustment.free=["boresight", "gnss_shift", "gnss_strip_bias", "time_offset", "focal_length", '
    '"principal_point"]'
)


def flown(folder: Path, strip: str | None) -> Path:
    """A flight whose strips have names of their own, are numbered in each flight, or have no names."""
    simulate_project(load_simulation("uce-calibration", CHANGES), folder)
    file = folder / "exposures.csv"
    table = pd.read_csv(file, dtype={"flight": str})
    if strip == "numbered":
        table["strip"] = table.groupby("flight")["strip"].transform(lambda own: pd.factorize(own)[0] + 1)
    elif strip is None:
        table["strip"] = None
    table.to_csv(file, index=False)
    return folder


def adjusted(folder: Path) -> RunOutcome:
    return carry_out(adjustment_alone, RunRequest(folder / "project.toml", folder / "results", (FREE,)))


def test_flights_that_number_their_strips_alike_give_what_others_give(tmp_path: Path) -> None:
    found = {}
    for naming in ("unique", "numbered"):
        folder = flown(tmp_path / naming, naming)
        outcome = adjusted(folder)
        assert outcome.error is None, outcome.error
        found[naming] = pd.read_parquet(folder / "results" / "parameters.parquet")
    same = [name for name in found["unique"].columns if name not in ("entity", "strip")]
    for parameter, own in found["unique"].groupby("parameter"):
        other = found["numbered"][found["numbered"]["parameter"] == parameter]
        pd.testing.assert_frame_equal(
            own[same].sort_values("value", ignore_index=True),
            other[same].sort_values("value", ignore_index=True),
            rtol=1e-6,
        )
    offsets = found["numbered"][found["numbered"]["parameter"] == "time_offset"]
    assert (np.abs(offsets["value"] - 0.004) < 3.5 * offsets["sigma"]).all()
    biases = set(found["numbered"].loc[found["numbered"]["parameter"] == "gnss_strip_bias_x", "entity"])
    assert {"1 of flight 1", "1 of flight 2"} <= biases


def test_times_without_strips_are_refused_with_what_to_do(tmp_path: Path) -> None:
    outcome = adjusted(flown(tmp_path, None))
    assert outcome.summary.status == "input_error"
    assert "The exposures contain no strips" in str(outcome.error)


def test_heads_that_expose_at_one_moment_have_one_velocity_and_one_reading(tmp_path: Path) -> None:
    # The signals of two heads never come in the same microsecond.
    folder = flown(tmp_path, "numbered")
    add_second_head(folder, later_us=20)
    outcome = adjusted(folder)
    assert outcome.error is None, outcome.error
    assert any("exposed at" in text and "is used once" in text for text in outcome.summary.problems)
    residuals = pd.read_parquet(folder / "results" / "residuals.parquet")
    positions = residuals[residuals["group"] == "gnss_positions"]
    assert positions["sigma"].to_numpy() == pytest.approx(0.05 * np.sqrt(2.0))
    parameters = pd.read_parquet(folder / "results" / "parameters.parquet")
    (first, second) = parameters[parameters["parameter"] == "time_offset"].itertuples()
    assert first.value == pytest.approx(0.004, abs=3.5 * first.sigma)
    assert second.value == pytest.approx(0.004, abs=3.5 * second.sigma)
    sigma0 = {one["group"]: one["sigma0"] for one in outcome.summary.groups}
    # Of readings counted twice they would be near 0.75.
    assert [sigma0["gnss_positions"], sigma0["ins_attitudes"]] == pytest.approx([1.0, 1.0], abs=0.15)


def test_variance_components_do_not_undo_that_heads_share_a_reading(tmp_path: Path) -> None:
    folder = flown(tmp_path, "numbered")
    add_second_head(folder, later_us=20)
    changes = (FREE, "adjustment.variance_components=true")
    outcome = carry_out(adjustment_alone, RunRequest(folder / "project.toml", folder / "results", changes))
    assert outcome.error is None, outcome.error
    table = dict(outcome.summary.to_json())["variance_components"]["components"]
    found = {row["part"]: row["factor"] for row in table if row["estimated"]}
    readings = [found[part] for part in found if part.startswith(("gnss_positions", "ins_attitudes"))]
    assert len(readings) == 4, found
    # Factors near √½ would make each reading count twice.
    assert readings == pytest.approx([1.0] * 4, abs=0.2), found


def test_a_plan_counts_a_reading_of_two_heads_once_like_the_adjustment(tmp_path: Path) -> None:
    folder = flown(tmp_path, "numbered")
    add_second_head(folder)
    free = 'adjustment.free=["boresight", "gnss_shift", "focal_length", "principal_point"]'
    changes = (free, 'adjustment.sigma0="a_priori"')
    outcome = carry_out(adjustment_alone, RunRequest(folder / "project.toml", folder / "results", changes))
    assert outcome.error is None, outcome.error
    keys = ["parameter", "entity"]
    found = pd.read_parquet(folder / "results" / "parameters.parquet").set_index(keys)["sigma"]
    plan = plan_of_project(str(folder / "project.toml"), strip_bias_m=0.0, propose=False)
    expected = plan.expectation.parameters.set_index(keys)["sigma"]
    # Counted twice, the readings would make them 0.71 to 0.77 times as large.
    assert (expected / found.reindex(expected.index)).to_numpy() == pytest.approx(1.0, abs=0.05)


@pytest.fixture(scope="module")
def over_the_end(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with a strip over the end of a week, and results of a run that uses no times."""
    folder = flown(tmp_path_factory.mktemp("week"), "unique")
    file = folder / "exposures.csv"
    table = pd.read_csv(file, dtype={"flight": str})
    own = table[table["strip"] == table["strip"].iloc[-1]]
    table["time"] = (table["time"] - own["time"].iloc[1] + 0.5) % 604_800.0
    table.to_csv(file, index=False)
    request = RunRequest(folder / "project.toml", folder / "results", ("adjustment.free=[]",))
    outcome = carry_out(adjustment_alone, request)
    assert outcome.error is None, outcome.error
    return folder


@pytest.mark.parametrize(
    "free", [FREE, 'adjustment.free=["ins_drift"]', "adjustment.gnss_correlation_s=60.0"]
)
def test_a_strip_over_the_end_of_a_week_is_refused_where_its_times_are_used(
    over_the_end: Path, tmp_path: Path, free: str
) -> None:
    shutil.copytree(over_the_end / "results" / ".store", tmp_path / ".store")
    error = carry_out(adjustment_alone, RunRequest(over_the_end / "project.toml", tmp_path, (free,))).error
    # Sorted by time, the exposure before the end of the week comes last.
    assert re.search(r"of images (\w+)_002 and \1_001 of strip \1 are 604,7", str(error)), error
    assert "604800" in str(error)
