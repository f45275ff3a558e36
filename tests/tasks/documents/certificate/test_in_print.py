"""The certificate as it comes out: text and fonts of the PDF, and the page in a real browser."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser

from tasks.documents.certificate.content import CertificateContent
from tasks.documents.certificate.documents import document_of, page_of, pdf_of
from tests.chromium import complaints
from tests.tasks.documents.certificate.conftest import HOSTILE, Calibration, as_json, changed

pytestmark = pytest.mark.service

#: Where a long word may break without a sign of it.
INVISIBLE = "\u200b"


def of_poppler(name: str, pdf: Path, *options: str) -> str:
    program = shutil.which(name)
    assert program is not None, f"{name} is missing: make service-deps installs it (poppler-utils)"
    command = [program, *options, str(pdf), *(["-"] if name == "pdftotext" else [])]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout


def shown_numbers(node: Any) -> Iterator[str]:
    """Every number as it is to be printed."""
    if isinstance(node, dict):
        if "value" in node and node["value"] is not None:
            yield node["shown"]
        for child in node.values():
            yield from shown_numbers(child)
    elif isinstance(node, list):
        for child in node:
            yield from shown_numbers(child)


@pytest.fixture(scope="module")
def content(calibration: Calibration) -> CertificateContent:
    return calibration.content()


@pytest.fixture(scope="module")
def pdf(content: CertificateContent, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("paper") / "certificate.pdf"
    path.write_bytes(pdf_of(content))
    return path


def test_every_number_stands_on_paper(content: CertificateContent, pdf: Path) -> None:
    printed = Counter(re.split(r"[\s,]*\s+", of_poppler("pdftotext", pdf).replace("°", "")))
    wanted = Counter(shown_numbers(as_json(document_of(content))))
    assert sum(wanted.values()) > 500
    assert wanted - printed == Counter()


def test_every_page_has_camera_code_and_number(content: CertificateContent, pdf: Path) -> None:
    pages = of_poppler("pdftotext", pdf).split("\f")[:-1]
    assert len(pages) > 5
    for number, page in enumerate(pages, start=1):
        assert content.camera in page
        assert content.short_code in page
        assert f"page {number} of {len(pages)}" in page


def test_only_the_fonts_of_typst_are_used_and_embedded(pdf: Path) -> None:
    rows = [line.split() for line in of_poppler("pdffonts", pdf).splitlines()[2:]]
    assert rows
    for row in rows:
        assert re.fullmatch(r"[A-Z]{6}\+(LibertinusSerif|DejaVuSansMono).*", row[0])
        assert row[-5:-2] == ["yes", "yes", "yes"]


def test_names_stand_on_paper_to_the_letter(calibration: Calibration, tmp_path: Path) -> None:
    flight = calibration.record.flight.model_copy(update={"project": HOSTILE})
    record = changed(calibration.record, flight=flight, remarks=(HOSTILE,))
    path = tmp_path / "hostile.pdf"
    path.write_bytes(pdf_of(calibration.content(record)))
    text = " ".join(of_poppler("pdftotext", path).replace(INVISIBLE, "").split())
    assert text.count(" ".join(HOSTILE.split())) >= 3


@pytest.mark.parametrize("name", ["UCE", "N" * 200])
def test_nothing_leaves_the_margins_of_the_paper(calibration: Calibration, tmp_path: Path, name: str) -> None:
    """Left 20 mm, right 18 mm of 210 mm; a point is 1/72 inch."""
    record, point = calibration.record, 72.0 / 25.4
    flight = record.flight.model_copy(update={"project": name})
    record = changed(record, flight=flight, inputs={name: "0" * 64}, reasons=(name,), verdict="refused")
    path = tmp_path / "certificate.pdf"
    path.write_bytes(pdf_of(calibration.content(record)))
    boxes = of_poppler("pdftotext", path, "-bbox")
    words = re.findall(r'<word xMin="([\d.-]+)" [^>]*xMax="([\d.-]+)"', boxes)
    assert len(words) > 1000
    assert min(float(left) for left, _ in words) > 19.5 * point
    assert max(float(right) for _, right in words) < 192.7 * point


@pytest.fixture(scope="module")
def page_file(content: CertificateContent, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "certificate.html"
    path.write_text(page_of(content), encoding="utf-8")
    return path


def test_the_page_is_complete_without_network_and_without_scripts(
    content: CertificateContent, page_file: Path, browser: Browser
) -> None:
    page = browser.new_page()
    said = complaints(page)
    page.goto(page_file.as_uri())
    assert page.content().count("<svg") == len(content.figures)
    assert said == []
    page.close()


@pytest.mark.parametrize("width", [1280, 500])
def test_nothing_is_wider_than_the_window(page_file: Path, browser: Browser, width: int) -> None:
    page = browser.new_page(viewport={"width": width, "height": 900})
    page.goto(page_file.as_uri())
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.close()
