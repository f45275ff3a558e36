"""Take the pictures of the pages: ``python -m docs.generate.pictures [calibration] [production]``.

The first is the demonstration: the first page of its certificate beside figures of its report. The others are
the production page and the form of a run of ``aerocal serve``, after deliveries of simulated flights; the
calibrations on that page are records of the tests of the registry. Both need Chromium, the first also Poppler
(``make service-deps`` installs them).
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import date
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, expect, sync_playwright

from tasks.registry.registry import Registry
from tasks.settings.registry import registry_address
from tests.service.served import Served, served, until
from tests.service.test_browser import PATIENCE_MS, QUIET
from tests.tasks.registry.records import SIGMAS, VALUES, add, approve, record

_DOCS = Path(__file__).resolve().parents[1]
KEPT = _DOCS / "images"
_AEROCAL = Path(sys.executable).with_name("aerocal")

_COLLAGE = """<!doctype html><meta charset="utf-8"><style>
body { margin: 0; width: 1280px; background: white }
body { display: grid; grid-template-columns: 510px 740px; gap: 0 20px }
img { width: 100%; display: block }
.page { border: 1px solid #ccc; margin: 8px; width: 490px; align-self: center }
.plan { width: 560px; margin: auto }
.attitudes { height: 142px; object-fit: cover; object-position: top }
</style><img class="page" src="page.png"><div><img class="plan" src="figures/block.svg">
<img class="attitudes" src="figures/strip-differences.svg"></div>"""

#: Deliveries in the order in which they arrive: name, seed, gates, and a change that makes it wrong.
_DELIVERIES = (
    ("aalen", 1, "sigma0 = { max = 1.1 }\nrmse_check_m = { max = [0.06, 0.06, 0.1] }", None),
    ("bad-cannstatt", 2, "sigma0 = { max = 1.1 }", ("image_points.csv", "image,", "picture,")),
    ("crailsheim", 3, "sigma0 = { max = 1.1 }\nrmse_check_m = { max = [0.06, 0.06, 0.1] }", None),
    ("dinkelsbuehl", 4, "sigma0 = { max = 1.1 }\nrmse_check_m = { max = [0.06, 0.06, 0.01] }", None),
    ("ellwangen", 5, "sigma0 = { max = 0.9 }\nrmse_check_m = { max = [0.06, 0.06, 0.1] }", None),
    ("feuchtwangen", 6, "sigma0 = { max = 1.1 }\nrmse_check_m = { max = [0.06, 0.06, 0.1] }", None),
    ("giengen", 7, "sigma0 = { max = 1.1 }\nrmse_check_m = { max = [0.06, 0.06, 0.1] }", None),
    ("heidenheim", 8, "sigma0 = { max = 1.1 }\nrmse_check_m = { max = [0.06, 0.06, 0.1] }", None),
)
_FLIGHT = """preset = "uce-high"
project = { name = "uce-high" }
control = [
    { layout = "grid", columns = 8, rows = 5 },
    { layout = "spread", count = 20, control = 0, margin = 0.2 },
]
"""


@contextmanager
def _browser_page(width: int, height: int) -> Iterator[Page]:
    """An empty page of this size in Debian's Chromium."""
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=list(QUIET))
        page = chromium.new_page(viewport={"width": width, "height": height})
        page.set_default_timeout(PATIENCE_MS)
        yield page
        chromium.close()


def _aerocal(place: Path, *arguments: str) -> None:
    """Run a command in a folder, silently unless it fails."""
    subprocess.run([_AEROCAL, *arguments], cwd=place, check=True, stdout=subprocess.DEVNULL)


def take_calibration(place: Path) -> None:
    """Calibrate as ``make demo`` does, and put certificate and figures side by side."""
    _aerocal(place, "flight-check", "uce-calibration", "--calibrate", "--out", "demo")
    _collage(place, place / "demo" / "results")


def _collage(place: Path, results: Path) -> None:
    """The first page of the certificate beside figures of the report."""
    _aerocal(place, "figures", str(results), "--out", str(place / "figures"))
    to_image = ["pdftoppm", "-png", "-r", "120", "-singlefile", results / "certificate.pdf", place / "page"]
    subprocess.run(to_image, check=True)
    (place / "collage.html").write_text(_COLLAGE, encoding="utf-8")
    with _browser_page(1280, 200) as page:
        page.goto((place / "collage.html").as_uri())
        page.screenshot(path=KEPT / "calibration.png", full_page=True)


def _deliver(place: Path) -> None:
    """Put simulated flights into the inbox, with quality gates; one of them with a wrong column."""
    (place / "flight.toml").write_text(_FLIGHT, encoding="utf-8")
    for name, seed, gates, wrong in _DELIVERIES:
        folder = place / "inbox" / name
        _aerocal(place, "simulate", "flight.toml", "--seed", str(seed), "--out", str(folder))
        with (folder / "project.toml").open("a", encoding="utf-8") as stream:
            stream.write(f"\n[gates]\n{gates}\n")
        if wrong is not None:
            file, old, new = wrong
            text = (folder / file).read_text(encoding="utf-8")
            (folder / file).write_text(text.replace(old, new, 1), encoding="utf-8")


def _register(file: Path) -> None:
    """Five calibrations of a camera in as many years; the last one, a draft, has drifted."""
    registry = Registry.at(registry_address(str(file)))
    chance = np.random.default_rng(5)
    for number, drift in enumerate((0.0, 0.0, 0.0, 0.0, 8.0), start=1):
        values = VALUES + SIGMAS * (0.6 * chance.standard_normal(5) + [drift, 0.0, 0.0, 0.0, 0.0])
        day = date(2021 + number, 3, 1)
        add(registry, record(values, flown=day))
        if not drift:
            approve(registry, number, day)


def _ended(server: Served) -> int:
    """How many runs have ended, in whatever way."""
    return sum(one.state not in ("Scheduled", "Running") for one in server.records.latest())


def _run_one_after_another(server: Served) -> None:
    """Hand over the deliveries one by one, so that their order is always the same."""
    for number, (name, *_) in enumerate(_DELIVERIES, start=1):
        (server.folder / "inbox" / name / "DELIVERED").touch()
        until(lambda number=number: _ended(server) == number, 300, server.process)


def _picture(page: Page, name: str, first: str, last: str) -> None:
    """The page from one of its sections to another one, with a small margin."""
    top, bottom = (
        page.locator(section).evaluate(f"one => one.getBoundingClientRect().{edge}")
        for section, edge in ((first, "top"), (last, "bottom"))
    )
    clip = {"x": 0, "y": max(top - 10, 0), "width": 1500, "height": bottom + 10 - max(top - 10, 0)}
    page.screenshot(path=KEPT / name, full_page=True, clip=clip)


def _take_overview(server: Served, page: Page) -> None:
    """The grid of projects, and the trends with the calibrations."""
    page.goto(f"http://127.0.0.1:{server.overview}/")
    expect(page.locator("#calibrations svg").last).to_be_visible()
    expect(page.locator("#rmse-trend .points path").last).to_be_visible()
    _picture(page, "overview-projects.png", "body", "#projects-section")
    _picture(page, "overview-trends.png", "#trends-section", "#calibrations-section")


def _take_form(server: Served, page: Page) -> None:
    """The form of a run."""
    page.set_viewport_size({"width": 1400, "height": 1900})
    deployment = server.api.get("/deployments/name/aerial-triangulation/manual")["id"]
    page.goto(f"http://127.0.0.1:{server.port}/v2/deployments/deployment/{deployment}/run")
    expect(page.get_by_role("button", name="Submit")).to_be_visible()
    expect(page.get_by_label("project")).to_be_visible()
    page.screenshot(path=KEPT / "run-form.png")


def take_production(place: Path) -> None:
    """Serve a production with a few deliveries; the production page and the form of a run."""
    _deliver(place)
    registry = place / "root" / "registry.sqlite"
    registry.parent.mkdir()
    _register(registry)
    with served(place, "--registry", str(registry)) as server:
        _run_one_after_another(server)
        with _browser_page(1500, 700) as page:
            server.let_in(page)
            _take_overview(server, page)
            _take_form(server, page)


_PICTURES = {"calibration": take_calibration, "production": take_production}


def main() -> int:
    """Take the pictures that are named, or all."""
    for name in sys.argv[1:] or _PICTURES:
        with tempfile.TemporaryDirectory() as place:
            _PICTURES[name](Path(place))
    return 0


if __name__ == "__main__":
    sys.exit(main())
