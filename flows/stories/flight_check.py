"""Flight check: simulate a block, adjust it like any other, compare the result with the truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from flows.runs.stage import stage
from flows.stories.aerial_triangulation import aerial_triangulation
from flows.stories.system_calibration import system_calibration
from tasks.settings.simulation import Simulation
from tasks.simulation import simulate, truth_comparison
from tasks.simulation.truth_comparison import TruthComparison

simulate_project = stage(simulate.simulate_project)
compare_with_truth = stage(truth_comparison.compare_with_truth)


@dataclass(frozen=True)
class FlightCheck:
    """The outcome of the run, and how it compares with the truth; None if there is no result."""

    outcome: RunOutcome
    comparison: TruthComparison | None


def flight_check(simulation: Simulation, directory: Path, *, calibrates: bool = False) -> FlightCheck:
    """Simulate into a folder, run the project found there, compare the results with the truth.

    Parameters
    ----------
    calibrates : run the system calibration, not the aerial triangulation alone.
    """
    files = simulate_project(simulation, directory)
    story = system_calibration if calibrates else aerial_triangulation
    outcome = carry_out(story, RunRequest(files.project_file))
    if outcome.error is not None:
        return FlightCheck(outcome, None)
    return FlightCheck(outcome, compare_with_truth(directory, outcome.directory))
