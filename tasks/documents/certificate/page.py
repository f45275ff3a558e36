"""certificate.html: one page that needs nothing else."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from tasks.documents.certificate.content import CertificateContent
from tasks.documents.report.page import TEMPLATES as REPORT_TEMPLATES

#: Package data: part of the digest of every source that reaches this module.
TEMPLATES = Path(__file__).parent / "templates"


def page_of(content: CertificateContent) -> str:
    """The certificate as a page."""
    return _environment().get_template("certificate.html.j2").render(content=content)


@cache
def _environment() -> Environment:
    """Templates with escaping on for everything: names come from files."""
    return Environment(
        loader=FileSystemLoader([TEMPLATES, REPORT_TEMPLATES]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
