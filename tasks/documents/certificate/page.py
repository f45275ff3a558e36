"""certificate.html: one self-contained page."""

from __future__ import annotations

from pathlib import Path

from tasks.document_kit.templates import rendered
from tasks.documents.certificate.content import CertificateContent
from tasks.documents.report.page import TEMPLATES as REPORT_TEMPLATES

#: Package data: part of the digest of every source that reaches this module.
TEMPLATES = Path(__file__).parent / "templates"


def page_of(content: CertificateContent) -> str:
    """The certificate as a page."""
    return rendered("certificate.html.j2", TEMPLATES, REPORT_TEMPLATES, content=content)
