"""A block whose names look like numbers gives the same results as one with ordinary names."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from flows.runs.project_run import RunRequest, Story, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.flows.adjustment_alone import adjustment_alone
from tests.flows.hostile_names import renamed

#: Zeros in front, so that names merge with others as soon as anything takes them for numbers.
FORMS = ("{:d}", "0{:d}", "00{:d}", "{:d}.0", "+{:d}", "{:d}e5")


def numbered(names: list[str]) -> dict[str, str]:
    """Name → one that looks like a number; many of them are the same number."""
    return {name: FORMS[k % len(FORMS)].format(k // len(FORMS) + 1) for k, name in enumerate(sorted(names))}


@pytest.mark.parametrize(
    "one_word",
    [
        pytest.param(False, id="numbers", marks=pytest.mark.slow),
        pytest.param(True, id="numbers and a word"),
    ],
)
def test_names_that_look_like_numbers_change_nothing(tmp_path: Path, *, one_word: bool) -> None:
    changes = ("flight.0.exposures=4", "flight.1.exposures=4", "points.count=250", "points.detection=0.7")
    for name in ("plain", "numbered"):
        simulate_project(load_simulation("uce-high", changes), tmp_path / name)
    folder = tmp_path / "numbered"
    control = pd.read_csv(folder / "control.csv", dtype=str)["point"].tolist()
    measured = pd.read_csv(folder / "image_points.csv", dtype=str)
    points = numbered(list({*control, *measured["point"]}))
    if one_word:
        points[control[0]] = "nan"
    images = numbered(list(set(measured["image"])))
    renamed(folder / "image_points.csv", {"image": images.__getitem__, "point": points.__getitem__})
    renamed(folder / "exposures.csv", {"image": images.__getitem__})
    renamed(folder / "control.csv", {"point": points.__getitem__})
    plain = adjusted(tmp_path / "plain", adjustment_alone)
    other = adjusted(tmp_path / "numbered", aerial_triangulation)
    assert other.keys() == plain.keys()
    assert other["sigma0"] == pytest.approx(plain["sigma0"], rel=1e-9)
    assert other["counts"] == plain["counts"]
    for table, key, names in (
        ("exterior_orientations", "image", images),
        ("object_points", "point", points),
        ("control_residuals", "point", points),
    ):
        before, after = (
            pd.read_parquet(tmp_path / name / "results" / f"{table}.parquet")
            for name in ("plain", "numbered")
        )
        assert sorted(after[key]) == sorted(before[key].map(names))


def adjusted(folder: Path, story: Story) -> dict[str, object]:
    outcome = carry_out(story, RunRequest(folder / "project.toml", folder / "results"))
    assert outcome.error is None, outcome.error
    content: dict[str, object] = json.loads((folder / "results" / "summary.json").read_text())
    return content
