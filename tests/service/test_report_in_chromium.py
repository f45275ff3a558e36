"""The report in a real browser: it renders without network, on screen and on paper."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Browser

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.direct_georeferencing_check import direct_georeferencing_check
from flows.stories.flight_check import flight_check
from tasks.settings.load_simulation import load_simulation
from tests.chromium import complaints

pytestmark = pytest.mark.service


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


def test_the_page_is_complete_without_network_and_without_scripts(browser: Browser, report: Path) -> None:
    page = browser.new_page()
    said = complaints(page)
    page.goto(report.as_uri())
    shown = page.content()
    assert shown.count("<svg") == report.read_text(encoding="utf-8").count("<svg") >= 3
    assert "Problems and remarks" in shown
    assert said == []
    page.close()


@pytest.mark.parametrize("width", [1280, 500])
def test_nothing_is_wider_than_the_window(browser: Browser, report: Path, width: int) -> None:
    page = browser.new_page(viewport={"width": width, "height": 900})
    page.goto(report.as_uri())
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.close()


def test_screen_and_paper_are_not_empty(browser: Browser, report: Path) -> None:
    page = browser.new_page(viewport={"width": 1280, "height": 4000})
    page.goto(report.as_uri())
    assert len(page.screenshot()) > 100_000
    paper = page.pdf(display_header_footer=True)
    assert paper.startswith(b"%PDF")
    assert len(paper) > 100_000
    page.close()
