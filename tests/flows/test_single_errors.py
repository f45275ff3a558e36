"""A block with one mistake: what is named is the mistake, and not the shift that it looks like."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.flows.adjustment_alone import adjustment_alone


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """60 images in parallel strips, with INS and control; the GNSS shift is free, nothing is rejected."""
    simulation = load_simulation("dmc-20cm", ("points.count=300",), 4)
    return simulate_project(simulation, tmp_path_factory.mktemp("flight")).project_file


def carried_out(
    flight: Path, out: Path, file: str, rows: slice, changes: dict[str, Any], rejection: str = '"none"'
) -> Path:
    """The results after some numbers in rows of a delivery were changed."""
    folder = flight.parent
    table = pd.read_csv(folder / file, dtype={"point": str, "image": str})
    for column, error in changes.items():
        table.iloc[rows, table.columns.get_loc(column)] += error
    delivered = out.parent / file
    table.to_csv(delivered, index=False)
    key = {"control.csv": "control", "exposures.csv": "exposures"}[file]
    found = carry_out(
        aerial_triangulation,
        RunRequest(
            flight,
            out,
            overrides=(f'inputs.{key}.file="{delivered}"', f"adjustment.rejection={rejection}"),
        ),
    )
    assert found.error is None, found.error
    return found.directory


def findings(results: Path) -> list[dict[str, object]]:
    """What the tests of the model found."""
    return list(json.loads((results / "summary.json").read_text())["model_findings"])


def top_of_report(results: Path) -> tuple[str, str]:
    """The tone of the verdict, and all that stands before the problems of the report."""
    html = (results / "report.html").read_text(encoding="utf-8")
    tone = re.search(r'class="verdict (\w+)"', html)
    assert tone is not None
    text = re.sub(r"<[^>]+>", "", html[tone.start() : html.index("<nav>")])
    return tone.group(1), text


def test_a_sound_block_has_no_finding_and_a_green_verdict(flight: Path, tmp_path: Path) -> None:
    results = carried_out(flight, tmp_path / "results", "control.csv", slice(0), {})
    assert findings(results) == []
    tone, text = top_of_report(results)
    assert tone == "good"
    assert "Look at" not in text


@pytest.mark.parametrize(
    ("file", "row", "changes", "quantity", "words"),
    [
        ("exposures.csv", 20, {"y": 2.0}, "gnss_position", "too far north"),
        ("exposures.csv", 33, {"roll": 0.2}, "ins_attitude", "computed − given roll −"),
        ("control.csv", 6, {"z": -1.5}, "control_point", "too low"),
    ],
)
def test_a_single_mistake_is_named_and_nothing_else(
    flight: Path, tmp_path: Path, file: str, row: int, changes: dict[str, float], quantity: str, words: str
) -> None:
    results = carried_out(flight, tmp_path / "results", file, slice(row, row + 1), changes)
    (found,) = findings(results)
    entity = pd.read_csv(flight.parent / file, dtype=str).iloc[row, 0]
    assert (found["quantity"], found["entity"]) == (quantity, entity)
    assert words in str(found["sentence"])
    (error,) = changes.values()
    size = re.search(r"([\d.]+) ±", str(found["sentence"]))
    assert size is not None
    assert float(size.group(1)) == pytest.approx(abs(error), rel=0.25)
    tone, text = top_of_report(results)
    assert tone == "attention"
    place = f"control point {entity}" if file == "control.csv" else f"image {entity}"
    assert re.findall("Look at ([^.]+)\\.", text) == [place]
    assert str(found["sentence"]) in text


@pytest.mark.parametrize(
    ("file", "row", "changes", "words"),
    [
        ("exposures.csv", 20, {"y": 2.0}, "Its GNSS position was rejected: computed − given y −"),
        ("exposures.csv", 33, {"roll": 0.2}, "Its INS attitude was rejected: computed − given roll −"),
        ("control.csv", 6, {"z": -1.5}, "not used as control: computed − given z +"),
    ],
)
def test_what_was_rejected_is_named_first_and_once(
    flight: Path, tmp_path: Path, file: str, row: int, changes: dict[str, float], words: str
) -> None:
    results = carried_out(flight, tmp_path / "results", file, slice(row, row + 1), changes, "{}")
    entity = pd.read_csv(flight.parent / file, dtype=str).iloc[row, 0]
    tone, text = top_of_report(results)
    assert tone == "attention"
    assert len(re.findall("Look at ", text)) == 1
    assert f"{entity}. " in text
    assert words in text


@pytest.mark.parametrize("rejection", ['"none"', "{}"])
def test_a_shifted_strip_is_one_cause(flight: Path, tmp_path: Path, rejection: str) -> None:
    exposures = pd.read_csv(flight.parent / "exposures.csv", dtype=str)
    strip = exposures["strip"].unique()[1]
    rows = exposures.index[exposures["strip"] == strip]
    results = carried_out(
        flight, tmp_path / "results", "exposures.csv", slice(rows[0], rows[-1] + 1), {"x": 0.6}, rejection
    )
    tone, text = top_of_report(results)
    assert tone == "attention"
    assert re.findall("Look at ([^.]+)\\.", text) == [f"strip {strip}"]


@pytest.mark.parametrize("rejection", ['"none"', "{}"])
def test_positions_that_drift_along_a_strip_are_one_cause(
    flight: Path, tmp_path: Path, rejection: str
) -> None:
    """0.03 m/s, up to 1.3 m: no six wrong positions, no scale of the control, and no other strip."""
    exposures = pd.read_csv(flight.parent / "exposures.csv", dtype={"strip": str})
    strip = exposures["strip"].unique()[1]
    rows = exposures.index[exposures["strip"] == strip]
    time = exposures["time"][rows].to_numpy()
    drifted = {"x": 0.03 * (time - time.mean())}
    results = carried_out(
        flight, tmp_path / "results", "exposures.csv", slice(rows[0], rows[-1] + 1), drifted, rejection
    )
    tone, text = top_of_report(results)
    assert tone == "attention"
    assert re.findall("Look at ([^.]+)\\.", text) == [f"strip {strip}"]
    table = pd.read_parquet(results / "model_alternatives.parquet")
    (found,) = table[table["rank"] > 0].to_dict("records")
    assert (found["quantity"], found["part"]) == ("gnss_drift_x", strip)
    assert abs(found["explained"] - 0.03) < 3.0 * found["explained_sigma"] < 0.01
    of_strips = table.loc[table["quantity"].str.startswith("gnss_drift"), "part"].value_counts()
    assert (of_strips == 3).all()
    assert set(of_strips.index) == set(exposures["strip"])
    assert np.isfinite(table.loc[table["quantity"].str.startswith("gnss_drift"), "t"]).all()


@pytest.mark.parametrize("wrong_mm", [0.0, 0.15])
def test_a_given_value_that_contradicts_is_named_and_not_the_lever_arm(
    flight: Path, tmp_path: Path, wrong_mm: float
) -> None:
    """σ 4 µm; without this alternative a lever arm of −0.4 m was blamed, and nothing said of the prior."""
    overrides = (
        'adjustment.free=["boresight", "gnss_shift", "principal_point"]',
        f"cameras.DMC-120.principal_point_mm=[{wrong_mm}, 0.0]",
        "adjustment.priors.principal_point_mm=[0.004, 0.004]",
    )
    outcome = carry_out(adjustment_alone, RunRequest(flight, tmp_path / "results", overrides=overrides))
    assert outcome.error is None, outcome.error
    table = pd.read_parquet(outcome.directory / "model_alternatives.parquet")
    found = table[table["rank"] > 0]
    assert list(found["quantity"]) == (["prior_principal_point_x"] if wrong_mm else [])
    if wrong_mm:
        (size, sigma) = found[["explained", "explained_sigma"]].to_numpy()[0]
        assert abs(size - wrong_mm) < 3.0 * sigma
        assert sigma < 0.1 * wrong_mm


def test_estimated_drifts_are_no_alternatives(flight: Path, tmp_path: Path) -> None:
    free = (
        'adjustment.free=["gnss_shift", "gnss_drift"]',
        "adjustment.priors.gnss_drift_m_s=[0.05, 0.05, 0.05]",
    )
    found = carry_out(adjustment_alone, RunRequest(flight, tmp_path / "results", overrides=free))
    assert found.error is None, found.error
    table = pd.read_parquet(found.directory / "model_alternatives.parquet")
    assert not table["quantity"].str.startswith("gnss_drift").any()


@pytest.mark.parametrize(
    ("observed", "free", "absent"),
    [
        (["control", "gnss"], ["gnss_shift"], {"boresight", "convergence"}),
        (["control", "ins"], ["boresight"], {"lever_arm", "gnss_shift", "gnss_drift", "time_offset"}),
        (["control"], [], {"boresight", "lever_arm", "gnss_shift", "gnss_drift"}),
    ],
)
def test_what_changes_no_observation_is_not_said_to_remain_undetected(
    flight: Path, tmp_path: Path, observed: list[str], free: list[str], absent: set[str]
) -> None:
    """Without attitudes 12 rows about the boresight came before the focal length, which moves the shift."""
    overrides = (f"adjustment.observe={json.dumps(observed)}", f"adjustment.free={json.dumps(free)}")
    found = carry_out(adjustment_alone, RunRequest(flight, tmp_path / "results", overrides=overrides))
    assert found.error is None, found.error
    table = pd.read_parquet(found.directory / "model_alternatives.parquet")
    kinds = set(table["quantity"].map(lambda name: re.sub("_(x|y|z|roll|pitch|yaw)$", "", name)))
    assert not kinds & absent
    assert {"focal_length", "principal_point", "control_turn"} <= kinds
