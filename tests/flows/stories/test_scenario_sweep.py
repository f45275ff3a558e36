"""A sweep through the command line: a small field, two sub-blocks, two choices of control, two variants."""

from __future__ import annotations

import json
import re
import shutil
import signal
import subprocess
import sys
import time
from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from flows.command.sweep_execution import scenario_table
from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from tasks.document_kit.table import NONE
from tasks.results.publish import OF_EVERY_SWEEP
from tests.command_line import aerocal
from tests.conftest import Start
from tests.flows.adjustment_alone import adjustment_alone
from tests.flows.refused_at_start import require_refused_at_start
from tests.flows.serving.test_registered import latest_run
from tests.tasks.documents.report.page_reader import Page, ends_of_arrows

AEROCAL = [sys.executable, "-m", "flows.command"]

FIELD = """
preset = "uce-testfield"
[project]
name = "small field"
observe = ["control"]
[[flight]]
name = "E"
flight = "low"
height_m = 780.0
heading_deg = 90.0
lines = 2
exposures = 5
[[flight]]
name = "H"
flight = "high"
height_m = 1560.0
heading_deg = 0.0
lines = 1
exposures = 4
[points]
count = 250
[control]
columns = 4
rows = 3
extent_m = [1100.0, 900.0]
[sweep]
parameters = []
compare_with = "uce-2012"
[sweep.variants]
none = {}
loose = { "inputs.control.sigma_m" = 0.2 }
[sweep.control]
"84/0" = "all"
"5/79" = { count = 5 }
"""
SMALLER = ("--set", 'sweep.blocks={low=["low"], both=["low", "high"]}')
SMALLER += ("--set", 'sweep.control={"84/0"="all", "5/79"={count=5}}')
SMALLER += ("--set", "sweep.workers=1")


def sweep(field: Path, out: Path, *more: str) -> subprocess.CompletedProcess[str]:
    return aerocal("sweep", field, "--out", out, *SMALLER, *more)


def results(out: Path) -> pd.DataFrame:
    """sweep.parquet in the order of the project, by block|control|variant."""
    table = pd.read_parquet(out / "sweep.parquet").sort_values("number")
    table.index = pd.Index(table["block"] + "|" + table["control"] + "|" + table["variant"])
    return table


def manifest(out: Path) -> dict[str, list[dict[str, object]]]:
    content = json.loads((out / "manifest.json").read_text())
    assert isinstance(content, dict)
    return content


def made_by(out: Path, stage: str, *, reused: bool) -> int:
    """How many outputs of a stage the last run took from the store, or computed."""
    return sum(entry["stage"] == stage and entry["reused"] == reused for entry in manifest(out)["stages"])


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("field")
    (folder / "spec.toml").write_text(FIELD)
    done = aerocal("simulate", folder / "spec.toml", "--out", folder / "project")
    assert done.returncode == 0, done.stderr
    return folder / "project" / "project.toml"


@pytest.fixture(scope="module")
def swept(field: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of the sweep, made by one process."""
    out = tmp_path_factory.mktemp("swept")
    done = sweep(field, out)
    assert done.returncode == 0, done.stderr
    assert "sweep: 8 of 8: both, 5/79, loose: σ0 " in done.stderr
    assert "sweep.html" in done.stdout
    return out


@pytest.fixture
def warm_out(swept: Path, tmp_path: Path) -> Path:
    """An output folder with the stages of that sweep, and no results."""
    shutil.copytree(swept / ".store", tmp_path / "out" / ".store")
    return tmp_path / "out"


def test_every_combination_is_a_row_in_the_order_of_the_project(swept: Path) -> None:
    table = results(swept)
    expected = [f"{b}|{c}|{v}" for b in ("low", "both") for c in ("84/0", "5/79") for v in ("none", "loose")]
    assert list(table.index) == expected
    assert set(table["status"]) == {"done"}
    assert table["images"].tolist() == [10] * 4 + [14] * 4
    assert table["control_points"].tolist() == [12, 12, 5, 5] * 2
    assert table["check_points"].tolist() == [0, 0, 7, 7] * 2
    first = table.groupby(["block", "control"])["sigma0"].transform("first")
    assert (table["sigma0_ratio"] == table["sigma0"] / first).all()
    assert table["gsd_m"].between(0.04, 0.06).all()
    assert table.loc["low|5/79|none", "rmse_check_z_m"] > 0.0
    assert np.isnan(table.loc["low|84/0|none", "rmse_check_z_m"])


def test_what_scenarios_share_is_computed_once(swept: Path) -> None:
    assert made_by(swept, "import_image_points", reused=False) == 2  # σ of control changes one import only
    assert made_by(swept, "sub_block", reused=False) == 2
    assert made_by(swept, "bundle_adjustment", reused=False) == 8


def test_a_scenario_is_the_ordinary_adjustment_with_these_roles(
    field: Path, swept: Path, tmp_path: Path
) -> None:
    table = results(swept).loc["both|5/79|none"]
    shutil.copytree(field.parent, tmp_path / "copy", ignore=shutil.ignore_patterns("results"))
    control = pd.read_csv(tmp_path / "copy" / "control.csv")
    corners_and_middle = _even_five(control)
    control["role"] = np.where(control["point"].isin(corners_and_middle), "control", "check")
    control.to_csv(tmp_path / "copy" / "control.csv", index=False)
    done = carry_out(adjustment_alone, RunRequest(tmp_path / "copy" / "project.toml"))
    assert done.error is None
    summary = json.loads((done.directory / "summary.json").read_text())
    assert summary["sigma0"] == table["sigma0"]
    assert summary["redundancy"] == table["redundancy"]
    assert summary["rmse_check_m"] == [table[f"rmse_check_{axis}_m"] for axis in "xyz"]
    assert summary["max_check_m"] == [table[f"max_check_{axis}_m"] for axis in "xyz"]
    assert summary["rmse_control_m"] == [table[f"rmse_control_{axis}_m"] for axis in "xyz"]


def _even_five(control: pd.DataFrame) -> list[str]:
    """The corners of the grid, and the point nearest to its middle that is farthest from all of them."""
    x, y = control["x"], control["y"]
    middle = [0.5 * (column.min() + column.max()) for column in (x, y)]
    size = [column.max() - column.min() for column in (x, y)]
    distance = np.hypot((x - middle[0]) / size[0], (y - middle[1]) / size[1])
    corners = list(control.loc[distance.nlargest(4).index, "point"])
    part = np.column_stack([x / size[0], y / size[1]])
    at_corner = control["point"].isin(corners).to_numpy()
    nearest = np.min(np.linalg.norm(part[:, None] - part[at_corner][None], axis=2), axis=1)
    return [*corners, str(control["point"][int(np.argmax(nearest))])]


def test_no_coordinate_of_a_check_point_enters(field: Path, warm_out: Path, tmp_path: Path) -> None:
    named = ["C001", "C004", "C009", "C012", "C006"]
    shutil.copytree(field.parent, tmp_path / "copy", ignore=shutil.ignore_patterns("results"))
    project = tmp_path / "copy" / "project.toml"
    select = ("--set", f"sweep.control={{five={json.dumps(named)}}}", "--set", "sweep.variants={none={}}")
    select += ("--set", 'sweep.blocks={both=["low", "high"]}')
    shutil.copytree(warm_out, tmp_path / "before")
    assert sweep(project, tmp_path / "before", *select).returncode == 0
    control = pd.read_csv(tmp_path / "copy" / "control.csv")
    control.loc[~control["point"].isin(named), ["x", "y", "z"]] += [3.0, -2.0, 5.0]
    control.to_csv(tmp_path / "copy" / "control.csv", index=False)
    assert sweep(project, warm_out, *select).returncode == 0
    before, after = (results(out) for out in (tmp_path / "before", warm_out))
    for column in ("sigma0", "rmse_control_x_m", "rmse_control_z_m", "redundancy", "image_rms_x_um"):
        assert (before[column] == after[column]).all()
    assert (after["rmse_check_z_m"] > 4.5).all()


# Daily, workers of a batch write the bytes of a run; the service tests compare one, two and those of Dask.
@pytest.mark.slow
def test_two_workers_write_the_same_bytes_as_one(field: Path, swept: Path, tmp_path: Path) -> None:
    assert sweep(field, tmp_path / "two", "--set", "sweep.workers=2").returncode == 0
    for name in ("sweep.parquet", "sweep.html"):
        assert (tmp_path / "two" / name).read_bytes() == (swept / name).read_bytes()


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_killed_sweep_goes_on_where_it_stood_and_leaves_no_worker(
    start: Start, field: Path, tmp_path: Path
) -> None:
    command = [*AEROCAL, "sweep", str(field), "--out", str(tmp_path / "out"), *SMALLER]
    command += ["--set", "sweep.workers=2"]
    process = start(*command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
    assert process.stderr is not None
    for line in process.stderr:
        if "sweep: 2 of 8" in line:
            break
    workers = _children(process.pid)
    process.send_signal(signal.SIGKILL)
    assert len(workers) >= 2
    deadline = time.monotonic() + 20.0
    while any(_is_running(worker) for worker in workers) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not any(_is_running(worker) for worker in workers)
    assert not (tmp_path / "out" / "sweep.parquet").exists()
    done = sweep(field, tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert made_by(tmp_path / "out", "bundle_adjustment", reused=True) >= 2
    assert made_by(tmp_path / "out", "approximate_values", reused=False) == 0
    assert len(results(tmp_path / "out")) == 8


def _children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def _is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_a_scenario_without_a_datum_is_a_row_that_says_so(field: Path, warm_out: Path) -> None:
    few = ("--set", "sweep.control={none=[], all='all'}", "--set", "sweep.variants={none={}}")
    done = sweep(field, warm_out, *few, "--json")
    assert done.returncode == 0, done.stderr
    table = results(warm_out)
    assert table["status"].tolist() == ["not_computable", "done"] * 2
    failed, fine = table.loc["low|none|none"], table.loc["low|all|none"]
    assert "Nothing fixes the scale" in failed["reason"]
    assert np.isnan(failed["sigma0"])
    assert fine["sigma0"] > 0.5
    summary = json.loads(done.stdout)
    assert summary["status"] == "done"
    assert [row["status"] for row in summary["sweep"]] == table["status"].tolist()
    assert any("rank defect" in sentence for sentence in summary["problems"])
    page = Page((warm_out / "sweep.html").read_text())
    assert page.tables["failures"].keys == ["low|none|none", "both|none|none"]


def test_when_nothing_can_be_computed_the_exit_code_says_so(field: Path, warm_out: Path) -> None:
    done = sweep(field, warm_out, "--set", "sweep.control={none=[]}", "--set", "sweep.variants={none={}}")
    assert done.returncode == 3
    assert "None of the 2 scenarios could be computed." in done.stderr
    assert {path.name for path in warm_out.iterdir()} == {"summary.json", ".store"}


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ('sweep.blocks={low=["lwo"]}', "Did you mean 'low'?"),
        ("sweep.control={many={count=13}}", "asks for 13 control points"),
        ('sweep.variants={a={"adjustment.fre"=1}}', "'free'"),
        ('sweep.compare_with="uce-2021"', "'uce-2012'"),
    ],
)
def test_wrong_settings_end_with_one_line_before_anything_is_adjusted(
    field: Path, tmp_path: Path, override: str, words: str
) -> None:
    done = sweep(field, tmp_path / "out", "--set", override)
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out" / ".store" / "bundle_adjustment").exists()


def test_every_number_of_the_page_is_that_of_the_table_or_the_print(swept: Path) -> None:
    from tasks.settings.published_sweep import published_table

    table, page = results(swept), Page((swept / "sweep.html").read_text())
    published = published_table("uce-2012").figures
    compared = 0
    for name, block in (("check-0", "low"), ("control-0", "low"), ("check-1", "both"), ("control-1", "both")):
        shown = page.tables[name]
        role = name.split("-")[0]
        with_points = table[(table[f"{role}_points"] > 0) & (table["block"] == block)]
        assert shown.keys == list(with_points.index)
        for (key, column), cell in shown.numbers.items():
            block, control, variant = key.split("|")
            if column.startswith("published_"):
                figures = published.get((block, control, variant), {})
                own = column.removeprefix("published_")
                expected = figures.get(own)
                if own == "sigma0_ratio" and figures:
                    expected = figures["sigma0_um"] / published[block, control, "none"]["sigma0_um"]
                compared += expected is not None
                assert cell.shown == NONE if expected is None else float(cell.data) == expected
            else:
                assert float(cell.data) == table.loc[key, column]
    assert compared >= 8
    gsd = page.tables["gsd-0"].numbers
    row = table.loc["low|5/79|loose"]
    assert float(gsd["low|5/79|loose", "gsd_z"].data) == row["rmse_check_z_m"] / row["gsd_m"]


def test_the_bars_are_as_high_as_their_numbers_and_the_page_needs_no_network(swept: Path) -> None:
    text = (swept / "sweep.html").read_text()
    page = Page(text)
    named = [value for tag, name, value in page.attributes if (tag, name) == ("figure", "id")]
    assert [value for value in named if "bars" in value] == ["figure-bars-0", "figure-bars-1"]
    row = results(swept).loc["low|5/79|loose"]
    assert f"5/79, loose: Z {row['rmse_check_z_m'] / row['gsd_m']:.2f} GSD" in text
    svg = text.split("<svg")[1].split("</svg>")[0]
    heights = _bar_heights(svg)
    assert len(heights) == 3 * 4
    ratio = {words: height / float(words.split()[-2]) for words, height in heights.items()}
    assert np.ptp(list(ratio.values())) < 0.2 * np.mean(list(ratio.values()))
    references = [value for _, name, value in page.attributes if name in ("href", "src")]
    assert all(value.startswith("#") for value in references)


def _bar_heights(svg: str) -> dict[str, float]:
    """Height of every bar by its title, without the published number in it."""
    bars = re.findall(r'<rect [^>]*height="([^"]+)"[^>]*><title>(.*?)</title>', svg)
    return {words.partition(", published")[0]: float(height) for height, words in bars}


@pytest.mark.parametrize(
    ("names", "lines"),
    [(("both", "84/0", "none"), 1), (("140 single", "9 control points", "bluh:42-73+81-88"), 2)],
)
@pytest.mark.parametrize("status", ["done", "not_computable"])
def test_words_of_names_stay_whole_on_a_terminal_of_eighty_columns(
    names: tuple[str, ...], lines: int, status: str
) -> None:
    numbers = {"sigma0_um": 12.345, "sigma0_ratio": 0.998, "rmse_check_m": [0.04, 0.05, 0.123]}
    row = {**dict(zip(("block", "control", "variant"), names, strict=True)), **numbers, "status": status}
    console = Console(width=80, file=StringIO())
    console.print(scenario_table([row], console))
    assert isinstance(console.file, StringIO)
    shown = console.file.getvalue().partition("─\n")[2].splitlines()
    assert len(shown) == lines
    told = " ".join(line[:30] for line in shown).split()
    assert set(" ".join(names).split()) <= set(told), shown
    assert max(map(len, shown)) <= 80


def test_a_sweep_and_an_adjustment_stand_beside_each_other(field: Path, warm_out: Path) -> None:
    out = warm_out
    one = ("--set", "sweep.variants={none={}}", "--set", "sweep.control={all='all'}")
    assert sweep(field, out, *one).returncode == 0
    assert aerocal("run", field, "--out", out, "--server", "none").returncode == 0
    assert sweep(field, out, *one).returncode == 0
    names = set(manifest(out)["artifacts"])
    assert {"sweep", "sweep.html", "report", "object_points"} <= names
    assert (out / "report.html").is_file()
    assert (out / "sweep.html").is_file()


@pytest.mark.prefect
@pytest.mark.usefixtures("prefect_server")
def test_an_edited_page_is_refused_before_anything_is_computed(
    field: Path, swept: Path, tmp_path: Path
) -> None:
    out = shutil.copytree(swept, tmp_path / "results")
    require_refused_at_start(out, "sweep.html", OF_EVERY_SWEEP, lambda: sweep(field, out))


def test_a_sweep_is_a_flow_whose_adjustments_are_tasks(field: Path, swept: Path, tmp_path: Path) -> None:
    from flows.serving.registered import run_and_report
    from flows.stories.scenario_sweep import sweep_of

    def reported(request: RunRequest) -> RunOutcome:
        return run_and_report(request, "scenario_sweep", lambda: sweep_of(request))

    overrides = (*SMALLER[1::2], 'sweep.blocks={low=["low"]}', "sweep.variants={none={}}")
    done = reported(RunRequest(field, tmp_path / "flow", overrides))
    assert (done.error, done.summary.status) == (None, "done")
    state = latest_run("scenario-sweep").state
    assert state is not None
    assert (state.type.value, state.name) == ("COMPLETED", "Completed")
    flow, plain = results(tmp_path / "flow"), results(swept)
    assert list(flow.index) == ["low|84/0|none", "low|5/79|none"]
    figures = flow.columns.difference(["number"])
    pd.testing.assert_frame_equal(flow[figures], plain.loc[flow.index, figures], check_exact=True)
    again = reported(RunRequest(field, tmp_path / "flow", overrides))
    assert again.error is None
    assert len((again.summary.model_extra or {})["sweep"]) == 2
    wrong = RunRequest(field, tmp_path / "wrong", ("sweep.blocks.low.flights=[]",))
    assert reported(wrong).summary.status == "input_error"


def test_the_maps_show_the_errors_that_the_parameters_of_a_variant_stand_for(
    field: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    chosen = ("--set", 'sweep.blocks={both=["low", "high"]}', "--set", 'sweep.control={all="all"}')
    chosen += ("--set", "sweep.variants={none={}}", "--set", 'sweep.parameters=["bluh:9"]')
    assert sweep(field, out, *chosen, "--set", "adjustment.self_calibration.elimination=none").returncode == 0
    text = (out / "sweep.html").read_text()
    of_page = re.findall(r"bluh:9: RMS (\d+\.\d+) µm", text)
    assert len(of_page) == 1
    (adjusted,) = [
        table
        for path in (out / ".store" / "bundle_adjustment").glob("*/parameters.parquet")
        for table in [pd.read_parquet(path)]
        if (table["parameter"] == "bluh:9").any()
    ]
    value = adjusted.set_index("parameter").loc["bluh:9", "value"]
    # BLUH 9 displaces the image by P x (r² − 128²) in millimetres of a format with the corner at 162.6.
    cells = pd.read_parquet(next((out / ".store" / "bundle_adjustment").glob("*/residual_grid.parquet")))
    scale = 162.6 / np.hypot(6540 * 0.0052, 10005 * 0.0052)
    x, y = scale * cells["x_mm"], scale * cells["y_mm"]
    error_mm = value * np.hypot(x, y) * (x**2 + y**2 - 128.0**2) / scale
    assert float(of_page[0]) == pytest.approx(1e3 * np.sqrt(np.mean(error_mm**2)), abs=0.006)
    # None is cut at the edge of its drawing.
    ends = ends_of_arrows(text)
    assert len(ends) > 300
    assert all(0.0 <= part <= 1.0 for place in ends for part in place)
    table = results(out)
    assert table["parameters_kept"].tolist() == [1, 0]
    page = Page(text)
    cell = page.tables["residuals-0"].numbers["both|all|none", "cells_significant"]
    assert float(cell.data) == table.loc["both|all|none", "cells_significant"]
