"""The report in headless Chromium: what the first screen shows, that nothing is clipped, and its lists."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from playwright.sync_api import Browser

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.chromium import complaints

pytestmark = [pytest.mark.service, pytest.mark.timeout(300)]
TOO_WIDE = """() => [...document.querySelectorAll("table")]
  .filter(table => table.offsetWidth > table.parentElement.clientWidth + 1)
  .filter(table => getComputedStyle(table.parentElement).overflowX !== "auto")
  .map(table => table.id)"""

#: Words of axes that lie over numbers of the same axis.
OVER_NUMBERS = """() => [...document.querySelectorAll("svg .axis .label")].flatMap(label => {
  const a = label.getBoundingClientRect();
  return [...label.parentElement.querySelectorAll("text:not(.label)")].filter(text => {
    const b = text.getBoundingClientRect();
    return Math.min(a.right, b.right) - Math.max(a.left, b.left) > 3
      && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 5;
  }).map(text => `${label.textContent} over ${text.textContent}`);
})"""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """60 images with a control point that is wrong by 1.5 m."""
    folder = tmp_path_factory.mktemp("flight")
    project = simulate_project(load_simulation("dmc-20cm", ("points.count=300",), 4), folder).project_file
    control = pd.read_csv(folder / "control.csv", dtype={"point": str})
    control.loc[6, "z"] -= 1.5
    control.to_csv(folder / "control.csv", index=False)
    found = carry_out(aerial_triangulation, RunRequest(project, folder / "results"))
    assert found.error is None, found.error
    return found.directory


def test_a_wide_table_of_additional_parameters_scrolls_by_itself(browser: Browser, tmp_path: Path) -> None:
    changes = ("points.count=200",)
    project = simulate_project(load_simulation("dmc-20cm", changes, 4), tmp_path).project_file
    settings = "adjustment.self_calibration"
    chosen = (f'{settings}.parameters="bluh:1-12"', f'{settings}.elimination="none"')
    found = carry_out(aerial_triangulation, RunRequest(project, overrides=chosen))
    assert found.error is None, found.error
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto((found.directory / "report.html").as_uri())
    assert page.locator("#self-calibration").count() == 1
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280
    assert page.evaluate(TOO_WIDE) == []
    page.close()


def test_the_first_screen_names_the_point(browser: Browser, results: Path) -> None:
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto((results / "report.html").as_uri())
    cause = page.locator(".causes li").first
    box = cause.bounding_box()
    point = pd.read_csv(results.parent / "control.csv", dtype={"point": str})["point"][6]
    assert cause.inner_text().startswith(f"Look at control point {point}.")
    assert box is not None
    assert box["y"] + box["height"] < 400
    page.close()


@pytest.mark.parametrize("width", [500, 1280, 1920])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_no_table_is_clipped_and_the_page_does_not_scroll_sideways(
    browser: Browser, results: Path, width: int, scheme: str
) -> None:
    page = browser.new_page(viewport={"width": width, "height": 800}, color_scheme=scheme)  # type: ignore[arg-type]
    said = complaints(page)
    page.goto((results / "report.html").as_uri())
    assert said == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate(TOO_WIDE) == []
    assert page.evaluate(OVER_NUMBERS) == []
    dark = page.evaluate("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"
    assert dark is (scheme == "dark")
    page.close()


@pytest.mark.parametrize(("size", "digits"), [((), 4), (("flight.0.height_m=600",), 6)])
def test_words_of_a_map_lie_over_none_of_its_long_numbers_on_a_narrow_screen(
    browser: Browser, tmp_path: Path, size: tuple[str, ...], digits: int
) -> None:
    place = ("project.crs=EPSG:25832", "project.latitude_deg=48", "project.longitude_deg=9.3")
    simulation = load_simulation("dmc-burn-in", ("points.count=200", *place, *size))
    found = carry_out(aerial_triangulation, RunRequest(simulate_project(simulation, tmp_path).project_file))
    assert found.error is None, found.error
    page = browser.new_page(viewport={"width": 500, "height": 800})
    page.goto((found.directory / "report.html").as_uri())
    upwards = page.locator("#figure-block .axis").last
    assert {len(text) for text in upwards.locator("text:not(.label)").all_text_contents()} == {digits}
    assert [words for words in page.evaluate(OVER_NUMBERS) if "[km]" in words] == []
    box = upwards.locator(".label").bounding_box()
    assert box is not None
    assert box["x"] >= 0.0
    assert page.evaluate("document.documentElement.scrollWidth") <= 500
    page.close()


def test_the_settings_are_folded_and_not_printed(browser: Browser, results: Path) -> None:
    page = browser.new_page()
    page.goto((results / "report.html").as_uri())
    settings = page.locator("#settings")
    assert not settings.is_visible()
    page.locator("details.settings summary").click()
    assert settings.is_visible()
    page.emulate_media(media="print")
    assert not settings.is_visible()
    assert not page.locator("#orientation-list").is_visible()
    assert page.locator("#key-figures").is_visible()
    page.close()


def test_orientations_are_searched_ordered_and_saved(browser: Browser, results: Path, tmp_path: Path) -> None:
    page = browser.new_page(viewport={"width": 1280, "height": 800}, accept_downloads=True)
    page.goto((results / "report.html").as_uri())
    images = pd.read_parquet(results / "exterior_orientations.parquet")
    table, tools = page.locator("#orientation-list"), page.locator("#orientations .tools")
    assert tools.inner_text().endswith(f"{len(images)} of {len(images)} rows")
    table.locator("thead th", has_text="height").first.click()
    heights = table.locator('td[data-column="z_m"]').evaluate_all("all => all.map(c => +c.dataset.value)")
    assert heights == sorted(images["z_m"])
    chosen = str(images["image"][7])
    tools.locator("input").fill(chosen)
    assert table.locator("tbody tr:visible").count() == 1
    with page.expect_download() as download:
        tools.locator("button").click()
    assert download.value.suggested_filename == "orientation-list.csv"
    download.value.save_as(tmp_path / "list.csv")
    saved = pd.read_csv(tmp_path / "list.csv", dtype={"image": str})
    assert saved["image"].tolist() == [chosen]
    assert saved["east m"][0] == images["x_m"][7]
    page.close()
