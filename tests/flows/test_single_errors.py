"""A block with one mistake: what is named is the mistake, and not the shift that it looks like."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pandas as pd
import pytest

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """60 images in parallel strips, with INS and control; the GNSS shift is free, nothing is rejected."""
    simulation = load_simulation("dmc-20cm", ("points.count=300",), 4)
    return simulate_project(simulation, tmp_path_factory.mktemp("flight")).project_file


def findings(
    flight: Path, out: Path, file: str, row: int, changes: dict[str, float]
) -> list[dict[str, object]]:
    """What the tests of the model find after some numbers of a row of a delivery were changed."""
    folder = flight.parent
    table = pd.read_csv(folder / file, dtype={"point": str, "image": str})
    for column, error in changes.items():
        table.loc[row, column] += error
    delivered = out.parent / file
    table.to_csv(delivered, index=False)
    key = {"control.csv": "control", "exposures.csv": "exposures"}[file]
    found = carry_out(
        aerial_triangulation,
        RunRequest(
            flight, out, overrides=(f'inputs.{key}.file="{delivered}"', 'adjustment.rejection="none"')
        ),
    )
    assert found.error is None, found.error
    summary = json.loads((found.directory / "summary.json").read_text())
    return list(summary["model_findings"])


def test_a_sound_block_has_no_finding(flight: Path, tmp_path: Path) -> None:
    assert findings(flight, tmp_path / "results", "control.csv", 0, {}) == []


@pytest.mark.parametrize(
    ("file", "row", "changes", "quantity", "axis"),
    [
        ("exposures.csv", 20, {"y": 2.0}, "gnss_position", "y +"),
        ("exposures.csv", 33, {"roll": 0.2}, "ins_attitude", "roll +"),
        ("control.csv", 6, {"z": -1.5}, "control_point", "z -"),
    ],
)
def test_a_single_mistake_is_named_and_nothing_else(
    flight: Path, tmp_path: Path, file: str, row: int, changes: dict[str, float], quantity: str, axis: str
) -> None:
    (found,) = findings(flight, tmp_path / "results", file, row, changes)
    entity = pd.read_csv(flight.parent / file, dtype=str).iloc[row, 0]
    assert (found["quantity"], found["entity"]) == (quantity, entity)
    assert f"contradicts the rest by {axis}" in str(found["sentence"])
    (error,) = changes.values()
    size = re.search(r"by \w+ ([+-][\d.]+) ±", str(found["sentence"]))
    assert size is not None
    assert float(size.group(1)) == pytest.approx(error, rel=0.25)
