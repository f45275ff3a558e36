"""System calibration from a simulated calibration flight: what is estimated, held, compared and written."""

from __future__ import annotations

import hashlib
import io
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from rich.console import Console
from scipy import stats

from flows.command.result_table import result_table
from flows.runs.project_run import RunOutcome, RunRequest, Story, carry_out
from flows.stories.system_calibration import system_calibration
from tasks.calibration.record import CalibrationRecord
from tasks.documents.certificate.words import in_words
from tasks.results.publish import OF_EVERY_CALIBRATION
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tasks.simulation.truth_comparison import compare_with_truth
from tasks.store.stage_record import read_records
from tests.flows.calibration_alone import calibration_alone
from tests.flows.refused_at_start import require_refused_at_start
from tests.tasks.documents.report.page_reader import Page

FEW_POINTS = ("points.count=600", "points.detection=0.5")
#: 160 images in 20 strips instead of 456 in 40.
SMALL = (
    *(
        f"flight.{low}.{name}={number}"
        for low in (0, 1)
        for name, number in (("lines", 3), ("exposures", 10))
    ),
    *(f"flight.{high}.exposures=5" for high in (2, 3)),
)
ONE_HEIGHT = ("flight.2.height_m=780", "flight.3.height_m=780")


def flown(folder: Path, *changes: str) -> Path:
    """The project file of a small calibration flight."""
    simulation = load_simulation("uce-calibration", (*FEW_POINTS, *changes))
    return simulate_project(simulation, folder).project_file


def calibrated(
    project: Path, *overrides: str, out: Path | None = None, story: Story = system_calibration
) -> RunOutcome:
    return carry_out(story, RunRequest(project, out, overrides))


def figures(outcome: RunOutcome) -> dict[str, Any]:
    content = json.loads((outcome.directory / "summary.json").read_text())["calibration"]
    assert isinstance(content, dict)
    return content


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return flown(
        tmp_path_factory.mktemp("flight"),
        'project.name="test field"',
        *SMALL,
    )


@pytest.fixture(scope="module")
def accepted(flight: Path) -> RunOutcome:
    """The flight at two heights, calibrated with the defaults."""
    outcome = calibrated(flight)
    assert outcome.error is None, outcome.error
    return outcome


@pytest.fixture(scope="module")
def record(accepted: RunOutcome) -> CalibrationRecord:
    return CalibrationRecord.model_validate_json((accepted.directory / "calibration.json").read_text())


def test_the_true_values_are_found_together(flight: Path, accepted: RunOutcome) -> None:
    comparison = compare_with_truth(flight.parent, accepted.directory)
    assert comparison.contradictions() == ()
    assert comparison.joint is not None
    assert comparison.joint.freedom == 9
    assert comparison.joint.chi_squared < 21.7
    assert all(abs(item.t) < 3.3 for item in comparison.parameters)


def test_a_good_flight_is_accepted_with_its_pattern_recognised(accepted: RunOutcome) -> None:
    found = figures(accepted)
    assert (found["verdict"], found["reasons"]) == ("accepted", [])
    assert "opposite and crossing" in found["directions"]
    assert "2 heights" in found["heights"]
    assert accepted.summary.status == "done"
    assert [gate.passed for gate in accepted.summary.gates] == [True]


def test_mounting_is_released_before_the_interior_orientation(accepted: RunOutcome) -> None:
    stages = [release["free"] for release in figures(accepted)["releases"]]
    assert stages == [
        ["boresight", "gnss_shift", "gnss_strip_bias"],
        ["boresight", "gnss_shift", "gnss_strip_bias", "focal_length", "principal_point"],
    ]


def test_the_record_holds_the_tables_values_and_their_full_covariance(
    accepted: RunOutcome, record: CalibrationRecord
) -> None:
    table = pd.read_parquet(accepted.directory / "parameters.parquet").set_index(["parameter", "entity"])
    for item in record.parameters:
        row = table.loc[item.key]
        assert item.value == row["value"]
        assert item.given == pytest.approx(row["value"] - row["change"])
        assert (item.sigma is None) == np.isnan(row["sigma"])
    assert not any(item.parameter.startswith("gnss_strip") for item in record.parameters)
    pairs = pd.read_parquet(accepted.directory / "correlations.parquet")
    names = [item.key for item in record.estimated]
    matrix = record.covariance_matrix
    c, z = names.index(("focal_length", "UCE-80")), names.index(("gnss_shift_z", "1"))
    both = pairs[pairs["parameter_a"].isin(["focal_length", "gnss_shift_z"])]
    both = both[both["parameter_b"].isin(["focal_length", "gnss_shift_z"])]
    sigma = [table.loc[names[k], "sigma"] for k in (c, z)]
    formal = np.outer(sigma, sigma) * (np.eye(2) + (1.0 - np.eye(2)) * float(both["correlation"].iloc[0]))
    effects = pd.read_parquet(accepted.directory / "model_alternative_effects.parquet")
    by_held = np.zeros((2, 2))
    for held in record.held:
        own = effects[(effects["quantity"] == held.quantity) & (effects["entity"] == held.entity)]
        of = own.set_index(["parameter", "parameter_entity"])["effect"]
        by_held += held.sigma**2 * np.outer(*[[of[names[k]] for k in (c, z)]] * 2)
    assert {held.quantity for held in record.held} >= {"lever_arm_z", "time_offset", "control_shift_z"}
    assert matrix[np.ix_((c, z), (c, z))] == pytest.approx(formal + by_held)
    # What is held fixed is no rounding: in the shift up it counts about as much as the measurements.
    assert by_held[1, 1] > 0.5 * formal[1, 1]
    assert np.linalg.eigvalsh(matrix / np.outer(*[np.sqrt(np.diagonal(matrix))] * 2)).min() > 0.0


def test_the_record_says_from_which_flight_and_files_it_is(record: CalibrationRecord) -> None:
    assert record.flight.project == "test field"
    assert record.flight.images == 160
    assert record.flight.strips == 20
    assert record.flight.control_points == 84
    assert [round(height, -1) for height in record.flight.heights_m] == [780.0, 2340.0]
    assert set(record.inputs) == {"image_points.csv", "exposures.csv", "control.csv"}
    assert record.verdict == "accepted"


def test_the_command_says_where_the_certificate_is(accepted: RunOutcome) -> None:
    console = Console(file=io.StringIO(), width=10_000, record=True)
    console.print(result_table(accepted))
    assert f"Certificate: {accepted.directory / 'certificate.pdf'}" in console.export_text()


def test_two_steps_find_the_same_as_one(accepted: RunOutcome) -> None:
    found = figures(accepted)["two_step"]
    assert {item["parameter"] for item in found["parameters"]} == {
        *(f"boresight_{name}" for name in ("roll", "pitch", "yaw")),
        *(f"gnss_shift_{axis}" for axis in "xyz"),
    }
    assert found["probability"] > 0.01
    assert found["probability"] == pytest.approx(stats.chi2.sf(found["chi_squared"], 6))
    assert "agree" in found["sentence"]


def test_the_check_keeps_its_prediction_at_independent_points(accepted: RunOutcome) -> None:
    checked = json.loads((accepted.directory / "summary.json").read_text())["direct_georeferencing"]
    assert checked["points"][0] >= 30
    ratio = np.array(checked["rmse_m"]) / np.array(checked["predicted_rmse_m"])
    assert np.all(np.abs(ratio - 1.0) < 0.5)
    assert checked["at_control_of_calibration"]["points"][0] == 84


def test_what_refuses_a_calibration_is_said_once(flight: Path, tmp_path: Path) -> None:
    project = Path(shutil.copytree(flight.parent, tmp_path / "flight")) / flight.name
    # Remounted: contradicted by the model, by what is rejected, and by the second step.
    exposures = pd.read_csv(project.parent / "exposures.csv", dtype={"strip": str, "flight": str})
    exposures.loc[exposures["strip"].str.match(".*(02f|02r|03f)$"), "pitch"] += 0.02
    exposures.to_csv(project.parent / "exposures.csv", index=False)
    outcome = calibrated(project)
    found = figures(outcome)
    against = (*found["reasons"], *found["restrictions"])
    assert len(found["reasons"]) > 2
    assert any("One-step and two-step calibration contradict" in reason for reason in against)
    assert any("not flown with one mounting" in reason for reason in against)
    console = Console(file=io.StringIO(), width=10_000, record=True)
    console.print(result_table(outcome))
    said = {
        "summary": "\n".join(outcome.summary.problems),
        "terminal": console.export_text(),
        **{
            name: Page((outcome.directory / f"{name}.html").read_text()).text
            for name in ("report", "certificate")
        },
    }
    # The certificate names quantities and settings by their meaning.
    words = {where: [in_words(one) if where == "certificate" else one for one in against] for where in said}
    times = {
        (where, reason): " ".join(text.split()).count(reason)
        for where, text in said.items()
        for reason in words[where]
    }
    assert {key for key, number in times.items() if number != 1} == set()


@pytest.mark.slow
def test_with_one_height_the_focal_length_is_weak_and_the_flight_refused(tmp_path: Path) -> None:
    outcome = calibrated(flown(tmp_path, *ONE_HEIGHT))
    assert outcome.error is None, outcome.error
    found = figures(outcome)
    by_name = {item["parameter"]: item for item in found["parameters"]}
    assert by_name["focal_length"]["verdict"] in ("weak", "not_determinable")
    assert found["verdict"] == "refused"
    assert any("one height" in reason for reason in found["reasons"])


def test_what_a_single_direction_at_one_height_does_not_determine_is_held(tmp_path: Path) -> None:
    """Mounting and shift stay determined, because the interior orientation is held again."""
    single = tuple(f'flight.{number}.directions="single"' for number in range(4))
    headings = tuple(f"flight.{number}.heading_deg=90" for number in range(4))
    outcome = calibrated(flown(tmp_path, *ONE_HEIGHT, *single, *headings), story=calibration_alone)
    assert outcome.error is None, outcome.error
    found = figures(outcome)
    assert found["verdict"] == "refused"
    assert outcome.summary.status == "gate_failed"
    reasons = tuple(f"The calibration is refused: {reason}" for reason in found["reasons"])
    assert outcome.summary.problems[: len(reasons)] == reasons
    by_name = {item["parameter"]: item for item in found["parameters"]}
    assert by_name["focal_length"]["verdict"] == "not_determinable"
    assert "height" in by_name["focal_length"]["because"]
    assert by_name["principal_point_x"]["verdict"] == "not_determinable"
    assert {by_name[f"gnss_shift_{axis}"]["verdict"] for axis in "xyz"} == {"determined"}
    record = CalibrationRecord.model_validate_json((outcome.directory / "calibration.json").read_text())
    (focal_length,) = (item for item in record.parameters if item.parameter == "focal_length")
    assert focal_length.sigma is None
    assert focal_length.value == focal_length.given
    assert [sorted(release["held"]) for release in found["releases"]] == [
        [],
        ["focal_length", "principal_point"],
        [],
    ]


def test_without_enough_control_there_is_no_second_step_and_that_is_said(tmp_path: Path) -> None:
    fewer = ("points.count=250", "flight.0.exposures=5", "flight.1.exposures=5")
    project = flown(tmp_path, *SMALL, *fewer, 'control=[{layout="grid",columns=2,rows=1}]')
    outcome = calibrated(project, story=calibration_alone)
    assert outcome.error is None, outcome.error
    assert figures(outcome)["two_step"] is None
    problems = outcome.summary.problems
    assert any("no two-step calibration" in text for text in problems)
    # Nobody can act upon it.
    places = [
        next(k for k, text in enumerate(problems) if words in text)
        for words in (" uncontrolled ", "too little")
    ]
    assert places[0] < places[1]


@pytest.mark.slow
def test_image_points_stated_too_coarse_change_nothing_but_a_remark(
    flight: Path, record: CalibrationRecord, tmp_path: Path
) -> None:
    change = ("inputs.image_points.sigma=0.006", "calibration.two_step=false")
    outcome = calibrated(flight, *change, out=tmp_path)
    assert outcome.error is None, outcome.error
    coarse = CalibrationRecord.model_validate_json((tmp_path / "calibration.json").read_text())
    assert (coarse.verdict, coarse.reasons) == ("restricted", ())
    assert "σ of image points are too large: they are 0.20" in " ".join(coarse.restrictions)
    for one, other in zip(coarse.parameters, record.parameters, strict=True):
        if other.sigma is not None:
            assert one.sigma == pytest.approx(other.sigma, rel=0.01)
            assert abs(one.value - other.value) < 0.02 * other.sigma


@pytest.mark.slow
def test_additional_parameters_are_released_last(flight: Path, tmp_path: Path) -> None:
    selection = 'adjustment.self_calibration.parameters="bluh:1-12"'
    outcome = calibrated(flight, selection, "calibration.two_step=false", out=tmp_path)
    assert outcome.error is None, outcome.error
    releases = figures(outcome)["releases"]
    assert [release["additional"] for release in releases] == ["none", "none", "bluh:1-12"]
    record = CalibrationRecord.model_validate_json((tmp_path / "calibration.json").read_text())
    assert {item.parameter for item in record.parameters} >= {f"bluh:{number}" for number in range(1, 13)}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("calibration.fre=[]", "free"),
        ('calibration.free=["boresihgt"]', "boresight"),
        ("calibration.limits.shift_m=-1", "shift_m"),
    ],
)
def test_wrong_settings_are_one_message(flight: Path, tmp_path: Path, change: str, says: str) -> None:
    outcome = calibrated(flight, change, out=tmp_path / "out")
    assert outcome.summary.status == "input_error"
    assert says in str(outcome.error)


def test_a_second_run_computes_nothing(
    flight: Path, accepted: RunOutcome, caplog: pytest.LogCaptureFixture
) -> None:
    before = {path.name: path.read_bytes() for path in accepted.directory.glob("*.json")}
    with caplog.at_level("INFO", logger="aerocal"):
        again = calibrated(flight)
    assert again.error is None
    assert not [text for text in caplog.messages if "computed" in text]
    assert (again.directory / "calibration.json").read_bytes() == before["calibration.json"]


def test_an_edited_certificate_is_refused_before_anything_is_computed(
    accepted: RunOutcome, flight: Path, tmp_path: Path
) -> None:
    out = shutil.copytree(accepted.directory, tmp_path / "results")
    require_refused_at_start(
        out, "certificate.html", OF_EVERY_CALIBRATION, lambda: calibrated(flight, out=out)
    )


def test_who_signs_changes_the_certificate_alone(accepted: RunOutcome, flight: Path, tmp_path: Path) -> None:
    folder = tmp_path / "results"
    shutil.copytree(accepted.directory, folder)
    before = {name: (folder / name).read_bytes() for name in ("calibration.json", "report.html")}
    signed = ('certificate.numbers={ "UCE-80" = "2026-017" }', "certificate.calibrated=2026-09-21")
    calibrated(flight, *signed, out=folder)
    computed = [one.stage for one in read_records(folder / ".store") if not one.reused]
    assert computed == ["certificate"]
    assert {name: (folder / name).read_bytes() for name in before} == before
    facts = {
        fact["key"]: fact["shown"]
        for section in json.loads((folder / "certificate.json").read_text())["sections"]
        for block in section["blocks"]
        for fact in block.get("facts", [])
    }
    assert (facts["number"], facts["calibrated"], facts["laboratory"]) == ("2026-017", "2026-09-21", "")
    assert facts["project_file"] == hashlib.sha256(flight.read_bytes()).hexdigest()


def test_the_certificate_holds_every_sigma_against_its_limit(
    accepted: RunOutcome, record: CalibrationRecord
) -> None:
    sections = json.loads((accepted.directory / "certificate.json").read_text())["sections"]
    (table,) = [b for s in sections for b in s["blocks"] if b.get("name") == "limits"]
    rows = {row["key"]: row["cells"] for row in table["rows"]}
    for item in record.estimated:
        assert rows[f"sigma:{item.parameter}@{item.entity}"][-1] == "met"
    value, _, limit = rows["sigma:focal_length@UCE-80"][1:4]
    (sigma,) = [item.sigma for item in record.parameters if item.parameter == "focal_length"]
    assert sigma is not None
    assert (value["value"], limit["value"]) == (pytest.approx(1e3 * sigma), pytest.approx(2.0))
    assert {"headings", "height_ratio", "global_test", "sigma0:ins_attitudes"} <= set(rows)
    # What decides is met in all accepted calibrations.
    assert not any(cells[-1] == "not met" for cells in rows.values())
    assert set(record.software) >= {"aerocal", "numpy", "scipy", "numba", "pyarrow"}


def test_the_report_shows_the_verdicts_and_both_methods(accepted: RunOutcome) -> None:
    page = Page((accepted.directory / "report.html").read_text(encoding="utf-8"))
    parameters = pd.read_parquet(accepted.directory / "parameters.parquet")
    rows_of = parameters.set_index(parameters["parameter"] + "@" + parameters["entity"])
    verdicts = page.tables["calibration"]
    of_calibration = {
        f"{item['parameter']}@{item['entity']}": item["sigma"] for item in figures(accepted)["parameters"]
    }
    assert len(verdicts.keys) == 9
    for key in verdicts.keys:
        assert float(verdicts.numbers[key, "change"].data) == rows_of.loc[key, "change"]
        # With what was held.
        assert float(verdicts.numbers[key, "sigma"].data) == of_calibration[key] > rows_of.loc[key, "sigma"]
    steps = page.tables["calibration-steps"]
    compared = figures(accepted)["two_step"]["parameters"]
    assert len(steps.keys) == len(compared) == 6
    for item in compared:
        key = f"{item['parameter']}@{item['entity']}"
        assert float(steps.numbers[key, "t"].data) == item["t"]
    assert "accepted" in page.text
