"""A run as people start and follow it: form, run, artifacts, report and production page in a real browser.

The pages of `aerocal serve` are opened in Chromium, which finds no other host than this machine. Pictures of
what was seen go to the folder that AEROCAL_SCREENSHOTS names.
"""

from __future__ import annotations

import contextlib
import csv
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from tests.flows.conftest import write_block
from tests.service.served import Served, served, until

pytestmark = [pytest.mark.service, pytest.mark.timeout(900)]

#: Longest wait for anything to be seen; the machine may be busy, ms.
PATIENCE_MS = 60_000
RUN_MS = 240_000
MANUAL = "aerial-triangulation/manual"
#: The name of a folder, and so of a project, that would act if any page took it for more than a text.
HOSTILE = '<img src=x onerror="window.attacked=1">[a](javascript:window.attacked=1)'


@dataclass
class Seen:
    """A page in the browser and what it complained about."""

    page: Page
    complaints: list[str]

    def keep(self, name: str) -> None:
        """A picture of what is seen now, where somebody has asked for it: it takes a while."""
        if folder := os.environ.get("AEROCAL_SCREENSHOTS"):
            self.page.screenshot(path=Path(folder) / f"{name}.png", full_page=True)

    def row(self, project: str) -> Locator:
        """The row of a project in the part of the grid that scrolls."""
        number = self.page.locator(".ag-pinned-left-cols-container .ag-row").filter(has_text=project)
        return self.page.locator(
            f".ag-center-cols-container .ag-row[row-id='{number.get_attribute('row-id')}']"
        )

    def projects(self) -> list[str]:
        """The projects from top to bottom."""
        # Read at once: rows come and go while the grid filters.
        rows = self.page.locator(".ag-pinned-left-cols-container .ag-row").evaluate_all(
            "rows => rows.map(row => [Number(row.getAttribute('row-index')), "
            "row.querySelector('[col-id=project]').innerText])"
        )
        return [project for _, project in sorted(rows)]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("browser")
    for name in ("block", HOSTILE):
        write_block(folder / "root" / name)
        control = folder / "root" / name / "control.csv"
        lines = control.read_text().splitlines()
        # Every second surveyed point becomes a check point.
        checked = [line.replace(",control", ",check") if at % 2 else line for at, line in enumerate(lines)]
        control.write_text("\n".join(checked) + "\n")
    with served(folder, "--cron", "30 1 * * *") as running:
        yield running


@pytest.fixture(scope="module")
def produced(server: Served) -> Served:
    """The server after a run that has passed, and one that has missed a gate."""
    for project, settings, state in (
        ("block", {}, "Completed"),
        (HOSTILE, {"sigma0_limit": 0.71}, "GateFailed"),
    ):
        run = server.start(MANUAL, {"project": project, "settings": settings})
        assert server.ended(run, 240)["state_name"] == state
    return server


@pytest.fixture
def seen(server: Served, browser: Browser) -> Iterator[Seen]:
    context = browser.new_context(viewport={"width": 1500, "height": 1000})
    door = context.new_page()
    server.let_in(door)
    door.close()
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    expect.set_options(timeout=PATIENCE_MS)
    seen = Seen(page, [])
    page.on("pageerror", lambda error: seen.complaints.append(str(error)))
    page.on("console", lambda said: seen.complaints.append(said.text) if said.type == "error" else None)
    yield seen
    context.close()


def test_a_run_is_started_with_the_form_and_followed_to_its_report(server: Served, seen: Seen) -> None:
    page, before = seen.page, _runs(server)
    page.goto(f"http://127.0.0.1:{server.port}/")
    page.get_by_role("link", name="Deployments").first.click()
    manual = page.get_by_role("row").filter(has_text="aerial-triangulation").filter(has_text="manual")
    manual.first.get_by_role("link", name="manual").click()
    page.get_by_role("button", name="Run", exact=True).click()
    page.get_by_role("menuitem", name="Custom run").click()

    page.get_by_label("project").fill("block")
    page.get_by_label("output").fill("../out")
    page.get_by_role("button", name="Submit").click()
    wrong = page.get_by_text(re.compile(r"^'\.\./out' does not match"))
    expect(page.get_by_text("Validation failed for field 'output'")).to_be_visible()
    expect(wrong).to_be_visible()
    seen.keep("1-form-refuses")
    assert _runs(server) == before

    page.get_by_label("output").fill("results")
    until(lambda: _submitted(server, page, before), 90)
    page.get_by_role("link", name="View run").first.click()
    page.wait_for_url("**/runs/flow-run/**")
    expect(page.get_by_text(re.compile("^(Scheduled|Late|Pending|Running|Completed)$")).first).to_be_visible()
    seen.keep("2-run-begins")
    expect(page.get_by_text("Completed", exact=True).first).to_be_visible(timeout=RUN_MS)
    expect(page.get_by_text("block · aerial-triangulation · Completed").first).to_be_visible()
    seen.keep("3-run-ended")

    page.get_by_role("tab", name="Artifacts").click()
    seen.keep("4-artifacts")
    _open_artifact(page, "verdict")
    expect(page.get_by_text("Completed: Results are in").first).to_be_visible()
    expect(page.get_by_role("link", name="Production page").first).to_be_visible()
    seen.keep("5-verdict")

    link = page.get_by_role("link", name="Report").first
    address = str(link.get_attribute("href"))
    assert address.startswith(f"http://127.0.0.1:{server.overview}/results/")
    page.goto(address)
    expect(page.get_by_text("Problems and remarks").first).to_be_visible()
    assert page.locator("svg").count() >= 3
    seen.keep("6-report")


def _open_artifact(page: Page, name: str) -> None:
    """From the list of artifacts over all that have this key to the one itself."""
    page.get_by_text(re.compile(f"aerial-triangulation-{name}$")).first.click()
    page.wait_for_url("**/artifacts/key/**")
    page.locator("a[href*='/artifacts/artifact/']").first.click()
    page.wait_for_url("**/artifacts/artifact/**")


def _runs(server: Served) -> set[str]:
    return {run["id"] for run in server.runs(flows={"name": {"any_": ["aerial-triangulation"]}})}


def _submitted(server: Served, page: Page, before: set[str]) -> bool:
    """Submit the form until there is a new run: it takes over a moment later what was typed."""
    if _runs(server) != before:
        return True
    page.get_by_role("button", name="Submit").click()
    with contextlib.suppress(AssertionError):
        until(lambda: _runs(server) != before, 8)
    return _runs(server) != before


def test_the_production_page_shows_sorts_and_filters_every_project(produced: Served, seen: Seen) -> None:
    server, page = produced, seen.page
    page.goto(f"http://127.0.0.1:{server.overview}/")
    failed = page.locator(".ag-pinned-left-cols-container .ag-row").filter(has_text="GateFailed")
    expect(failed).to_have_count(1)
    refused = server.start(MANUAL, {"project": "../nowhere"})
    assert server.ended(refused, 240)["state_name"] == "InputError"

    # The page has looked again by itself.
    expect(page.locator(".ag-pinned-left-cols-container .ag-row")).to_have_count(3)
    expect(failed).to_contain_text(HOSTILE)
    expect(seen.row("block").locator(".stage-done, .stage-reused")).to_have_count(7)
    expect(seen.row(HOSTILE).locator("[col-id=gates]")).to_contain_text("sigma0")
    expect(seen.row(HOSTILE).locator("[col-id=sigma0]")).to_have_class(re.compile("beyond"))
    expect(seen.row("../nowhere").locator("[col-id=problem]")).to_contain_text("There is no project file")
    expect(page.locator(".card.passed b")).to_have_text("1")
    expect(page.locator(".card.gate b").first).to_have_text("1")
    expect(page.locator(".card.input b")).to_have_text("1")
    expect(page.locator("#said")).to_contain_text("server answers")
    expect(page.locator("#sigma0-trend .points path").last).to_be_visible()
    expect(page.locator("#failures")).to_contain_text("There is no project file '../nowhere'")
    expect(page.locator("#queue")).to_contain_text("Next by schedule")
    seen.keep("8-production")

    _sorts_and_filters(seen)
    _tells_of_one_project(seen)
    assert page.evaluate("window.attacked") is None
    for link in page.locator("a").all():
        assert (link.get_attribute("href") or "").startswith(("http://127.0.0.1:", "/results/", "#"))
    assert seen.complaints == []


def _sorts_and_filters(seen: Seen) -> None:
    page = seen.page
    page.locator(".ag-header-cell[col-id=project] .ag-header-cell-text").click()
    until(lambda: seen.projects() == sorted(seen.projects(), key=str.lower), 30)
    up = seen.projects()
    page.locator(".ag-header-cell[col-id=project] .ag-header-cell-text").click()
    until(lambda: seen.projects() == up[::-1], 30)

    page.locator("#search").fill("nowhere")
    until(lambda: seen.projects() == ["../nowhere"], 30)
    page.locator("#search").fill("")
    until(lambda: seen.projects() == up[::-1], 30)
    page.locator(".card.gate").first.click()
    until(lambda: seen.projects() == [HOSTILE], 30)
    # It stays so when the page looks again.
    before = page.locator("#said").inner_text()
    expect(page.locator("#said")).not_to_have_text(before)
    assert seen.projects() == [HOSTILE]
    page.locator(".card.gate").first.click()
    until(lambda: seen.projects() == up[::-1], 30)

    with page.expect_download() as download:
        page.get_by_role("button", name="Export CSV").click()
    rows = list(csv.reader(Path(download.value.path()).read_text(encoding="utf-8").splitlines()))
    assert {row[rows[0].index("State")] for row in rows[1:]} == {"Completed", "GateFailed", "InputError"}


def _tells_of_one_project(seen: Seen) -> None:
    page = seen.page
    page.locator(".ag-pinned-left-cols-container .ag-row").filter(has_text="GateFailed").locator(
        "[col-id=project]"
    ).click()
    expect(page.locator("#detail")).to_contain_text("Gates")
    expect(page.locator("#detail")).to_contain_text("not passed")
    seen.keep("9-one-project")
    with page.expect_popup() as opened:
        seen.row(HOSTILE).get_by_role("link", name="report").click()
    report = opened.value
    expect(report.get_by_text("Problems and remarks").first).to_be_visible()
    assert report.evaluate("window.attacked") is None
    report.close()
    with page.expect_popup() as opened:
        seen.row(HOSTILE).get_by_role("link", name="run", exact=True).click()
    expect(opened.value.get_by_text("GateFailed", exact=True).first).to_be_visible()
    assert opened.value.evaluate("window.attacked") is None
    opened.value.close()


def test_the_production_page_fits_a_small_window(produced: Served, seen: Seen) -> None:
    seen.page.set_viewport_size({"width": 700, "height": 1000})
    seen.page.goto(f"http://127.0.0.1:{produced.overview}/")
    expect(seen.page.locator(".ag-row").first).to_be_visible()
    expect(seen.page.locator("#sigma0-trend .points path").last).to_be_visible()
    assert seen.page.evaluate("document.documentElement.scrollWidth") <= 700
    seen.keep("10-small")
