"""The radiometric certificate: ``radiometric_certificate.html``, ``.pdf`` and ``.json``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tasks.documents.certificate.documents import document_of, page_of, pdf_of
from tasks.documents.image_quality.certificate_content import FILE, radiometric_content, radiometric_record
from tasks.documents.image_quality.material import read_quality
from tasks.files.json_text import json_text
from tasks.settings.image_quality import ImageQualitySettings
from tasks.stages.certificate import SOFTWARE
from tasks.store.artifact import Artifact
from tasks.store.store import stored


@stored("radiometric_certificate")
def write_radiometric_certificate(
    folder: Path,
    *,
    stages: tuple[Mapping[str, Artifact], ...],
    settings: ImageQualitySettings,
    name: str,
    software: Mapping[str, str] = SOFTWARE,
) -> None:
    """Write the certificate of a sensor that has been examined.

    Parameters
    ----------
    stages : outputs of the examinations of scenes and sensor, those there are.
    name : of the examination (it is not part of the settings' content).
    software : versions that decide how the documents look.
    """
    material = read_quality(stages, settings)
    record = radiometric_record(stages, material, name, software)
    content = radiometric_content(material, record, name)
    twin = {**document_of(content), "record": record}
    (folder / f"{FILE}.html").write_text(page_of(content), encoding="utf-8")
    (folder / f"{FILE}.json").write_text(json_text(twin, indent=2) + "\n", encoding="utf-8")
    (folder / f"{FILE}.pdf").write_bytes(pdf_of(content))
