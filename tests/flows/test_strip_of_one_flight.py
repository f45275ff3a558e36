"""Two flights, an error in a strip of one: the other flight is not said to be affected."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from flows.runs.project_run import RunRequest, carry_out
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.flows.adjustment_alone import adjustment_alone

SMALL = (
    "flight.0.lines=3",
    "flight.0.exposures=8",
    "flight.1.lines=2",
    "flight.1.exposures=7",
    'flight.1.flight="2"',
    "points.count=400",
    "control.columns=5",
    "control.rows=4",
)


def test_an_error_in_a_direction_of_one_flight_moves_no_shift_of_another(tmp_path: Path) -> None:
    """Flight 1 has three strips to the east and back, flight 2 two strips across."""
    project = simulate_project(load_simulation("uce-low", SMALL, 3), tmp_path).project_file
    exposures = pd.read_csv(tmp_path / "exposures.csv", dtype={"flight": str})
    exposures.loc[exposures["strip"] == "E02", "x"] += 0.4
    exposures.to_csv(tmp_path / "exposures.csv", index=False)
    outcome = carry_out(adjustment_alone, RunRequest(project))
    assert outcome.error is None, outcome.error
    table = pd.read_parquet(outcome.directory / "model_alternatives.parquet")
    (found,) = table[table["rank"] == 1].to_dict("records")
    assert (found["quantity"], found["scope"]) == ("gnss_shift_x", "direction")
    assert (found["moves"], found["moves_entity"]) == ("gnss_shift_x", "1")
    of_directions = table[(table["scope"] == "direction") & table["quantity"].str.startswith("gnss_shift")]
    moved = of_directions.set_index(["part", "quantity"])["moves_entity"]
    headings = {int(part.rstrip("°")) for part, _ in moved.index}
    assert len(headings) == 4
    for (part, _), entity in moved.items():
        across = abs(abs(int(part.rstrip("°")) - 180) - 90) > 45
        assert entity == ("2" if across else "1")
