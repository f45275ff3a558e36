"""The certificate as a stage: ``certificate.html``, ``certificate.pdf`` and ``certificate.json``."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

from tasks.documents.certificate.compose import content_of
from tasks.documents.certificate.documents import page_of, pdf_of, twin_of
from tasks.documents.certificate.material import read_certificate_material
from tasks.files.json_text import json_text
from tasks.settings.certificate import CertificateSettings
from tasks.settings.project import Project, ProjectSource
from tasks.store.artifact import Artifact
from tasks.store.store import stored

#: Versions that decide how the documents look, besides those of the numerical libraries.
SOFTWARE: Mapping[str, str] = {name: version(name) for name in ("aerocal", "jinja2", "markupsafe", "typst")}


@stored("certificate")
def write_certificate(
    folder: Path,
    *,
    record: Artifact,
    stages: tuple[Mapping[str, Artifact], ...],
    project: Project,
    certificate: CertificateSettings,
    project_file: str = "",
    overrides: tuple[str, ...] = (),
    suffix: str = "",
    software: Mapping[str, str] = SOFTWARE,
) -> None:
    """Write certificate.html, certificate.json and certificate.pdf.

    Parameters
    ----------
    record : the file calibration.json.
    stages : the outputs of all stages so far by name, in the order in which they ran; those of a
        direct-georeferencing check among them are shown.
    project : the settings of the run; its gates are tested.
    certificate : who calibrates and signs.
    project_file, overrides : digest of the project file, and overrides of its values.
    suffix : of the files' names, to keep the certificates of several cameras apart.
    software : versions that decide how the documents look.
    """
    source = ProjectSource(project_file, overrides)
    material = read_certificate_material(record, stages, project, certificate, source)
    content = content_of(material, software)
    html, twin, pdf = (folder / f"certificate{suffix}.{ending}" for ending in ("html", "json", "pdf"))
    html.write_text(page_of(content), encoding="utf-8")
    twin.write_text(json_text(twin_of(content, material.record), indent=2) + "\n", encoding="utf-8")
    pdf.write_bytes(pdf_of(content))
