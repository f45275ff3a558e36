"""Names that try to become markup stay names: in every page, drawing, document and table of a real run."""

from __future__ import annotations

import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd
import pytest

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.scenario_sweep import sweep_of
from flows.stories.system_calibration import system_calibration
from tasks.documents.report.export import export_figures
from tasks.documents.time_series.page import write_time_series
from tasks.registry.registry import Registry
from tasks.settings.camera_identity import CameraIdentity
from tasks.settings.registry import registry_address
from tests.chromium import complaints
from tests.flows.hostile_names import CAMERA, IDENTITY, PAYLOADS, PROJECT, fly
from tests.tasks.registry.records import add, record

if TYPE_CHECKING:
    from playwright.sync_api import Browser

#: All elements our pages are made of; none of them loads, sends or carries out anything.
ELEMENTS = frozenset(
    """
    html head meta title style body main header footer nav section h1 h2 h3 p a b i sub sup br div span
    ul ol li dl dt dd data code table caption thead tbody tfoot tr th td figure figcaption details
    summary svg g line path rect circle text tspan polyline polygon image defs clippath use SIM905
    """.split()  # noqa: SIM905
)
LISTS = Path(__file__).parents[2] / "tasks/documents/report/templates/lists.js"
PAGES = ("report.html", "georeferencing_check.html", "certificate.html", "sweep.html", "time_series.html")
SVG = "{http://www.w3.org/2000/svg}"


class Markup(HTMLParser):
    """Elements and attributes as a browser takes them, and the text that is shown."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: set[str] = set()
        self.attributes: list[tuple[str, str]] = []
        self.shown: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.add(tag)
        self.attributes += [(name, value or "") for name, value in attrs]

    def handle_data(self, data: str) -> None:
        self.shown.append(data)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the results of a calibration, a sweep and a registry, all with hostile names."""
    folder = tmp_path_factory.mktemp("hostile")
    project = fly(folder)
    check = "direct_georeferencing.calibration=adjustment"
    outcome = carry_out(system_calibration, RunRequest(project, folder / "calibration", overrides=(check,)))
    assert outcome.error is None, outcome.error
    sweep = f"\n[sweep]\nworkers = 1\ncontrol = {{ '{PAYLOADS[0]}' = 'all' }}\n"
    sweep += f"[sweep.variants]\n'{PAYLOADS[1]}' = {{}}\n"
    project.write_text(project.read_text(encoding="utf-8") + sweep, encoding="utf-8")
    request = RunRequest(project, folder / "sweep")
    outcome = carry_out(sweep_of(request), request)
    assert outcome.error is None, outcome.error
    together = folder / "together"
    together.mkdir()
    for made in ("calibration", "sweep"):
        for file in (folder / made).glob("*.*"):
            if file.is_file():
                shutil.copy(file, together)
    registry = Registry.at(registry_address(str(folder / "registry.sqlite")))
    hostile = CameraIdentity.model_validate(IDENTITY)
    stored = [add(registry, record(name=CAMERA, identity=hostile, scale=scale)) for scale in (1.0, 2.0)]
    write_time_series(together / "time_series.html", stored)
    return together


@pytest.mark.parametrize("page", PAGES)
def test_a_page_holds_no_element_that_could_do_anything(results: Path, page: str) -> None:
    # The script of its lists, which the page names by its digest, is all that may run.
    text = (results / page).read_text(encoding="utf-8")
    own = f"<script>{LISTS.read_text(encoding='utf-8')}</script>"
    assert text.count(own) == (page == "report.html")
    markup = Markup(text.replace(own, ""))
    assert markup.elements <= ELEMENTS
    for name, value in markup.attributes:
        assert not name.startswith("on"), (name, value)
        assert name not in ("src", "srcdoc", "srcset", "action", "formaction", "xlink:href", "ping"), value
        if name == "href":
            assert value.startswith(("#", "data:image/png;base64,")), value
    assert "default-src 'none'" in (results / page).read_text(encoding="utf-8").partition("<style>")[0]


@pytest.mark.parametrize("page", PAGES)
def test_a_page_shows_the_names_as_they_are(results: Path, page: str) -> None:
    shown = "\n".join(Markup((results / page).read_text(encoding="utf-8")).shown)
    assert (CAMERA if page in ("certificate.html", "time_series.html") else PROJECT) in shown
    assert sum(payload in shown for payload in PAYLOADS) >= 3


def test_drawings_by_themselves_are_sound_and_hold_no_other_elements(results: Path, tmp_path: Path) -> None:
    files = export_figures(results / "report.html", tmp_path)
    assert len(files) >= 5
    for file in files:
        for element in ElementTree.parse(file).iter():
            assert element.tag.startswith(SVG), element.tag
            assert element.tag.removeprefix(SVG).lower() in ELEMENTS
            assert not [name for name in element.attrib if name.startswith("on") or "script" in name]


def test_tables_hold_the_names_verbatim(results: Path) -> None:
    points = pd.read_parquet(results / "image_points.parquet")
    for payload in PAYLOADS:
        assert points["point"].str.startswith(payload).any(), payload
    assert set(pd.read_parquet(results / "images.parquet")["camera"]) == {CAMERA}


@pytest.mark.service
def test_typst_takes_no_name_for_markup(results: Path) -> None:
    program = shutil.which("pdftotext")
    assert program is not None, "pdftotext is missing: make service-deps installs it (poppler-utils)"
    text = subprocess.run(
        [program, str(results / "certificate.pdf"), "-"], capture_output=True, text=True, check=True
    ).stdout
    flat = "".join(text.split()).replace("\u200b", "")
    assert '#read("/etc/passwd")#panic("p0wned")$x$*b*_i_@x<x>' in flat
    assert "root:x:0" not in flat


@pytest.mark.service
@pytest.mark.parametrize("page", PAGES)
def test_a_browser_runs_nothing_and_asks_for_nothing(results: Path, browser: Browser, page: str) -> None:
    tab = browser.new_page()
    happened = complaints(tab)
    tab.on("dialog", lambda dialog: (happened.append(dialog.message), dialog.dismiss()))
    tab.on("request", lambda request: happened.append(request.url))
    tab.goto((results / page).as_uri())
    # Wherever a name stands, somebody may point or click.
    for link in tab.locator("a").all():
        link.click()
    assert tab.locator("img, iframe, object, embed, form, base").count() == 0
    assert tab.locator("script").count() == (page == "report.html")
    assert tab.evaluate("window.frames.length") == 0
    tab.close()
    assert set(happened) <= {(results / page).as_uri()}
