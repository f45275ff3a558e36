"""The production page in a real browser, whose clock may differ from the server's."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta, tzinfo

import pytest
from playwright.sync_api import Browser, Page, expect

from flows.overview.application import page_server
from flows.overview.sources import Sources
from flows.server.door import basic
from tasks.production.records import Records
from tests.flows.overview.conftest import DOOR
from tests.ports import free_port
from tests.tasks.production.runs import ended, run, stages

pytestmark = pytest.mark.service


def _ticks(page: Page) -> None:
    page.clock.fast_forward(11_000)
    page.wait_for_timeout(1_500)


@pytest.mark.parametrize("hours", [-1, 0, 1])
def test_a_page_knows_how_old_things_are_and_when_its_server_is_silent(
    sources: Sources, records: Records, browser: Browser, hours: int
) -> None:
    page, port = (
        browser.new_page(extra_http_headers={"Authorization": basic(DOOR.password)}),
        free_port("127.0.0.1"),
    )
    ended(records, run("block-7"))
    page.clock.install(time=datetime.now(UTC) + timedelta(hours=hours))
    with page_server(sources, "127.0.0.1", port):
        page.goto(f"http://127.0.0.1:{port}/")
        expect(page.locator("#said")).to_contain_text("refreshed", timeout=60_000)
        for _ in range(3):
            _ticks(page)
        assert page.locator("#silent").inner_text() == ""
        age = page.locator(".ag-row [col-id=changed]").inner_text()
        assert re.fullmatch(r"[1-9][\d.]* (s|min)", age), age
    for _ in range(6):
        _ticks(page)
    expect(page.locator("#silent")).to_contain_text("No answer for")
    page.close()


def test_stages_of_the_first_project_come_to_a_page_that_is_open(
    sources: Sources, records: Records, browser: Browser
) -> None:
    page, port = (
        browser.new_page(extra_http_headers={"Authorization": basic(DOOR.password)}),
        free_port("127.0.0.1"),
    )
    with page_server(sources, "127.0.0.1", port):
        page.goto(f"http://127.0.0.1:{port}/")
        expect(page.locator("#said")).to_contain_text("refreshed", timeout=60_000)
        assert "adjustment" not in page.locator(".ag-header").inner_text()
        ended(records, run("block-7"))
        expect(page.locator(".ag-row .stage-done").first).to_be_visible(timeout=30_000)
        assert {"adjustment", "report", "σ new height [m]"} <= set(
            page.locator(".ag-header").inner_text().split("\n")
        )
    page.close()


def test_all_links_of_a_row_can_be_seen(sources: Sources, records: Records, browser: Browser) -> None:
    calibrated = stages("georeferencing_page", "report", "certificate")
    ended(records, run("block-7", story="system-calibration"), done=calibrated)
    examined = stages("image_quality_page", "radiometric_certificate")
    ended(records, run("block-8", story="image-quality"), done=examined)
    page, port = (
        browser.new_page(extra_http_headers={"Authorization": basic(DOOR.password)}),
        free_port("127.0.0.1"),
    )
    with page_server(sources, "127.0.0.1", port):
        page.goto(f"http://127.0.0.1:{port}/")
        cells = page.locator(".ag-cell[col-id=links]")
        expect(cells.nth(1)).to_contain_text("run", timeout=60_000)
        assert {tuple(cell.locator("a").all_inner_texts()) for cell in cells.all()} == {
            ("report", "cert.", "check", "run"),
            ("quality", "cert.", "run"),
        }
        for cell in cells.all():
            around, link = cell.bounding_box(), cell.locator("a").last.bounding_box()
            assert around is not None
            assert link is not None
            # Links end with a gap, and cells with another one.
            assert link["x"] + link["width"] <= around["x"] + around["width"] - 18.0
    page.close()


#: How many lines the text of an element takes.
_LINES = """element => {
    const range = document.createRange();
    range.selectNodeContents(element);
    return new Set([...range.getClientRects()].map(one => one.top)).size;
}"""


class _Later(datetime):
    @classmethod
    def now(cls, tz: tzinfo | None = None) -> _Later:
        return super().now(tz) + timedelta(minutes=23)


@pytest.mark.parametrize("width", [1280, 500])
def test_the_age_of_a_failure_is_in_one_line(
    sources: Sources, records: Records, browser: Browser, monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    monkeypatch.setattr("flows.overview.sources.datetime", _Later)
    ended(records, run("block-7"), "InputError", message="The image 0412 exists twice in the file. " * 3)
    page, port = (
        browser.new_page(
            extra_http_headers={"Authorization": basic(DOOR.password)},
            viewport={"width": width, "height": 800},
        ),
        free_port("127.0.0.1"),
    )
    with page_server(sources, "127.0.0.1", port):
        page.goto(f"http://127.0.0.1:{port}/")
        cells = page.locator("#failures tbody td")
        expect(cells.nth(4)).to_contain_text("exists twice", timeout=60_000)
        assert cells.nth(3).inner_text().split() == ["23", "min"]
        assert cells.nth(3).evaluate(_LINES) == 1
        assert cells.nth(4).evaluate(_LINES) > 1
    page.close()


def test_a_narrow_screen_has_room_for_the_columns_that_are_scrolled(
    sources: Sources, records: Records, browser: Browser
) -> None:
    ended(records, run("block-7"))
    page, port = (
        browser.new_page(
            extra_http_headers={"Authorization": basic(DOOR.password)},
            viewport={"width": 390, "height": 800},
        ),
        free_port("127.0.0.1"),
    )
    with page_server(sources, "127.0.0.1", port):
        page.goto(f"http://127.0.0.1:{port}/")
        expect(page.locator(".ag-pinned-left-header [col-id=project]")).to_be_visible(timeout=60_000)
        expect(page.locator(".ag-pinned-left-header [col-id=state]")).to_have_count(0, timeout=20_000)
        room = page.locator(".ag-center-cols-viewport").bounding_box()
        assert room is not None
        assert room["width"] > 150.0
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        page.set_viewport_size({"width": 1200, "height": 800})
        expect(page.locator(".ag-pinned-left-header [col-id=state]")).to_have_count(1, timeout=30_000)
    page.close()
