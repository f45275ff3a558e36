"""The command line as its users meet it: exit codes, one-line errors, JSON, help."""

from __future__ import annotations

import ctypes
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, get_type_hints

import pandas as pd
import pytest
import typer
from typer.main import get_command

from flows.command.main import app
from tasks.results.publish import OF_EVERY_ADJUSTMENT
from tests.command_line import aerocal
from tests.flows.refused_at_start import require_refused_at_start


def one_line_error(done: subprocess.CompletedProcess[str]) -> str:
    """The error on stderr; there must be exactly one and no traceback."""
    assert "Traceback" not in done.stderr, done.stderr
    errors = [line for line in done.stderr.splitlines() if line.startswith("Error: ")]
    assert len(errors) == 1, done.stderr
    return errors[0]


def summary(out: Path) -> dict[str, object]:
    content = json.loads((out / "summary.json").read_text())
    assert isinstance(content, dict)
    return content


def test_help_teaches() -> None:
    done = aerocal("--help")
    assert done.returncode == 0
    for word in ("run", "adjust", "doctor", "Exit codes", "130 interrupted"):
        assert word in done.stdout
    details = aerocal("run", "--help").stdout
    for word in ("--out", "--set", "--data", "--server", "--json", "aerocal run project.toml"):
        assert word in details


def test_on_80_columns_no_help_cuts_a_word_or_breaks_the_choices_of_an_option() -> None:
    """Rich ends a word that is too long for its column with an ellipsis, and breaks what is typed."""
    for words in _names(get_command(app)):
        narrow, wide = (aerocal(*words, "--help", COLUMNS=width).stdout for width in ("80", "300"))
        cut = {text for text in re.findall(r"\S+…", narrow) if text not in wide}
        broken = re.findall(r"<[^<>]*\|[^<>]*\n[^<>]*>", narrow)
        assert (words, cut, broken) == (words, set(), [])


def _names(command: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The words of every command, and of every group of commands."""
    yield words
    for name, below in getattr(command, "commands", {}).items():
        yield from _names(below, (*words, name))


def test_no_help_takes_a_table_of_the_project_file_for_a_style() -> None:
    """Rich drops ``[calibration]`` as a style of that name; written with a backslash it is text."""
    texts = [text for command in _commands(app) for text in _texts(command)]
    assert len(texts) > 100
    unknown = {tag for text in texts for tag in re.findall(r"(?<!\\)\[(/?[a-z_]+)\]", text)}
    assert unknown <= {"bold", "/bold"}
    assert "A project file with a table [calibration] runs" in aerocal("run", "--help").stdout


def _commands(group: typer.Typer) -> Iterator[Any]:
    for one in group.registered_commands:
        yield one.callback
    for below in group.registered_groups:
        yield from _commands(below.typer_instance)


def _texts(command: Any) -> Iterator[str]:
    yield command.__doc__ or ""
    for annotation in get_type_hints(command, include_extras=True).values():
        for item in getattr(annotation, "__metadata__", ()):
            yield getattr(item, "help", None) or ""


def test_a_block_is_adjusted_shown_and_published(block: Path) -> None:
    done = aerocal("run", block)
    assert done.returncode == 0, done.stderr
    for word in ("σ0", "redundancy", "boresight_roll", "Gates", "passed", str(block.parent / "results")):
        assert word in done.stdout
    content = summary(block.parent / "results")
    assert content["status"] == "done"
    sigma0 = content["sigma0"]
    assert isinstance(sigma0, float)
    assert 0.9 < sigma0 < 1.1
    assert content["counts"]["images"] == 8  # type: ignore[index]


def test_json_is_the_summary_and_nothing_else_on_standard_output(warm_block: Path) -> None:
    done = aerocal("adjust", warm_block, "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == summary(warm_block.parent / "results")


def test_a_failed_gate_ends_with_4_and_keeps_the_outputs(warm_block: Path) -> None:
    done = aerocal("run", warm_block, "--set", "gates.sigma0.max=0.71")
    assert done.returncode == 4, done.stderr
    assert "failed" in done.stdout
    assert summary(warm_block.parent / "results")["status"] == "gate_failed"
    assert (warm_block.parent / "results" / "object_points.parquet").is_file()


def test_a_gate_missed_by_little_is_shown_with_the_digits_that_tell(warm_block: Path) -> None:
    sigma0 = float(summary(warm_block.parent / "results")["sigma0"])  # type: ignore[arg-type]
    limit = round(sigma0 - 1e-5, 6)
    done = aerocal("run", warm_block, "--set", f"gates.sigma0.max={limit}")
    assert done.returncode == 4, done.stderr
    (line,) = (line.split() for line in done.stdout.splitlines() if "sigma0" in line and "≤" in line)
    shown = [float(word) for word in line if word.replace(".", "").isdigit()]
    assert shown[1] == limit
    assert shown[0] > limit
    assert shown[0] == pytest.approx(sigma0, abs=1e-5)


def test_an_unknown_key_ends_with_2_and_names_the_nearest(block: Path) -> None:
    done = aerocal("run", block, "--set", "adjustment.rejektion=none")
    assert done.returncode == 2
    assert "Did you mean 'rejection'?" in one_line_error(done)
    assert summary(block.parent / "results")["status"] == "input_error"


def test_json_is_printed_for_an_input_error_too(block: Path) -> None:
    (block.parent / "image_points.csv").write_text("")
    done = aerocal("run", block, "--json")
    assert done.returncode == 2
    assert json.loads(done.stdout)["status"] == "input_error"
    assert "image_points.csv" in one_line_error(done)


def test_a_block_without_a_datum_ends_with_3(block: Path) -> None:
    text = block.read_text().replace('free = ["boresight"]', 'free = ["boresight", "gnss_shift"]')
    start, end = text.index("[inputs.control]"), text.index("[adjustment]")
    block.write_text(text[:start] + text[end:])
    done = aerocal("run", block)
    assert done.returncode == 3, done.stdout + done.stderr
    assert "gnss_shift" in one_line_error(done)
    assert summary(block.parent / "results")["status"] == "not_computable"


@pytest.mark.parametrize("command", ["run", "sweep", "doctor"])
@pytest.mark.parametrize("below", ["", "further/down"])
def test_an_output_folder_that_is_a_file_ends_with_2(
    block: Path, tmp_path: Path, command: str, below: str
) -> None:
    (tmp_path / "taken").write_text("")
    done = aerocal(command, block, "--out", tmp_path / "taken" / below)
    assert done.returncode == 2
    assert f"{tmp_path / 'taken'}: This is a file, not a folder." in one_line_error(done)
    assert (tmp_path / "taken").read_text() == ""


@pytest.mark.parametrize(
    "words",
    [
        ("run", "PRIVATE/project.toml"), ("sweep", "PRIVATE/project.toml"),
        ("doctor", "PRIVATE/project.toml"),
        ("plan", "PRIVATE/plan.toml"), ("convert", "PRIVATE/project.toml", "--to", "colmap"),
        ("run", "BLOCK", "--out", "PRIVATE"), ("run", "BLOCK", "--out", "PRIVATE/further/down"),
        ("image-quality", "PRIVATE/a.tif"), ("undistort", "PRIVATE/results", "a.tif"),
        ("export", "PRIVATE/results", "--to", "patb"), ("figures", "PRIVATE/results"),
        ("registry", "add", "PRIVATE/results", "--registry", "PRIVATE/r.sqlite"),
    ],
    ids=" ".join,
)  # fmt: skip
def test_a_folder_that_may_not_be_entered_is_one_sentence(
    words: tuple[str, ...], block: Path, tmp_path: Path
) -> None:
    private = tmp_path / "private"
    private.mkdir(mode=0)
    places = {"BLOCK": str(block), "PRIVATE": str(private)}
    with permissions_of_an_ordinary_user():
        done = aerocal(*(re.sub("BLOCK|PRIVATE", lambda found: places[found[0]], word) for word in words))
    assert done.returncode in (1, 2)
    assert f"{private}" in one_line_error(done)
    assert "ermission denied" in done.stderr


@contextmanager
def permissions_of_an_ordinary_user() -> Iterator[None]:
    """Without the capabilities (capabilities(7)) by which permissions do not hold for root."""
    libc, header, sets = ctypes.CDLL(None), (ctypes.c_uint32 * 2)(0x20080522), (ctypes.c_uint32 * 6)()
    assert libc.capget(header, sets) == 0
    effective = sets[0]
    try:
        sets[0] &= ~0b110
        assert libc.capset(header, sets) == 0
        yield
    finally:
        sets[0] = effective
        assert libc.capset(header, sets) == 0


@pytest.mark.parametrize("folder", ["s3://bucket/block", ""])
@pytest.mark.parametrize(
    "words",
    [
        ("export", "results", "--to", "patb", "--out"), ("convert", "project.toml", "--to", "patb", "--out"),
        ("figures", "results", "--out"), ("undistort", "results", "a.tif", "--out"),
        ("simulate", "uce-low", "--out"), ("flight-check", "uce-low", "--out"),
        ("image-quality", "a.tif", "--out"), ("fetch", "s3://bucket/block", "--to"),
    ],
    ids=lambda words: words[0],
)  # fmt: skip
def test_a_folder_of_this_machine_is_no_address_and_not_blank(
    words: tuple[str, ...], folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = aerocal(*words, folder)
    assert done.returncode == 2, done.stderr
    assert ("is an address" if folder else "The name is blank") in done.stderr
    assert not list(tmp_path.iterdir())


def test_results_between_delivered_files_get_a_remark_and_replace_none(warm_block: Path) -> None:
    folder = warm_block.parent
    shutil.copytree(folder / "results" / ".store", folder / ".store")
    done = aerocal("run", warm_block, "--out", folder)
    assert done.returncode == 0, done.stderr
    remark = "is one of the delivery (control.csv, exposures.csv, image_points.csv, …)"
    assert remark in done.stderr
    assert remark not in aerocal("run", warm_block).stderr
    # The name of a table of results, which not every run has.
    points = folder / "neighbouring_images.parquet"
    points.unlink()
    (folder / "control.csv").rename(points)
    delivered = points.read_bytes()
    warm_block.write_text(warm_block.read_text().replace('"control.csv"', '"neighbouring_images.parquet"'))
    done = aerocal("run", warm_block, "--out", folder)
    assert done.returncode == 2, done.stderr
    assert f"{points}: This is a delivered file, which the results would replace." in one_line_error(done)
    assert points.read_bytes() == delivered


@pytest.mark.parametrize("name", ["report.html", "summary.json", "manifest.json"])
def test_a_file_of_somebody_else_is_not_replaced_by_results(warm_block: Path, name: str) -> None:
    results = warm_block.parent / "results"
    (results / name).unlink(missing_ok=True)
    (results / name).write_text("mine")
    before = {path.name: path.read_bytes() for path in results.iterdir() if path.is_file()}
    done = aerocal("run", warm_block)
    assert done.returncode == 2, done.stderr
    assert f"{results / name}: The file would be replaced" in one_line_error(done)
    after = {path.name: path.read_bytes() for path in results.iterdir() if path.is_file()}
    told = {"summary.json"} if name == "report.html" else set()
    assert {key: value for key, value in after.items() if key not in told} == {
        key: value for key, value in before.items() if key not in told
    }


def test_an_edited_report_is_refused_before_anything_is_computed(warm_block: Path) -> None:
    results = warm_block.parent / "results"
    require_refused_at_start(
        results, "report.html", OF_EVERY_ADJUSTMENT, lambda: aerocal("run", warm_block, "--set", "gates={}")
    )


def test_an_edited_file_that_a_run_does_not_publish_again_stays(warm_block: Path) -> None:
    assert aerocal("run", warm_block, "--set", "trust_map={}").returncode == 0
    edited = warm_block.parent / "results" / "trust_map_cells.parquet"
    edited.unlink()
    edited.write_text("mine")
    done = aerocal("run", warm_block)
    assert done.returncode == 0, done.stderr
    assert edited.read_text() == "mine"


@pytest.mark.parametrize("address", ["http://127.0.0.1:9/api", "nonsense"])
def test_a_server_that_does_not_answer_ends_with_1_and_the_remedy(block: Path, address: str) -> None:
    done = aerocal("run", block, "--server", address)
    assert done.returncode == 1
    assert "--server none" in one_line_error(done)


def test_server_none_runs_in_process_whatever_is_set(warm_block: Path) -> None:
    done = aerocal("run", warm_block, "--server", "none", PREFECT_API_URL="http://127.0.0.1:9/api")
    assert done.returncode == 0, done.stderr


def test_a_run_in_process_never_imports_prefect(warm_block: Path) -> None:
    # That stages do not need it either: test_extras.py adjusts a block without it.
    program = (
        "import sys; from flows.command.__main__ import main\n"
        f"sys.argv = ['aerocal', 'run', {str(warm_block)!r}]\n"
        "try: main()\n"
        "except SystemExit as end: assert end.code == 0, end.code\n"
        "sys.exit(any(name.split('.')[0] == 'prefect' for name in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_an_unknown_option_ends_with_2(block: Path) -> None:
    assert aerocal("run", block, "--frobnicate").returncode == 2


def test_the_doctor_reads_and_publishes_nothing(block: Path) -> None:
    before = sorted(path.name for path in block.parent.iterdir())
    done = aerocal("doctor", block)
    assert done.returncode == 0, done.stderr
    assert "The project can be read" in done.stdout
    points = pd.read_csv(block.parent / "control.csv", dtype=str)["point"]
    # A line for each control point, or as few as are worth reading.
    shown = done.stdout.partition("Control points: intersected")[2].split()
    assert sum(point in shown for point in points) == min(len(points), 5)
    assert sorted(path.name for path in block.parent.iterdir()) == before
    assert set(json.loads(aerocal("doctor", block, "--json").stdout)) == {
        "exposures and cameras",
        "image points",
        "control",
        "approximate values",
        "mistakes",
    }


def test_the_doctor_shows_what_was_not_surveyed_of_a_point_as_a_dash(block: Path) -> None:
    control = pd.read_csv(block.parent / "control.csv", dtype=str)
    name = str(control.loc[0, "point"])
    control.loc[0, ["x", "y"]] = ""
    control.to_csv(block.parent / "control.csv", index=False)
    done = aerocal("doctor", block)
    assert done.returncode == 0, done.stderr
    shown = done.stdout.partition("Control points: intersected")[2].splitlines()
    (line,) = (row for row in shown if row.startswith(f"{name} "))
    assert line.split()[2:4] == ["–", "–"]


def test_the_doctor_ends_with_2_on_wrong_input(block: Path) -> None:
    with (block.parent / "image_points.csv").open("a") as stream:
        stream.write("1_0011,p1,10,10\n")
    done = aerocal("doctor", block)
    assert done.returncode == 2
    assert "1_001" in one_line_error(done)
