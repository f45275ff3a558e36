"""A penta camera from delivered files: joined to events by time, adjusted once for all its heads."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunRequest, Story, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from flows.stories.direct_georeferencing_check import direct_georeferencing_check
from flows.stories.examination import examine_everything
from flows.stories.system_calibration import system_calibration
from tasks.errors import InputError
from tasks.settings.load import load_project
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tasks.simulation.truth_comparison import compare_with_truth
from tasks.store.store import Store
from tests.flows.adjustment_alone import adjustment_alone
from tests.tasks.documents.report.page_reader import Page

_NAMES = ("omega", "phi", "kappa")


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve exposures of five heads in three lines."""
    changes = ("flight.lines=3", "flight.exposures=4", "points.count=250")
    simulation = load_simulation("penta", changes, 3)
    return simulate_project(simulation, tmp_path_factory.mktemp("penta")).project_file


@pytest.fixture(scope="module")
def few(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six exposures in two lines."""
    changes = ("flight.lines=2", "flight.exposures=3", "points.count=100")
    simulation = load_simulation("penta", changes, 3)
    return simulate_project(simulation, tmp_path_factory.mktemp("few")).project_file


def adjusted(project: Path, out: Path, *overrides: str, story: Story = adjustment_alone) -> Path:
    """The results of a run that ends well."""
    found = carry_out(story, RunRequest(project, out, overrides=overrides))
    assert found.error is None, found.error
    return found.directory


@pytest.fixture(scope="module")
def results(flight: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With a trust map."""
    out = tmp_path_factory.mktemp("results") / "out"
    return adjusted(flight, out, "trust_map={ cell_m = 100.0 }", story=aerial_triangulation)


@pytest.fixture
def out(results: Path, tmp_path: Path) -> Path:
    """A folder for results, in which what a change leaves as it is was computed before."""
    shutil.copytree(results / ".store", tmp_path / "out" / ".store")
    return tmp_path / "out"


def delivered(folder: Path, exposures: pd.DataFrame) -> str:
    """The override with which other exposures are read."""
    file = folder / "exposures.csv"
    exposures.to_csv(file, index=False)
    return f'inputs.exposures.file="{file}"'


def test_mountings_of_the_heads_are_found_within_their_standard_deviations(
    flight: Path, results: Path
) -> None:
    keys = ["parameter", "entity"]
    truth = pd.read_parquet(flight.parent / "truth" / "parameters.parquet").set_index(keys)
    found = pd.read_parquet(results / "parameters.parquet").set_index(keys)
    estimated = found[found["sigma"].notna()]
    mountings = estimated[estimated.index.get_level_values(0).str.startswith(("relative", "boresight"))]
    assert len(mountings) == 15
    error = mountings["value"] - truth.loc[mountings.index, "value"]
    assert np.all(np.abs(error / mountings["sigma"]) < 3.5)
    late = estimated.loc["synchronisation_offset"]
    expected = truth.loc["synchronisation_offset"]["value"].loc[late.index]
    assert sorted(expected) == [0.0, 0.0, 0.002, 0.002]
    assert np.all(np.abs((late["value"] - expected) / late["sigma"]) < 3.5)
    assert np.all(late["sigma"] < 2e-4)
    relative = mountings[mountings.index.get_level_values(0).str.startswith("relative")]
    assert np.all(relative["sigma"] < 5e-4)


def test_heads_that_are_turned_by_a_degree_are_found_without_a_boresight(tmp_path: Path) -> None:
    """That of a platform that takes no pictures cannot be estimated; its heads may be turned all the same."""
    turned = ([1.5, -0.5, 0.8], [-1.0, 0.5, 0.4], [0.3, -1.2, 0.4], [-0.3, 1.2, 1.4])
    changes = [f"head.{number}.rotation_change_deg={change}" for number, change in enumerate(turned)]
    size = ("flight.lines=3", "flight.exposures=4", "points.count=250")
    project = simulate_project(load_simulation("dmc-heads", (*size, *changes)), tmp_path).project_file
    directory = adjusted(project, tmp_path / "results", 'adjustment.free=["relative_rotation"]')
    comparison = compare_with_truth(tmp_path, directory)
    assert len(comparison.parameters) == 12
    assert comparison.joint is not None
    assert comparison.joint.probability > 1e-3
    problems = json.loads((directory / "summary.json").read_text())["problems"]
    assert any("of heads as rotation_deg" in text for text in problems)


def test_each_event_is_observed_once_and_each_picture_has_an_orientation(flight: Path, results: Path) -> None:
    residuals = pd.read_parquet(results / "residuals.parquet")
    counts = residuals.groupby("group")["image"].nunique()
    assert counts["gnss_positions"] == counts["ins_attitudes"] == 12
    truth = pd.read_parquet(flight.parent / "truth" / "exterior_orientations.parquet").set_index("image")
    found = pd.read_parquet(results / "exterior_orientations.parquet").set_index("image")
    assert len(found) == counts["image_points"] == 60
    columns = [f"{axis}_m" for axis in "xyz"] + [f"{name}_deg" for name in _NAMES]
    error = (found[columns] - truth.loc[found.index, columns]).to_numpy(copy=True)
    error[:, 3:] = (error[:, 3:] + 180.0) % 360.0 - 180.0
    ratio = error / found[[f"sigma_{name}" for name in columns]].to_numpy()
    # Errors of the datum are common to all of them.
    assert np.abs(ratio).max() < 4.0
    assert np.abs(ratio).min(axis=0).max() < 2.0
    notes = json.loads((results / "summary.json").read_text())["problems"]
    assert any("60 images of 5 heads were exposed at 12 events" in sentence for sentence in notes)


def test_the_report_has_a_section_of_the_rig(results: Path) -> None:
    page = Page((results / "report.html").read_text())
    late, turned = page.tables["heads-synchronisation_offset"], page.tables["heads-relative_rotation"]
    known = pd.read_parquet(results / "parameters.parquet").set_index(["parameter", "entity"])
    assert sorted(late.keys) == sorted(turned.keys) == ["backward", "forward", "left", "right"]
    for head in late.keys:
        own = known.loc["synchronisation_offset", head]
        assert float(late.numbers[head, "offset"].data) == pytest.approx(own["value"] * 1e3)
        chance = float(late.numbers[head, "probability"].data)
        # Two of the heads are 2 ms late, declared as 0 ms.
        assert (chance < 1e-6) == (abs(own["value"]) > 1e-3)
        assert abs(float(turned.numbers[head, "correlation"].data)) < 1.0
    # Positions are held: there is nothing to be tested.
    held = page.tables["heads-relative_position"]
    assert not any(column == "probability" for _, column in held.numbers)
    assert all(held.numbers[head, "sigma_forward"].data == "" for head in held.keys)


def test_the_trust_map_shows_ground_that_two_events_see(results: Path) -> None:
    cells = pd.read_parquet(results / "trust_map_cells.parquet")
    sigma = cells[["sigma_x_m", "sigma_y_m", "sigma_z_m"]].to_numpy()
    pair = cells[["pair_sigma_x_m", "pair_sigma_y_m", "pair_sigma_z_m"]].to_numpy()
    assert len(cells) > 200
    assert np.all(np.isfinite(sigma))
    assert np.all(sigma[:, 2] <= pair[:, 2] * (1.0 + 1e-9))
    # Far outside, two heads of one exposure would intersect at less than a minute of arc.
    assert sigma.max() < 3.0
    # More images than events: several heads see the middle at once.
    assert cells["rays"].max() > 12
    # Five heads from 1,000 m: 5 cm on the ground at their edges, the middle far better.
    assert cells.loc[cells["rays"] >= 8, "sigma_z_m"].max() < 0.06
    assert (cells["block_error_z_m"] > 0.0).all()
    assert 'id="trust"' in (results / "report.html").read_text(encoding="utf-8")


def test_the_check_of_direct_georeferencing_is_refused(flight: Path, out: Path) -> None:
    found = carry_out(direct_georeferencing_check, RunRequest(flight, out))
    assert "share one reading of GNSS and INS" in str(found.error)


def test_names_of_images_decide_nothing(flight: Path, results: Path, tmp_path: Path) -> None:
    names = pd.read_csv(flight.parent / "exposures.csv")["image"]
    shuffled = np.random.default_rng(4).permutation(len(names))
    other = dict(zip(names, [f"{k:03d}" for k in shuffled], strict=True))
    overrides = []
    for key, name in (("exposures", "exposures.csv"), ("image_points", "image_points.csv")):
        table = pd.read_csv(flight.parent / name, dtype={"point": str})
        table["image"] = table["image"].map(other)
        table.to_csv(tmp_path / name, index=False)
        overrides.append(f'inputs.{key}.file="{tmp_path / name}"')
    renamed = adjusted(flight, tmp_path / "out", *overrides)
    keys = ["parameter", "entity"]
    before, after = (
        pd.read_parquet(folder / "parameters.parquet").set_index(keys) for folder in (results, renamed)
    )
    known = before["sigma"].notna()
    difference = (after["value"] - before["value"]).loc[known[known].index]
    assert np.all(np.abs(difference / before["sigma"][known]) < 1e-3)


@pytest.mark.parametrize(
    ("column", "row", "value", "message"),
    [
        ("time", 3, None, "have no time of exposure"),
        ("roll", 3, 0.01, "different GNSS and INS observations"),
        ("x", 3, 0.5, "different GNSS and INS observations"),
        ("time", 6, "time of row 1", "took two images at the same time"),
    ],
)
def test_images_that_make_no_event_are_refused(
    few: Path, tmp_path: Path, column: str, row: int, value: object, message: str
) -> None:
    exposures = pd.read_csv(few.parent / "exposures.csv")
    place = exposures.columns.get_loc(column)
    changed = exposures.iloc[row, place] + value if isinstance(value, float) else None
    if value == "time of row 1":
        changed = exposures.iloc[1, place]
    exposures.iloc[row, place] = changed  # type: ignore[call-overload]
    out = tmp_path / "out"
    overrides = (delivered(tmp_path, exposures), 'adjustment.free=["relative_rotation"]')
    found = carry_out(aerial_triangulation, RunRequest(few, out, overrides=overrides))
    assert found.error is not None
    assert message in str(found.error)
    # The doctor, which adjusts nothing, finds it as well.
    store = Store.of(out)
    store.begin_run()
    assert any(
        message in one.what for one in examine_everything(load_project(few, overrides), store).mistakes
    )


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ('cameras.left.head.reference="right"', "not a reference head"),
        ('cameras.left.head.reference="below"', "not a camera"),
        ("cameras.left.boresight_deg=[45.0, 0.0, 0.0]", "is a head of a rig and also has boresight_deg"),
        ('cameras.left.calibration="registry-rig"', "this one is not the reference head"),
    ],
)
def test_heads_that_contradict_the_project_are_refused(flight: Path, override: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_project(flight, (override,))


def test_relative_parameters_without_a_rig_are_refused(tmp_path: Path) -> None:
    simulation = load_simulation("dmc-20cm", ("points.count=300",), 4)
    project = simulate_project(simulation, tmp_path / "flight").project_file
    request = RunRequest(project, tmp_path / "out", overrides=('adjustment.free=["relative_rotation"]',))
    found = carry_out(aerial_triangulation, request)
    assert "no camera is a head" in str(found.error)


def test_synchronisation_without_times_along_strips_is_refused(flight: Path, out: Path) -> None:
    exposures = pd.read_csv(flight.parent / "exposures.csv").assign(strip="")
    override = delivered(out, exposures)
    found = carry_out(aerial_triangulation, RunRequest(flight, out, overrides=(override,)))
    assert "contain no strips" in str(found.error)
    assert "synchronisation_offset" in str(found.error)


def test_heads_of_flights_of_their_own_share_no_event(flight: Path, out: Path, tmp_path: Path) -> None:
    table = pd.read_csv(flight.parent / "exposures.csv", dtype=str)
    alone = delivered(tmp_path, table.assign(flight=table["flight"] + table["camera"]))
    found = carry_out(adjustment_alone, RunRequest(flight, out, overrides=(alone,)))
    assert any(
        "No two of the images of 5 heads belong to one event" in text for text in found.summary.problems
    )


def test_errors_of_events_may_be_correlated_over_time(tmp_path: Path) -> None:
    """Heads of one event have one reading: their common time is no contradiction."""
    noise = ("noise.gnss_m=0", "noise.gnss_markov_m=0.05", "noise.gnss_correlation_s=30")
    simulation = load_simulation(
        "penta", ("flight.lines=3", "flight.exposures=4", "points.count=250", *noise)
    )
    project = simulate_project(simulation, tmp_path / "project").project_file
    assert "gnss_correlation_s" in project.read_text(encoding="utf-8")
    found = adjusted(project, tmp_path / "out")
    counts = pd.read_parquet(found / "residuals.parquet").groupby("group")["image"].nunique()
    assert counts["gnss_positions"] == 12
    joint = compare_with_truth(project.parent, found).joint
    assert joint is not None
    assert joint.probability > 1e-3


def test_delivered_events_join_heads_as_their_times_do(flight: Path, out: Path, tmp_path: Path) -> None:
    exposures = pd.read_csv(flight.parent / "exposures.csv")
    events = exposures["time"].rank(method="dense").astype(int).map(lambda number: f"E{number}")
    # Of every second event the images have a time, of the others they have none.
    odd = events.str[1:].astype(int) % 2 == 1
    named = exposures.assign(event=events, time=exposures["time"].where(odd)).rename(
        columns={"camera": "head"}
    )
    free = 'adjustment.free=["boresight", "relative_rotation"]'
    by_name = adjusted(flight, tmp_path / "named", delivered(tmp_path, named), free)
    by_time = adjusted(flight, out, free)
    keys = ["parameter", "entity"]
    one, other = (
        pd.read_parquet(folder / "parameters.parquet").set_index(keys) for folder in (by_name, by_time)
    )
    pd.testing.assert_frame_equal(one, other)


@pytest.mark.parametrize(
    ("rows", "column", "value", "message"),
    [
        ([0], "event", "2", "took two images"),
        pytest.param(list(range(10)), "event", "1", "took two images", marks=pytest.mark.slow),
        ([2], "time", 0.002, "are 2 ms apart"),
    ],
)
def test_events_that_the_times_contradict_are_refused(
    flight: Path, out: Path, rows: list[int], column: str, value: str | float, message: str
) -> None:
    wrong = pd.read_csv(flight.parent / "exposures.csv")
    wrong["event"] = wrong["time"].rank(method="dense").astype(int).astype(str)
    wrong.loc[rows, column] = value if isinstance(value, str) else wrong.loc[rows, column] + value
    request = RunRequest(flight, out, overrides=(delivered(out, wrong),))
    assert message in str(carry_out(aerial_triangulation, request).error)


def test_offsets_in_place_and_in_time_need_a_prior(flight: Path, out: Path) -> None:
    free = 'adjustment.free=["relative_position", "synchronisation_offset"]'
    found = carry_out(aerial_triangulation, RunRequest(flight, out, overrides=(free,)))
    assert "cannot be separated at constant speed" in str(found.error)


@pytest.mark.slow
def test_the_preset_is_accepted_as_a_calibration_flight_at_one_height(tmp_path: Path) -> None:
    """Five focal lengths at one height, two heads 2 ms late."""
    simulation = load_simulation("penta", (), 1)
    project = simulate_project(simulation, tmp_path / "flight").project_file
    found = carry_out(system_calibration, RunRequest(project, tmp_path / "out"))
    assert found.error is None, found.error
    figures = json.loads((found.directory / "summary.json").read_text())["calibration"]
    assert figures["verdict"] == "accepted"
    assert any("follow from heads that look in different directions" in one for one in figures["remarks"])
    record = json.loads((found.directory / "calibration.json").read_text())
    mounted = {i["entity"] for i in record["parameters"] if i["parameter"].startswith("boresight")}
    assert mounted == {"nadir"}
    assert any("the boresight of left is roll 45.0" in remark for remark in record["remarks"])
    keys = ["parameter", "entity"]
    truth = pd.read_parquet(project.parent / "truth" / "parameters.parquet").set_index(keys)["value"]
    estimated = pd.read_parquet(found.directory / "parameters.parquet").set_index(keys)
    estimated = estimated[estimated["sigma"].notna()]
    ratio = (estimated["value"] - truth.loc[estimated.index]) / estimated["sigma"]
    assert len(ratio) == 3 + 12 + 4 + 3 + 5 + 10
    assert ratio.abs().max() < 3.5
    assert 0.5 < (ratio**2).mean() < 1.6
