"""certificate.pdf: A4, tagged (PDF/UA-1), with the fonts of typst; made without network access.

The template reads the same tree that certificate.json holds. Texts reach it as data, so nothing in a name
can be markup. There is no date in the file and system fonts are left out: the same content gives the same
bytes on every machine with the same version of typst.
"""

from __future__ import annotations

from typing import cast

import typst

from tasks.documents.certificate.content import CertificateContent
from tasks.documents.certificate.page import TEMPLATES
from tasks.documents.certificate.twin import document_of
from tasks.documents.report.export import drawing_rules, standing_alone
from tasks.documents.report.page import TEMPLATES as REPORT_TEMPLATES
from tasks.files.json_text import json_text

#: The drawings in the font of the document; names in them are as small as on the page otherwise.
_FONT = 'text { font-family: "Libertinus Serif"; font-size: 14px; } .label { font-size: 15px; }'


def pdf_of(content: CertificateContent) -> bytes:
    """The certificate as a PDF."""
    # Several files as a mapping are documented by typst, but missing in its type stubs.
    sources = cast(bytes, sources_of(content))
    return typst.compile(
        sources,
        format="pdf",
        ignore_system_fonts=True,
        pdf_standards="ua-1",
        timestamp=0,
    )


def sources_of(content: CertificateContent) -> dict[str, bytes]:
    """The files that typst reads: the template, the content, and the drawings."""
    rules = "\n".join([*_drawing_rules(), _FONT])
    drawings = {f"{one.name}.svg": standing_alone(str(one.drawing), rules) for one in content.figures}
    texts = {
        "main.typ": (TEMPLATES / "certificate.typ").read_text(encoding="utf-8"),
        "content.json": json_text(document_of(content)),
        **drawings,
    }
    return {name: text.encode() for name, text in texts.items()}


def _drawing_rules() -> list[str]:
    """The rules of the page that concern drawings."""
    sheets = (REPORT_TEMPLATES / "style.css", TEMPLATES / "certificate.css")
    return [drawing_rules(sheet.read_text(encoding="utf-8")) for sheet in sheets]
