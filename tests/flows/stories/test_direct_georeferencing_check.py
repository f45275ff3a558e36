"""The direct-georeferencing check of simulated flights, from project file to tables and page."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from flows.stories.direct_georeferencing_check import direct_georeferencing_check
from tasks.results.publish import OF_EVERY_ADJUSTMENT, OF_EVERY_CHECK
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.command_line import aerocal
from tests.flows.adjustment_alone import adjustment_alone
from tests.flows.refused_at_start import require_refused_at_start
from tests.flows.second_head import add_second_head
from tests.tasks.documents.report.page_reader import Page

CONTROL = (
    'control=[{layout="grid",columns=6,rows=5,margin=0.15},{layout="spread",count=40,control=0,margin=0.15}]'
)
FEW_POINTS = ("points.count=450", "points.detection=0.6", CONTROL)
AXES = ("x", "y", "z")
OWN = "direct_georeferencing.calibration=adjustment"


@dataclass(frozen=True)
class Checked:
    """A finished check."""

    folder: Path

    @property
    def summary(self) -> dict[str, Any]:
        content = json.loads((self.folder / "summary.json").read_text())
        assert isinstance(content, dict)
        return content

    @property
    def figures(self) -> dict[str, Any]:
        found = self.summary["direct_georeferencing"]
        assert isinstance(found, dict)
        return found

    def table(self, name: str) -> pd.DataFrame:
        return pd.read_parquet(self.folder / f"{name}.parquet")

    @property
    def page(self) -> Page:
        return Page((self.folder / "georeferencing_check.html").read_text(encoding="utf-8"))


def simulated(folder: Path, *changes: str, seed: int = 1) -> Path:
    """The project file of a simulated high flight: 28 images in crossing lines."""
    return simulate_project(load_simulation("uce-high", (*FEW_POINTS, *changes), seed), folder).project_file


def copied(project: Path, folder: Path) -> Path:
    """The project file of a copy of a delivery, without its results."""
    folder.mkdir()
    for file in project.parent.iterdir():
        if file.is_file():
            shutil.copy(file, folder)
    return folder / "project.toml"


def run(project: Path, out: Path, *overrides: str) -> RunOutcome:
    return carry_out(direct_georeferencing_check, RunRequest(project, out, overrides))


def checked(project: Path, out: Path, *overrides: str) -> Checked:
    outcome = run(project, out, *overrides)
    assert outcome.error is None, outcome.error
    return Checked(out)


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a calibration flight with two heights' worth of control, seed 1."""
    folder = tmp_path_factory.mktemp("calibration")
    project = simulated(folder, 'project.free=["boresight", "gnss_shift", "focal_length", "principal_point"]')
    outcome = carry_out(adjustment_alone, RunRequest(project))
    assert outcome.error is None
    return folder / "results"


@pytest.fixture(scope="module")
def other_flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Another flight of the same camera, its control as new check points."""
    folder = tmp_path_factory.mktemp("flight")
    return simulated(folder, "project.name=another", seed=2)


@pytest.fixture(scope="module")
def check(calibrated: Path, other_flight: Path) -> Checked:
    """The other flight checked with the calibration."""
    out = other_flight.parent / "check"
    return checked(other_flight, out, f"direct_georeferencing.calibration={calibrated}")


@pytest.fixture(scope="module")
def plain(other_flight: Path) -> Checked:
    """The other flight checked with the values of its cameras."""
    return checked(other_flight, other_flight.parent / "plain")


@pytest.fixture(scope="module")
def self_checked(tmp_path_factory: pytest.TempPathFactory) -> Checked:
    """A flight checked with its own adjustment."""
    project = simulated(tmp_path_factory.mktemp("own"))
    return checked(project, project.parent / "results", OWN)


@pytest.fixture
def flight_of_its_own(self_checked: Checked, tmp_path: Path) -> Path:
    """The project file of a copy of that flight with its results."""
    return shutil.copytree(self_checked.folder.parent, tmp_path / "flight") / "project.toml"


@pytest.fixture
def warm_out(plain: Checked, tmp_path: Path) -> Path:
    """An output folder with the stages of the plain check, and no results."""
    shutil.copytree(plain.folder / ".store", tmp_path / "out" / ".store")
    return tmp_path / "out"


def test_without_noise_nothing_differs(tmp_path: Path) -> None:
    project = simulated(tmp_path / "exact", "noise.level=0")
    found = checked(project, tmp_path / "out", OWN)
    points = found.table("direct_georeferencing")
    assert len(points) == 70
    assert points[[f"d{axis}_m" for axis in AXES]].abs().to_numpy().max() < 1e-5
    assert found.table("direct_georeferencing_models")["dz_m"].abs().max() < 1e-5
    assert found.figures["y_parallax_max_um"] < 1e-4
    assert found.figures["y_parallax_mismatches"] == 0
    assert (points["status"] == "independent").sum() == 40
    # What is predicted does not depend on what was found.
    assert all(value > 0.05 for value in found.figures["predicted_rmse_m"])


def test_a_second_head_with_the_same_readings_changes_no_prediction(
    other_flight: Path, plain: Checked, tmp_path: Path
) -> None:
    """Its own errors are those of the readings, once: of two images they are not independent."""
    project = copied(other_flight, tmp_path / "two")
    add_second_head(project.parent, camera="second")
    one, two = plain, checked(project, tmp_path / "two_out")
    for table, sigmas, keys in (
        ("y_parallaxes", ["sigma_um"], ["left", "right", "point"]),
        ("direct_georeferencing_models", [f"sigma_d{axis}_m" for axis in AXES], ["left", "right", "point"]),
    ):
        alone, both = (found.table(table).set_index(keys)[sigmas] for found in (one, two))
        assert len(both) == 2 * len(alone)
        np.testing.assert_allclose(both.loc[alone.index], alone, rtol=1e-9)
    for name in (f"y_parallax_predicted_{figure}_um" for figure in ("rms", "low", "high")):
        assert two.figures[name] == pytest.approx(one.figures[name], rel=1e-3)


def test_differences_of_another_flight_are_what_its_sigmas_and_the_calibration_predict(
    check: Checked, other_flight: Path
) -> None:
    found = check.figures
    points = check.table("direct_georeferencing")
    chosen = points[points["status"] == "independent"]
    for k, axis in enumerate(AXES):
        assert found["predicted_low_m"][k] < found["rmse_m"][k] < found["predicted_high_m"][k]
        assert found["rmse_m"][k] == pytest.approx(np.sqrt((chosen[f"d{axis}_m"] ** 2).mean()))
        assert found["max_m"][k] == pytest.approx(chosen[f"d{axis}_m"].abs().max())
        assert found["mean_m"][k] == pytest.approx(chosen[f"d{axis}_m"].mean())
        gsd = chosen[f"d{axis}_m"] / chosen["gsd_m"]
        assert found["rmse_gsd"][k] == pytest.approx(np.sqrt((gsd**2).mean()))
        predicted = np.sqrt((chosen[f"sigma_d{axis}_m"] ** 2).mean())
        assert found["predicted_rmse_m"][k] == pytest.approx(predicted)
        parts = [found["predicted_parts_m"][name][k] for name in found["predicted_parts_m"]]
        assert np.hypot.reduce(parts) == pytest.approx(predicted)
    # 2340 m and 5.2 µm at 80 mm.
    assert chosen["gsd_m"].median() == pytest.approx(0.152, rel=0.02)
    assert other_flight.is_file()


def test_a_calibration_of_another_camera_is_refused(
    calibrated: Path, other_flight: Path, warm_out: Path
) -> None:
    out = warm_out
    named = f"direct_georeferencing.calibration={calibrated}"
    outcome = run(other_flight, out, named, 'cameras.UCE-80.identity.body="UC-E-2"')
    assert "of another camera (no numbers there, body UC-E-2 here)" in str(outcome.error)
    assert not (out / "direct_georeferencing.parquet").exists()


def test_y_parallaxes_are_what_gnss_and_ins_predict(check: Checked) -> None:
    found, table, models = check.figures, check.table("y_parallaxes"), check.table("stereo_models")
    assert found["y_parallax_predicted_low_um"] < found["y_parallax_rms_um"]
    assert found["y_parallax_rms_um"] < found["y_parallax_predicted_high_um"]
    assert found["y_parallax_max_um"] < found["y_parallax_predicted_max_limit_um"]
    used = table[table["status"] == "used"]
    assert found["y_parallax_rms_um"] == pytest.approx(np.sqrt((used["parallax_um"] ** 2).mean()))
    assert found["y_parallax_max_um"] == pytest.approx(used["parallax_um"].abs().max())
    # Image coordinates of 1.05 µm are what is left when every model is oriented relatively.
    assert found["y_parallax_remaining_sigma_um"] == pytest.approx(1.05 * np.sqrt(2.0), rel=0.1)
    by_model = used.groupby(["left", "right"])["parallax_um"]
    own = models.set_index(["left", "right"])
    pd.testing.assert_series_equal(
        own["max_um"], by_model.apply(lambda p: p.abs().max()).reindex(own.index), check_names=False
    )
    assert (own["points"] == by_model.size().reindex(own.index)).all()
    # 28 images in 4 lines.
    assert len(models) == 24


def test_calibration_errors_are_common_to_all_points(
    calibrated: Path, other_flight: Path, warm_out: Path
) -> None:
    """With a shift that is known to a metre, all points are wrong by the same, and few degrees are left."""
    folder = warm_out.parent / "rough"
    shutil.copytree(calibrated, folder, ignore=shutil.ignore_patterns(".store"))
    parameters = pd.read_parquet(folder / "parameters.parquet")
    (folder / "parameters.parquet").chmod(0o644)
    shift = parameters["parameter"].str.startswith("gnss_shift")
    parameters.loc[shift, "sigma"] = 1.0
    correlations = pd.read_parquet(folder / "correlations.parquet")
    correlations["correlation"] = 0.0
    (folder / "correlations.parquet").chmod(0o644)
    for table, name in ((parameters, "parameters"), (correlations, "correlations")):
        _with_the_same_metadata(table, calibrated / f"{name}.parquet", folder / f"{name}.parquet")
    figures = checked(other_flight, warm_out, f"direct_georeferencing.calibration={folder}").figures
    for k in range(3):
        assert figures["predicted_parts_m"]["calibration"][k] > 1.0
        assert figures["predicted_mean_sigma_m"][k] == pytest.approx(figures["predicted_rmse_m"][k], rel=0.1)
        assert figures["degrees_of_freedom"][k] < 1.3


def _with_the_same_metadata(table: pd.DataFrame, like: Path, target: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pq.read_schema(like)
    pq.write_table(pa.Table.from_pandas(table, schema=schema, preserve_index=False), target)


def test_control_of_the_calibration_is_kept_apart_however_it_is_called(
    calibrated: Path, tmp_path: Path
) -> None:
    """The calibration flight itself, its 30 control points under other names and as check points."""
    project = copied(calibrated.parent / "project.toml", tmp_path / "renamed")
    names = {name: f"new-{name}" for name in pd.read_csv(project.parent / "control.csv")["point"]}
    for file in ("control", "image_points"):
        table = pd.read_csv(project.parent / f"{file}.csv", dtype=str)
        table["point"] = table["point"].map(lambda name: names.get(name, name))
        if file == "control":
            table["role"] = "check"
        table.to_csv(project.parent / f"{file}.csv", index=False)
    found = checked(project, tmp_path / "out", f"direct_georeferencing.calibration={calibrated}")
    status = found.table("direct_georeferencing").set_index("point")["status"]
    assert (status == "control_of_calibration").sum() == 30
    assert found.figures["points"] == [40, 40, 40]
    assert found.figures["at_control_of_calibration"]["points"] == [30, 30, 30]
    assert any("30 surveyed points were control" in sentence for sentence in found.summary["problems"])


def test_the_values_of_the_cameras_are_a_calibration_without_sigmas(
    calibrated: Path, other_flight: Path, warm_out: Path
) -> None:
    parameters = pd.read_parquet(calibrated / "parameters.parquet").set_index("parameter")["value"]
    camera = "cameras.UCE-80"
    overrides = (
        f"{camera}.focal_length_mm={parameters['focal_length']}",
        f"{camera}.principal_point_mm=[{parameters['principal_point_x']}, {parameters['principal_point_y']}]",
        f"{camera}.boresight_deg={[float(parameters[f'boresight_{n}']) for n in ('roll', 'pitch', 'yaw')]}",
    )
    figures = checked(other_flight, warm_out, *overrides).figures
    # The shift (−0.26, 0.12, 0.29 m) is no value of a camera: without it all points are off by it.
    np.testing.assert_allclose(figures["mean_m"][:2], [-0.262, 0.123], atol=0.1)
    assert figures["predicted_parts_m"]["calibration"] == [0.0, 0.0, 0.0]


def test_an_own_adjustment_that_estimated_nothing_is_not_of_unknown_exposures(
    other_flight: Path, warm_out: Path
) -> None:
    overrides = ("direct_georeferencing.calibration=adjustment", "adjustment.free=[]")
    said = checked(other_flight, warm_out, *overrides).summary["problems"]
    assert any("has estimated no parameter" in sentence for sentence in said)
    assert not any("are not known" in sentence for sentence in said)


def test_the_page_shows_the_figures_of_the_tables(check: Checked) -> None:
    page, found = check.page, check.figures
    for key in ("rmse_m", "predicted_rmse_m", "mean_m", "max_m", "rmse_gsd"):
        for k, axis in enumerate(AXES):
            assert float(page.tables["independent"].numbers[key, axis].data) == found[key][k]
            assert float(page.tables["models"].numbers[key, axis].data) == found["in_models"][key][k]
    assert f"{found['rmse_m'][2]:.3f} mRMS up" in page.text
    parallaxes = page.tables["parallaxes"].numbers
    assert float(parallaxes["rms", "found"].data) == found["y_parallax_rms_um"]
    assert float(parallaxes["max", "high"].data) == found["y_parallax_predicted_max_limit_um"]
    points = check.table("direct_georeferencing").set_index("point")
    for key in page.tables["points"].keys:
        for axis in AXES:
            shown = page.tables["points"].numbers
            assert float(shown[key, f"d{axis}_m"].data) == points.loc[key, f"d{axis}_m"]
            assert float(shown[key, f"sigma_d{axis}_m"].data) == points.loc[key, f"sigma_d{axis}_m"]
    assert {item["parameter"] for item in found["calibration"]} >= {"focal_length", "gnss_shift_z"}
    assert page.tags.count("svg") == 3
    assert "40 independent check points differ from their survey" in page.text
    for statement in found["statements"]:
        assert statement["sentence"] in page.text


def test_names_from_files_cannot_break_the_page(other_flight: Path, tmp_path: Path) -> None:
    project = copied(other_flight, tmp_path / "named")
    for name in ("control", "image_points"):
        file = project.parent / f"{name}.csv"
        file.write_text(file.read_text().replace("C001", "<i>C&1</i>"))
    page = checked(project, tmp_path / "out").page
    assert "<i>C&1</i>" in page.text
    assert "i" not in page.tags


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (("direct_georeferencing.calibration=nowhere",), "There is no file"),
        (('direct_georeferencing.shift_of_flight="9"',), "no GNSS shift for the flight '9'"),
        (("direct_georeferencing.calibration=cameras", "gates.y_paralax_max_um={ max = 1 }"), "Did you mean"),
    ],
)
def test_wrong_input_ends_with_its_reason(
    calibrated: Path, other_flight: Path, tmp_path: Path, overrides: tuple[str, ...], words: str
) -> None:
    given = (f"direct_georeferencing.calibration={calibrated}", *overrides)
    outcome = run(other_flight, tmp_path / "out", *given)
    assert outcome.summary.status == "input_error"
    assert words in str(outcome.error)


def test_a_flight_without_attitudes_cannot_be_checked(other_flight: Path, tmp_path: Path) -> None:
    project = copied(other_flight, tmp_path / "f")
    exposures = pd.read_csv(tmp_path / "f" / "exposures.csv")
    exposures[["heading", "pitch", "roll"]] = np.nan
    exposures.to_csv(tmp_path / "f" / "exposures.csv", index=False)
    outcome = run(project, tmp_path / "out")
    assert outcome.summary.status == "input_error"
    assert "None of the measured images has position and attitude" in str(outcome.error)


def test_without_strips_there_are_no_models_and_it_is_said(other_flight: Path, tmp_path: Path) -> None:
    project = copied(other_flight, tmp_path / "f")
    exposures = pd.read_csv(tmp_path / "f" / "exposures.csv").assign(strip="")
    exposures.to_csv(tmp_path / "f" / "exposures.csv", index=False)
    found = checked(project, tmp_path / "out")
    assert found.figures["y_parallax_rms_um"] is None
    assert any("the exposures contain no strips" in sentence for sentence in found.summary["problems"])
    assert "no two consecutive images" in found.page.text
    refused = run(project, tmp_path / "out", "direct_georeferencing.strip_bias_m=0.03")
    assert "The exposures contain no strips" in str(refused.error)
    failed = run(project, tmp_path / "out", "gates.y_parallax_rms_um={ max = 100 }")
    assert failed.summary.status == "gate_failed"


def test_without_any_surveyed_point_the_parallaxes_are_still_checked(
    other_flight: Path, tmp_path: Path
) -> None:
    project = copied(other_flight, tmp_path / "f")
    text = project.read_text()
    assert text.count("[inputs.control]") == 1
    before, _, rest = text.partition("[inputs.control]")
    project.write_text(before + rest[rest.index("\n[") :])
    found = checked(project, tmp_path / "out")
    assert found.figures["rmse_m"] == [None, None, None]
    assert found.figures["y_parallax_rms_um"] > 1.0
    assert len(found.table("direct_georeferencing")) == 0
    assert "Direct georeferencing was not tested" in found.page.text
    failed = run(project, tmp_path / "out", "gates.direct_georeferencing_max_m={ max = 9 }")
    assert failed.summary.status == "gate_failed"


def test_mean_residuals_that_the_own_adjustment_added_correct_the_check_too(tmp_path: Path) -> None:
    # A radial error looks like a relative orientation; shifts of single CCD images do not.
    project = simulated(tmp_path / "tiles", "truth.image_errors.tile_um=8.0")
    plain, corrected = (
        checked(project, tmp_path / "out", OWN, f"adjustment.residual_grid.iterations={iterations}").figures
        for iterations in (0, 3)
    )
    assert corrected["y_parallax_remaining_sigma_um"] < 0.9 * plain["y_parallax_remaining_sigma_um"]


def test_errors_that_last_are_taken_into_account(other_flight: Path, plain: Checked, warm_out: Path) -> None:
    lasting = checked(other_flight, warm_out, "adjustment.ins_correlation_s=300").figures
    assert lasting["y_parallax_predicted_rms_um"] < 0.8 * plain.figures["y_parallax_predicted_rms_um"]
    assert lasting["rmse_m"] == plain.figures["rmse_m"]


def test_mismatched_points_are_left_out_of_the_parallaxes(
    other_flight: Path, plain: Checked, warm_out: Path, tmp_path: Path
) -> None:
    project = copied(other_flight, tmp_path / "f")
    points = pd.read_csv(tmp_path / "f" / "image_points.csv", dtype={"image": str, "point": str})
    points.loc[::150, ["x", "y"]] += 0.06
    points.to_csv(tmp_path / "f" / "image_points.csv", index=False)
    before, found = plain.figures, checked(project, warm_out)
    table = found.table("y_parallaxes")
    moved = set(zip(points["image"][::150], points["point"][::150], strict=True))
    hit = [
        (left, point) in moved or (right, point) in moved
        for left, right, point in table[["left", "right", "point"]].itertuples(index=False)
    ]
    mismatch = (table["status"] == "mismatch").to_numpy()
    # 60 µm against 4.13 · 1.5 µm; in models with few points some cannot be told.
    assert mismatch[hit].mean() > 0.9
    assert mismatch[~np.array(hit)].sum() <= 2
    assert found.figures["y_parallax_mismatches"] == mismatch.sum()
    assert found.figures["y_parallax_max_um"] < before["y_parallax_max_um"] + 8.0
    assert any("are mismatched" in sentence for sentence in found.summary["problems"])


def test_a_check_leaves_the_adjustment_where_it_is_and_an_adjustment_removes_the_check(
    flight_of_its_own: Path,
) -> None:
    project = flight_of_its_own
    out = project.parent / "results"
    carry_out(aerial_triangulation, RunRequest(project))
    assert not (out / "y_parallaxes.parquet").exists()
    checked(project, out, f"direct_georeferencing.calibration={out}")
    assert (out / "exterior_orientations.parquet").is_file()
    assert (out / "report.html").is_file()
    listed = json.loads((out / "manifest.json").read_text())["artifacts"]
    assert {"parameters", "y_parallaxes", "georeferencing_check", "report"} <= set(listed)
    carry_out(aerial_triangulation, RunRequest(project))
    assert not (out / "y_parallaxes.parquet").exists()
    assert not (out / "georeferencing_check.html").exists()


def test_an_edited_page_is_refused_before_anything_is_computed(
    plain: Checked, other_flight: Path, tmp_path: Path
) -> None:
    out = shutil.copytree(plain.folder, tmp_path / "results")
    require_refused_at_start(out, "georeferencing_check.html", OF_EVERY_CHECK, lambda: run(other_flight, out))


def test_an_edited_report_of_the_own_adjustment_is_refused_before_anything_is_computed(
    flight_of_its_own: Path,
) -> None:
    out = flight_of_its_own.parent / "results"
    require_refused_at_start(
        out, "report.html", OF_EVERY_ADJUSTMENT, lambda: run(flight_of_its_own, out, OWN)
    )


def test_the_command_shows_the_check_and_fails_with_its_gates(flight_of_its_own: Path) -> None:
    project = flight_of_its_own
    done = aerocal("check", project, "--set", OWN, "--server", "none")
    assert done.returncode == 0, done.stderr
    for words in (
        "adjusted and checked",
        "Independent check points, all rays",
        "y-parallaxes of",
        "Edition 2",
    ):
        assert words in done.stdout
    gates = (
        "--set=gates.direct_georeferencing_rmse_m={ max = [9, 9, 0.01] }",
        "--set=gates.y_parallax_max_um={ max = 500 }",
        "--set=gates.sigma0={ max = 9 }",
    )
    done = aerocal("check", project, "--set", OWN, "--server", "none", "--json", *gates)
    assert done.returncode == 4, done.stderr
    tested = {gate["name"]: gate for gate in json.loads(done.stdout)["gates"]}
    assert [name for name, gate in tested.items() if not gate["passed"]] == ["direct_georeferencing_rmse_m_z"]
    assert tested["y_parallax_max_um"]["unit"] == "um"
    assert tested["sigma0"]["passed"]
    page = (project.parent / "results" / "georeferencing_check.html").read_text(encoding="utf-8")
    assert "Not met: RMS at check points, direct georeferencing, z." in page
    # The limits of a check are none of the adjustment's, which says so.
    done = aerocal("adjust", project, "--server", "none", "--json", *gates)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)["problems"]
    assert any(
        "y_parallax_max_um is not tested: this run contains no direct" in sentence for sentence in told
    )


def test_help_says_which_calibrations_there_are() -> None:
    text = aerocal("check", "--help").stdout
    for words in (
        "direct_georeferencing.calibration=adjustment",
        "georeferencing_check.html",
        "4 gate failed",
    ):
        assert words in text


def test_a_changed_setting_of_the_check_repeats_the_check_and_its_page_only(
    self_checked: Checked, flight_of_its_own: Path
) -> None:
    def computed(out: Path) -> list[str]:
        stages = json.loads((out / "manifest.json").read_text())["stages"]
        return [stage["stage"] for stage in stages if not stage["reused"]]

    assert {"import_image_points", "bundle_adjustment"} < set(computed(self_checked.folder))
    out = flight_of_its_own.with_name("results")
    assert run(flight_of_its_own, out, OWN).error is None
    assert computed(out) == []
    assert run(flight_of_its_own, out, OWN, "direct_georeferencing.critical_value=5").error is None
    assert computed(out) == ["direct_georeferencing", "georeferencing_page", "report"]
