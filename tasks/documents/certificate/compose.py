"""The content of a certificate from its material: the sections in their order."""

from __future__ import annotations

from collections.abc import Mapping

from tasks.documents.certificate.check_section import check_section, point_section
from tasks.documents.certificate.content import CertificateContent
from tasks.documents.certificate.correlation_section import correlation_section
from tasks.documents.certificate.effect_section import effect_section
from tasks.documents.certificate.flight_section import flight_section
from tasks.documents.certificate.identity_section import axes_section, identity_section, rig_section
from tasks.documents.certificate.laboratory_section import laboratory_section
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.certificate.model_section import model_section
from tasks.documents.certificate.origin_section import origin_section, verification_section
from tasks.documents.certificate.parameter_section import parameter_section
from tasks.documents.certificate.settings_section import settings_section
from tasks.documents.certificate.statistics_section import statistics_section
from tasks.documents.certificate.use_section import use_section
from tasks.documents.certificate.verdict_section import (
    brief_section,
    reasons_section,
    verdict_section,
    verdict_sentence,
)


def content_of(material: CertificateMaterial, software: Mapping[str, str]) -> CertificateContent:
    """Everything the certificate says; `software` made the documents."""
    record = material.record
    reasons, rig = reasons_section(material), rig_section(material)
    sections = [
        *([] if reasons is None else [reasons]),
        laboratory_section(material),
        identity_section(material),
        brief_section(material),
        axes_section(material),
        flight_section(material),
        parameter_section(material),
        *([] if rig is None else [rig]),
        correlation_section(material),
        effect_section(material),
        check_section(material),
        settings_section(material),
        statistics_section(material.results),
        model_section(material),
        verdict_section(material),
        use_section(material),
        verification_section(material),
    ]
    annex = point_section(material)
    annexes = (*([] if annex is None else [annex]), origin_section(material, software))
    return CertificateContent(
        camera=record.camera.name,
        project=record.flight.project,
        verdict=record.verdict,
        sentence=verdict_sentence(record),
        code=record.digest,
        sections=(*sections, *annexes),
    )
