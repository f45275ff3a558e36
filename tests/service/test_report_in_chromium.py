"""The report in a real browser: it renders without network, on screen and on paper."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.direct_georeferencing_check import direct_georeferencing_check
from flows.stories.flight_check import flight_check
from tasks.settings.load_simulation import load_simulation

pytestmark = pytest.mark.service

# Without these Chromium asks its maker's servers at every start.
QUIET = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--hide-scrollbars",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--host-resolver-rules=MAP * ~NOTFOUND",
)  # fmt: skip


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("flight")
    flight_check(load_simulation("uce-high", ("points.count=600",)), folder)
    overrides = ("direct_georeferencing.calibration=adjustment",)
    carry_out(direct_georeferencing_check, RunRequest(folder / "project.toml", overrides=overrides))
    return folder / "results"


@pytest.fixture(params=["report.html", "georeferencing_check.html"])
def report(results: Path, request: pytest.FixtureRequest) -> Path:
    return results / str(request.param)


def chromium(page: Path, profile: Path, *options: str) -> subprocess.CompletedProcess[str]:
    program = shutil.which("chromium")
    assert program is not None, "Chromium is missing: make service-deps installs it"
    command = [program, *QUIET, f"--user-data-dir={profile}", *options, page.as_uri()]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)


def test_the_page_is_complete_without_network_and_without_scripts(report: Path, tmp_path: Path) -> None:
    shown = chromium(report, tmp_path / "profile", "--enable-logging=stderr", "--dump-dom")
    assert shown.stdout.count("<svg") == report.read_text(encoding="utf-8").count("<svg") >= 3
    assert "Problems and remarks" in shown.stdout
    assert "CONSOLE" not in shown.stderr


@pytest.mark.parametrize("width", [1280, 500])
def test_nothing_is_wider_than_the_window(report: Path, tmp_path: Path, width: int) -> None:
    """A script beside the report measures it in a frame of the given width."""
    ruler = tmp_path / "ruler.html"
    ruler.write_text(
        f'<iframe id="f" style="width:{width}px;height:900px;border:0"></iframe><p id="w"></p><script>'
        "const f = document.getElementById('f'); f.srcdoc = REPORT; f.onload = () => "
        "{ const wide = f.contentDocument.documentElement.scrollWidth; "
        "document.getElementById('w').textContent = 'wide=' + wide; }"
        "</script>".replace("REPORT", javascript_text(report.read_text(encoding="utf-8"))),
        encoding="utf-8",
    )
    shown = chromium(ruler, tmp_path / "profile", "--virtual-time-budget=5000", "--dump-dom")
    measured = int(shown.stdout.split("wide=")[1].split("<")[0])
    assert measured <= width


def javascript_text(text: str) -> str:
    return json.dumps(text).replace("</", "<\\/")


def test_screen_and_paper_are_not_empty(report: Path, tmp_path: Path) -> None:
    picture, paper = tmp_path / "report.png", tmp_path / "report.pdf"
    chromium(report, tmp_path / "profile", "--window-size=1280,4000", f"--screenshot={picture}")
    chromium(report, tmp_path / "profile", f"--print-to-pdf={paper}")
    assert picture.stat().st_size > 100_000
    assert paper.read_bytes().startswith(b"%PDF")
    assert paper.stat().st_size > 100_000
