"""HTML, PDF and JSON of a certificate are one content, made the same way every time, and safe from names."""

from __future__ import annotations

import hashlib
import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from tasks.documents.certificate.compose import content_of
from tasks.documents.certificate.content import CertificateContent, Facts, short_code
from tasks.documents.certificate.documents import (
    FORMAT,
    VERSION,
    document_of,
    page_of,
    pdf_of,
    sources_of,
    twin_of,
)
from tasks.stages.certificate import write_certificate
from tests.tasks.documents.certificate.calibrations import written
from tests.tasks.documents.certificate.conftest import HOSTILE, Calibration, as_json, changed, tables_of
from tests.tasks.documents.report.page_reader import Page

CERTIFICATE = ("certificate.html", "certificate.json", "certificate.pdf")


@pytest.fixture(scope="module")
def content(calibration: Calibration) -> CertificateContent:
    return calibration.content()


def cells(table: dict[str, Any]) -> Iterator[tuple[tuple[str, str], Any]]:
    """(row key, column name) and cell of a table of certificate.json."""
    for row in table["rows"]:
        for column, cell in zip(table["columns"], row["cells"], strict=True):
            yield (row["key"], column["name"]), cell


def test_the_page_shows_every_number_of_the_json_with_the_same_value(content: CertificateContent) -> None:
    page, compared = Page(page_of(content)), 0
    for name, table in tables_of(as_json(document_of(content))).items():
        for place, cell in cells(table):
            if isinstance(cell, dict):
                read = page.tables[name].numbers[place]
                assert read.shown == cell["shown"]
                assert read.data == ("" if cell["value"] is None else repr(cell["value"]))
                compared += 1
    assert compared > 400


def test_the_page_shows_every_fact(content: CertificateContent) -> None:
    text = " ".join(Page(page_of(content)).text.split())
    facts = [f for s in content.sections for b in s.single_blocks if isinstance(b, Facts) for f in b.facts]
    assert len(facts) > 40
    for fact in facts:
        assert fact.label in text
        assert fact.shown in text


def test_paper_is_made_from_what_the_json_holds_and_from_nothing_else(content: CertificateContent) -> None:
    sources = sources_of(content)
    assert json.loads(sources["content.json"]) == as_json(document_of(content))
    drawings = {f"{figure.name}.svg" for figure in content.figures}
    assert set(sources) == {"main.typ", "content.json", *drawings}
    assert {"flight-pattern.svg", "image-errors.svg", "mean-residuals.svg"} <= drawings


def test_the_same_content_gives_the_same_pdf_without_a_date(content: CertificateContent) -> None:
    first = pdf_of(content)
    assert first == pdf_of(content)
    assert first.startswith(b"%PDF-1.7")
    assert b"CreationDate" not in first
    assert b"ModDate" not in first
    # Tagged for screen readers, A4, all fonts embedded.
    assert b"/MarkInfo" in first
    assert re.search(rb"/MediaBox\s*\[\s*0 0 595\.2\d+ 841\.8\d+\s*\]", first)
    assert first.count(b"/FontFile") >= len(set(re.findall(rb"/FontName\s*/(\S+)", first))) > 0


def test_drawings_stand_alone(content: CertificateContent) -> None:
    for name, source in sources_of(content).items():
        if name.endswith(".svg"):
            root = ElementTree.fromstring(source)
            assert root.tag == "{http://www.w3.org/2000/svg}svg"
            assert b"var(" not in source
            assert b"href" not in source


def test_the_verification_code_follows_from_the_json_file_alone(calibration: Calibration) -> None:
    twin = as_json(twin_of(calibration.content(), calibration.record))
    assert (twin["format"], twin["version"]) == (FORMAT, VERSION)

    def code(record: object) -> str:
        return hashlib.sha256(json.dumps(record, sort_keys=True, ensure_ascii=False).encode()).hexdigest()

    assert code(twin["record"]) == twin["code"] == calibration.record.digest
    assert twin["short_code"] == short_code(twin["code"])
    assert twin["short_code"].replace("-", "").lower() == twin["code"][:16]
    twin["record"]["parameters"][0]["value"] += 1e-9
    assert code(twin["record"]) != twin["code"]


def test_the_head_of_every_page_has_camera_and_code(content: CertificateContent) -> None:
    template = sources_of(content)["main.typ"].decode()
    header = template.partition("header: {")[2].partition("footer:")[0]
    assert "data.camera" in header
    assert "data.short_code" in header
    page = page_of(content)
    assert page.count(content.short_code) >= 3


@pytest.fixture(scope="module")
def hostile(calibration: Calibration) -> CertificateContent:
    record = calibration.record
    camera = record.camera
    identity = camera.identity.model_copy(update={"body": HOSTILE, "mount": HOSTILE})
    return calibration.content(
        changed(
            record,
            camera=camera.model_copy(update={"identity": identity}),
            flight=record.flight.model_copy(update={"project": HOSTILE}),
            reasons=(HOSTILE, "another"),
            remarks=(HOSTILE,),
            verdict="refused",
            inputs={HOSTILE: "00" * 32},
            software={HOSTILE: HOSTILE},
        )
    )


def test_names_are_text_on_the_page(hostile: CertificateContent) -> None:
    page = Page(page_of(hostile))
    assert page.text.count(HOSTILE) >= 8
    assert "b" not in {tag for tag, name, _ in page.attributes if name != "class"}
    assert page_of(hostile).count("<b>") == 0


def test_names_are_text_on_paper(hostile: CertificateContent, content: CertificateContent) -> None:
    """Markup in a name would fail (#panic) or change the template, which is the same for all."""
    sources = sources_of(hostile)
    assert sources["main.typ"] == sources_of(content)["main.typ"]
    assert HOSTILE.encode() not in sources["main.typ"]
    assert pdf_of(hostile).startswith(b"%PDF")


def test_the_stage_writes_three_documents_and_finds_them_again(calibration: Calibration) -> None:
    def run() -> dict[str, bytes]:
        outputs = write_certificate(
            calibration.store,
            record=written(calibration.record, calibration.folder / "stage"),
            stages=calibration.stages,
            project=calibration.project,
            certificate=calibration.project.certificate,
        )
        assert {name: artifact.path.name for name, artifact in outputs.items()} == {
            name: name for name in ("certificate.html", "certificate.json", "certificate.pdf")
        }
        return {name: artifact.path.read_bytes() for name, artifact in outputs.items()}

    documents = run()
    assert run() == documents
    twin = json.loads(documents["certificate.json"])
    assert twin["record"] == json.loads(calibration.record.text)
    assert twin["code"].encode() in documents["certificate.html"]
    assert len(documents["certificate.pdf"]) > 50_000


def test_certificates_of_several_cameras_have_names_of_their_own(calibration: Calibration) -> None:
    outputs = write_certificate(
        calibration.store,
        record=written(calibration.record, calibration.folder / "stage"),
        stages=calibration.stages,
        project=calibration.project,
        certificate=calibration.project.certificate,
        suffix="_CAM-2",
    )
    assert set(outputs) == {f"certificate_CAM-2.{ending}" for ending in ("html", "json", "pdf")}


def test_without_points_headings_or_results_there_are_still_documents(calibration: Calibration) -> None:
    """Nothing surveyed, no direction recognised, nothing estimated: sentences take the place of tables."""
    held = tuple(
        item.model_copy(update={"sigma": None, "status": "fixed", "verdict": "held"})
        for item in calibration.record.parameters
    )
    flight = calibration.record.flight.model_copy(
        update={"heights_m": (), "headings_deg": (), "gsd_m": (), "control_points": 0}
    )
    record = changed(calibration.record, parameters=held, covariance=(), flight=flight)
    material = calibration.material(record)
    results = material.results
    empty = replace(
        results,
        control_points=results.control_points.iloc[:0],
        control_residuals=results.control_residuals.iloc[:0],
        check_points=results.check_points.iloc[:0],
    )
    content = content_of(replace(material, results=empty, check=None), {})
    text = Page(page_of(content)).text
    assert "there are no correlations" in text
    assert "no statement about accuracy is possible" in text
    assert "Direct georeferencing with this calibration was not checked" in text
    assert "±" not in text
    assert "nan" not in text.lower().replace("nance", "")
    assert pdf_of(content).startswith(b"%PDF")
