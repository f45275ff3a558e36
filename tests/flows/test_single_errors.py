"""A block with one mistake: what is named is the mistake, and not the shift that it looks like."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from flows.stories.aerial_triangulation import adjusted_block, aerial_triangulation, publish, remarks_on
from flows.stories.block_preparation import prepare_block
from tasks.documents.report.causes import by_place, causes
from tasks.documents.report.key_figures import verdict
from tasks.documents.report.material import read_material
from tasks.results.summary import Summary
from tasks.settings.load_simulation import load_simulation
from tasks.settings.project import Project
from tasks.simulation.simulate import simulate_project
from tasks.store.store import Store
from tests.flows.adjustment_alone import adjustment_alone

NOTHING_REJECTED = 'adjustment.rejection="none"'
BY_DEFAULT = "adjustment.rejection={}"


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """60 images in parallel strips, with INS and control; the GNSS shift is free, nothing is rejected."""
    simulation = load_simulation("dmc-20cm", ("points.count=300",), 4)
    return simulate_project(simulation, tmp_path_factory.mktemp("flight")).project_file


@dataclass(frozen=True)
class Judged:
    """Results, and what the first screen of their report says: its tone, and its sentences by place."""

    directory: Path
    tone: str
    places: Mapping[str, Sequence[str]]


@pytest.fixture(scope="module")
def sound(flight: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of the block without a mistake, with their report."""
    request = RunRequest(flight, tmp_path_factory.mktemp("sound") / "results", (NOTHING_REJECTED,))
    outcome = carry_out(aerial_triangulation, request)
    assert outcome.error is None, outcome.error
    return outcome.directory


@pytest.fixture
def out(sound: Path, tmp_path: Path) -> Path:
    """A folder for results, in which what a change leaves as it is was computed before."""
    shutil.copytree(sound / ".store", tmp_path / "results" / ".store")
    return tmp_path / "results"


def with_changes(flight: Path, out: Path, file: str, rows: slice, changes: dict[str, Any]) -> str:
    """The override with which a delivery is read in some rows of which numbers were changed."""
    table = pd.read_csv(flight.parent / file, dtype={"point": str, "image": str})
    for column, error in changes.items():
        table.iloc[rows, table.columns.get_loc(column)] += error
    delivered = out.parent / file
    table.to_csv(delivered, index=False)
    key = {"control.csv": "control", "exposures.csv": "exposures"}[file]
    return f'inputs.{key}.file="{delivered}"'


def carried_out(
    flight: Path,
    out: Path,
    file: str,
    rows: slice,
    changes: dict[str, Any],
    rejection: str,
) -> Judged:
    """The results after some numbers in rows of a delivery were changed."""
    judged: list[Judged] = []

    def judge(project: Project, store: Store) -> Summary:
        """The report without its tables and drawings, which take half of the time of such a block."""
        block = prepare_block(project, store)
        adjusted = adjusted_block(project, store, block)
        stages = (*block.stages, adjusted, remarks_on(adjusted, store))
        material = read_material(stages, project)
        found = causes(material)
        judged.append(Judged(out, verdict(material, found).tone, by_place(found)))
        return publish(store, project, stages)

    delivered = with_changes(flight, out, file, rows, changes)
    outcome = carry_out(judge, RunRequest(flight, out, (delivered, rejection)))
    assert outcome.error is None, outcome.error
    return judged[0]


def adjusted_with(flight: Path, out: Path, *overrides: str) -> RunOutcome:
    """The results of other settings."""
    outcome = carry_out(adjustment_alone, RunRequest(flight, out, overrides))
    assert outcome.error is None, outcome.error
    return outcome


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


def test_a_sound_block_has_no_finding_and_a_green_verdict(sound: Path) -> None:
    assert findings(sound) == []
    tone, text = top_of_report(sound)
    assert tone == "good"
    assert "Look at" not in text


@pytest.mark.parametrize(("kind", "changes"), [("image", {"y": 2.0}), ("strip", {"x": 0.6})])
def test_the_report_begins_with_what_is_wrong(
    flight: Path, out: Path, kind: str, changes: dict[str, float]
) -> None:
    """As the other tests find it without the page."""
    exposures = pd.read_csv(flight.parent / "exposures.csv", dtype=str)
    entity = exposures[kind].unique()[20 if kind == "image" else 1]
    rows = exposures.index[exposures[kind] == entity]
    mistake = with_changes(flight, out, "exposures.csv", slice(rows[0], rows[-1] + 1), changes)
    outcome = carry_out(aerial_triangulation, RunRequest(flight, out, (mistake, NOTHING_REJECTED)))
    assert outcome.error is None, outcome.error
    tone, text = top_of_report(outcome.directory)
    assert tone == "attention"
    assert re.findall("Look at ([^.]+)\\.", text) == [f"{kind} {entity}"]
    assert all(str(found["sentence"]) in text for found in findings(outcome.directory))


@pytest.mark.parametrize(
    ("file", "row", "changes", "quantity", "words"),
    [
        ("exposures.csv", 20, {"y": 2.0}, "gnss_position", "too far north"),
        ("exposures.csv", 33, {"roll": 0.2}, "ins_attitude", "computed − given roll −"),
        ("control.csv", 6, {"z": -1.5}, "control_point", "too low"),
    ],
)
def test_a_single_mistake_is_named_and_nothing_else(
    flight: Path, out: Path, file: str, row: int, changes: dict[str, float], quantity: str, words: str
) -> None:
    judged = carried_out(flight, out, file, slice(row, row + 1), changes, NOTHING_REJECTED)
    (found,) = findings(judged.directory)
    entity = pd.read_csv(flight.parent / file, dtype=str).iloc[row, 0]
    assert (found["quantity"], found["entity"]) == (quantity, entity)
    assert words in str(found["sentence"])
    (error,) = changes.values()
    size = re.search(r"([\d.]+) ±", str(found["sentence"]))
    assert size is not None
    assert float(size.group(1)) == pytest.approx(abs(error), rel=0.25)
    assert judged.tone == "attention"
    place = f"control point {entity}" if file == "control.csv" else f"image {entity}"
    assert judged.places == {place: (found["sentence"],)}


@pytest.mark.parametrize(
    ("file", "row", "changes", "words"),
    [
        ("exposures.csv", 20, {"y": 2.0}, "Its GNSS position was rejected: computed − given y −"),
        pytest.param(
            "exposures.csv",
            33,
            {"roll": 0.2},
            "Its INS attitude was rejected: computed − given roll −",
            marks=pytest.mark.slow,
        ),
        ("control.csv", 6, {"z": -1.5}, "not used as control: computed − given z +"),
    ],
)
def test_what_was_rejected_is_named_first_and_once(
    flight: Path, out: Path, file: str, row: int, changes: dict[str, float], words: str
) -> None:
    judged = carried_out(flight, out, file, slice(row, row + 1), changes, BY_DEFAULT)
    entity = pd.read_csv(flight.parent / file, dtype=str).iloc[row, 0]
    assert judged.tone == "attention"
    ((place, sentences),) = judged.places.items()
    assert place.endswith(f" {entity}")
    assert any(words in sentence for sentence in sentences)


#: What is rejected by default makes one cause look like many.
REJECTIONS = (pytest.param(NOTHING_REJECTED, marks=pytest.mark.slow), BY_DEFAULT)


@pytest.mark.parametrize("rejection", REJECTIONS)
def test_a_shifted_strip_is_one_cause(flight: Path, out: Path, rejection: str) -> None:
    exposures = pd.read_csv(flight.parent / "exposures.csv", dtype=str)
    strip = exposures["strip"].unique()[1]
    rows = exposures.index[exposures["strip"] == strip]
    shifted = slice(rows[0], rows[-1] + 1)
    judged = carried_out(flight, out, "exposures.csv", shifted, {"x": 0.6}, rejection)
    assert judged.tone == "attention"
    assert list(judged.places) == [f"strip {strip}"]


@pytest.mark.parametrize("rejection", REJECTIONS)
def test_positions_that_drift_along_a_strip_are_one_cause(flight: Path, out: Path, rejection: str) -> None:
    """0.03 m/s, up to 1.3 m: no six wrong positions, no scale of the control, and no other strip."""
    exposures = pd.read_csv(flight.parent / "exposures.csv", dtype={"strip": str})
    strip = exposures["strip"].unique()[1]
    rows = exposures.index[exposures["strip"] == strip]
    time = exposures["time"][rows].to_numpy()
    drifted = {"x": 0.03 * (time - time.mean())}
    judged = carried_out(flight, out, "exposures.csv", slice(rows[0], rows[-1] + 1), drifted, rejection)
    assert judged.tone == "attention"
    assert list(judged.places) == [f"strip {strip}"]
    table = pd.read_parquet(judged.directory / "model_alternatives.parquet")
    (found,) = table[table["rank"] > 0].to_dict("records")
    assert (found["quantity"], found["part"]) == ("gnss_drift_x", strip)
    assert abs(found["explained"] - 0.03) < 3.0 * found["explained_sigma"] < 0.01
    of_strips = table.loc[table["quantity"].str.startswith("gnss_drift"), "part"].value_counts()
    assert (of_strips == 3).all()
    assert set(of_strips.index) == set(exposures["strip"])
    assert np.isfinite(table.loc[table["quantity"].str.startswith("gnss_drift"), "t"]).all()


@pytest.mark.parametrize(
    ("rejection", "axis"),
    [
        (BY_DEFAULT, "roll"),
        pytest.param(BY_DEFAULT, "pitch", marks=pytest.mark.slow),
        pytest.param(NOTHING_REJECTED, "pitch", marks=pytest.mark.slow),
        pytest.param(NOTHING_REJECTED, "heading", marks=pytest.mark.slow),
    ],
)
def test_attitudes_that_drift_along_a_strip_are_no_drift_of_the_positions(
    flight: Path, out: Path, rejection: str, axis: str
) -> None:
    """0.001°/s, up to 0.044°: with rejection a drift of the GNSS was blamed, without it eight attitudes."""
    exposures = pd.read_csv(flight.parent / "exposures.csv", dtype={"strip": str})
    strip = exposures["strip"].unique()[1]
    rows = exposures.index[exposures["strip"] == strip]
    time = exposures["time"][rows].to_numpy()
    drifted = {axis: 0.001 * (time - time.mean())}
    judged = carried_out(flight, out, "exposures.csv", slice(rows[0], rows[-1] + 1), drifted, rejection)
    assert judged.tone == "attention"
    assert list(judged.places) == [f"strip {strip}"]
    table = pd.read_parquet(judged.directory / "model_alternatives.parquet")
    (found,) = table[table["rank"] > 0].to_dict("records")
    name = f"ins_drift_{axis.replace('heading', 'yaw')}"
    assert (found["quantity"], found["part"]) == (name, strip)
    assert abs(found["explained"] - 0.001) < 3.0 * found["explained_sigma"] < 0.0006
    of_strips = table.loc[table["quantity"].str.startswith("ins_drift"), "part"].value_counts()
    assert (of_strips == 3).all()


def test_drifts_that_a_narrow_field_of_view_hardly_separates_are_named_together(tmp_path: Path) -> None:
    """Twice the focal length and height: a pitch is nearly a shift along the strip (correlation 0.8)."""
    narrow = ("camera.focal_length_mm=240", "flight.0.height_m=4320", "flight.1.height_m=4320")
    simulation = load_simulation("dmc-20cm", ("points.count=300", *narrow), 1)
    project = simulate_project(simulation, tmp_path).project_file
    exposures = pd.read_csv(tmp_path / "exposures.csv", dtype={"strip": str})
    rows = exposures["strip"] == "E02"
    time = exposures.loc[rows, "time"]
    exposures.loc[rows, "pitch"] += 0.0005 * (time - time.mean())
    exposures.to_csv(tmp_path / "exposures.csv", index=False)
    outcome = carry_out(adjustment_alone, RunRequest(project, None, (BY_DEFAULT,)))
    assert outcome.error is None, outcome.error
    (found,) = findings(outcome.directory)
    assert (found["quantity"], found["part"]) == ("ins_drift", "E02")
    assert "Nearly indistinguishable from it: GNSS drift x in strip E02." in str(found["sentence"])


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_drifts_of_attitudes_are_found_as_often_as_stated(tmp_path: Path) -> None:
    """40 blocks, without a drift, and with one of the size that is found with a probability of 80 %."""
    trials, squares, false_alarms, named = 40, [], 0, []
    for seed in range(trials):
        folder = tmp_path / str(seed)
        simulate_project(load_simulation("dmc-20cm", ("points.count=200",), 500 + seed), folder)
        sound = adjusted_with(folder / "project.toml", folder / "sound", BY_DEFAULT)
        table = pd.read_parquet(sound.directory / "model_alternatives.parquet")
        drifts = table[table["quantity"].str.startswith("ins_drift")]
        squares.append((drifts["t"] ** 2).mean())
        false_alarms += bool((table["rank"] > 0).any())
        size = drifts.set_index(["quantity", "part"]).loc[("ins_drift_roll", "E02"), "detectable"]
        exposures = pd.read_csv(folder / "exposures.csv", dtype={"strip": str})
        rows = exposures["strip"] == "E02"
        time = exposures.loc[rows, "time"]
        exposures.loc[rows, "roll"] += size * (time - time.mean())
        exposures.to_csv(folder / "exposures.csv", index=False)
        wrong = adjusted_with(folder / "project.toml", folder / "wrong", BY_DEFAULT)
        named += [(item["quantity"], item["part"]) for item in findings(wrong.directory)[:1]]
    # 99.9 % bands of the mean of 720 squares, and of the share found at a power of 0.80.
    assert np.mean(squares) == pytest.approx(1.0, abs=0.18)
    assert false_alarms <= 2
    assert named.count(("ins_drift", "E02")) >= 0.58 * trials
    assert not any(quantity == "gnss_drift" for quantity, _ in named)


@pytest.fixture(scope="module")
def on_four_points(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same on four control points in the corners; without GNSS their heights have r of 0.03."""
    simulation = load_simulation("dmc-20cm", ("points.count=300", "control.control=4"), 4)
    return simulate_project(simulation, tmp_path_factory.mktemp("four")).project_file


ON_CONTROL = 'adjustment.observe=["control"]'


@pytest.mark.parametrize("point", ["C012", pytest.param("C001", marks=pytest.mark.slow)])
def test_a_wrong_height_that_hardly_anything_controls_is_no_scale_of_the_control(
    on_four_points: Path, tmp_path: Path, point: str
) -> None:
    """1.5 m: a scale of the control of 25,000 to 35,000 ppm was blamed, and no point."""
    control = pd.read_csv(on_four_points.parent / "control.csv", dtype={"point": str})
    row = control.index[control["point"] == point][0]
    out = tmp_path / "results"
    mistake = with_changes(on_four_points, out, "control.csv", slice(row, row + 1), {"z": 1.5})
    found = adjusted_with(on_four_points, out, mistake, ON_CONTROL, BY_DEFAULT)
    (said,) = findings(found.directory)
    assert said["quantity"] == "control_point"
    # Of four heights over three of a plane no residual can say which one is wrong.
    alike = str(said["sentence"]).partition("Nearly indistinguishable from it: ")[2].partition(". ")[0]
    named = {str(said["entity"]), *re.findall(r"control point z of (\w+)", alike)}
    assert named == {"C001", "C012", "C097", "C108"}
    assert "scale" in alike


@pytest.fixture(scope="module")
def on_six_points(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same on six control points."""
    simulation = load_simulation("dmc-20cm", ("points.count=300", "control.control=6"), 4)
    return simulate_project(simulation, tmp_path_factory.mktemp("six")).project_file


@pytest.mark.parametrize(
    ("number", "point", "suspects"),
    [
        (4, "C001", {"C001", "C012", "C097", "C108"}),
        pytest.param(4, "C097", {"C001", "C012", "C097", "C108"}, marks=pytest.mark.slow),
        (6, "C001", {"C001", "C049", "C108"}),
    ],
)
def test_of_control_heights_that_cannot_be_told_from_each_other_none_is_rejected(
    request: pytest.FixtureRequest, tmp_path: Path, number: int, point: str, suspects: set[str]
) -> None:
    """4 m: of four points so many were rejected that nothing held the block, of six two sound ones."""
    project: Path = request.getfixturevalue({4: "on_four_points", 6: "on_six_points"}[number])
    control = pd.read_csv(project.parent / "control.csv", dtype={"point": str})
    row = control.index[control["point"] == point][0]
    out = tmp_path / "results"
    mistake = with_changes(project, out, "control.csv", slice(row, row + 1), {"z": 4.0})
    found = adjusted_with(project, out, mistake, ON_CONTROL, BY_DEFAULT)
    summary = json.loads((found.directory / "summary.json").read_text())
    assert summary["rejected_control"] == []
    assert set(summary["inseparable_control"]) == suspects
    (said,) = (text for text in found.summary.problems if "contradict each other" in text)
    assert ", ".join(sorted(suspects)) in said
    # What such an error makes large is not rejected with it, and gross errors below it stay, too.
    table = pd.read_parquet(found.directory / "residuals.parquet")
    rays = table[(table["group"] == "image_points") & (table["status"] == "used")]
    large = rays.loc[rays["standardized"].abs() > 4.13, ["image", "point"]].drop_duplicates()
    assert summary["unrejected_image_points"] == len(large) > 0
    assert f"Image points with standardized residuals above 4.13 were therefore kept ({len(large)})" in said
    (finding,) = findings(found.directory)
    assert finding["quantity"] == "control_point"
    assert {finding["entity"], *finding["alike_points"]} <= suspects  # type: ignore[misc]


@pytest.mark.parametrize("number", [4, 6])
def test_a_control_point_wrong_in_plan_is_rejected_and_named(
    request: pytest.FixtureRequest, tmp_path: Path, number: int
) -> None:
    project: Path = request.getfixturevalue({4: "on_four_points", 6: "on_six_points"}[number])
    out = tmp_path / "results"
    mistake = with_changes(project, out, "control.csv", slice(0, 1), {"x": 4.0})
    found = adjusted_with(project, out, mistake, ON_CONTROL, BY_DEFAULT)
    summary = json.loads((found.directory / "summary.json").read_text())
    assert summary["rejected_control"] == ["C001"]
    assert summary["inseparable_control"] == []
    assert summary["unrejected_image_points"] == 0


def test_heights_that_hardly_anything_controls_are_named_as_what_may_stay_unnoticed(
    on_four_points: Path, tmp_path: Path
) -> None:
    found = adjusted_with(on_four_points, tmp_path / "results", ON_CONTROL, BY_DEFAULT)
    assert findings(found.directory) == []
    table = pd.read_parquet(found.directory / "model_alternatives.parquet")
    heights = table[table["quantity"] == "control_point_z"].set_index("entity")
    assert set(heights.index) == {"C001", "C012", "C097", "C108"}
    # σ 0.05 m over √0.03, and the critical value with a power of 80 %.
    assert heights["detectable"].to_numpy() == pytest.approx(0.05 / 0.032**0.5 * 4.2, rel=0.1)
    (said,) = (text for text in found.summary.problems if "coordinates of control points" in text)
    assert "z of C001, z of C012, z of C097, z of C108" in said


@pytest.mark.parametrize("seed", [34, pytest.param(40, marks=pytest.mark.slow)])
def test_a_yaw_of_the_camera_is_no_part_of_the_other_north(tmp_path: Path, seed: int) -> None:
    """0.01°: +1.5 % of the convergence was found a little more likely than the yaw itself."""
    changes = (
        "points.count=300", "project.crs=EPSG:25832", "project.latitude_deg=48.9",
        "project.longitude_deg=8.1", "truth.boresight_deg=[0.0, 0.0, 0.01]", "project.free=[]",
    )  # fmt: skip
    project = simulate_project(load_simulation("dmc-20cm", changes, seed), tmp_path).project_file
    (found,) = findings(adjusted_with(project, tmp_path / "results", BY_DEFAULT).directory)
    assert (found["quantity"], found["scope"]) == ("boresight", "all")


@pytest.mark.parametrize("wrong_mm", [0.0, 0.15])
def test_a_given_value_that_contradicts_is_named_and_not_the_lever_arm(
    flight: Path, out: Path, wrong_mm: float
) -> None:
    """σ 4 µm; without this alternative a lever arm of −0.4 m was blamed, and nothing said of the prior."""
    overrides = (
        'adjustment.free=["boresight", "gnss_shift", "principal_point"]',
        f"cameras.DMC-120.principal_point_mm=[{wrong_mm}, 0.0]",
        "adjustment.priors.principal_point_mm=[0.004, 0.004]",
    )
    outcome = adjusted_with(flight, out, *overrides)
    table = pd.read_parquet(outcome.directory / "model_alternatives.parquet")
    found = table[table["rank"] > 0]
    assert list(found["quantity"]) == (["prior_principal_point_x"] if wrong_mm else [])
    if wrong_mm:
        (size, sigma) = found[["explained", "explained_sigma"]].to_numpy()[0]
        assert abs(size - wrong_mm) < 3.0 * sigma
        assert sigma < 0.1 * wrong_mm


def test_estimated_drifts_are_no_alternatives(flight: Path, out: Path) -> None:
    free = (
        'adjustment.free=["gnss_shift", "gnss_drift", "ins_drift"]',
        "adjustment.priors.gnss_drift_m_s=[0.05, 0.05, 0.05]",
        "adjustment.priors.ins_drift_deg_s=[0.001, 0.001, 0.001]",
    )
    found = adjusted_with(flight, out, *free)
    table = pd.read_parquet(found.directory / "model_alternatives.parquet")
    assert not table["quantity"].str.contains("_drift_").any()


@pytest.mark.parametrize(
    ("observed", "free", "absent"),
    [
        (["control", "gnss"], ["gnss_shift"], {"boresight", "convergence", "ins_drift"}),
        (["control", "ins"], ["boresight"], {"lever_arm", "gnss_shift", "gnss_drift", "time_offset"}),
        pytest.param(
            ["control"],
            [],
            {"boresight", "lever_arm", "gnss_shift", "gnss_drift", "ins_drift"},
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_changes_no_observation_is_not_said_to_remain_undetected(
    flight: Path, out: Path, observed: list[str], free: list[str], absent: set[str]
) -> None:
    """Without attitudes 12 rows about the boresight came before the focal length, which moves the shift."""
    overrides = (f"adjustment.observe={json.dumps(observed)}", f"adjustment.free={json.dumps(free)}")
    found = adjusted_with(flight, out, *overrides)
    table = pd.read_parquet(found.directory / "model_alternatives.parquet")
    kinds = set(table["quantity"].map(lambda name: re.sub("_(x|y|z|roll|pitch|yaw)$", "", name)))
    assert not kinds & absent
    assert {"focal_length", "principal_point", "control_turn"} <= kinds
