"""Who calibrated, under which number and when, and the places for signatures.

What the project does not say is left blank, to be filled in by hand.
"""

from __future__ import annotations

from datetime import date

from tasks.documents.certificate.content import Fact, Facts, Section, Signature, Signatures
from tasks.documents.certificate.material import CertificateMaterial

#: Places for signatures where the project names nobody.
_ROLES = ("Responsible for the calibration", "Approved")


def laboratory_section(material: CertificateMaterial) -> Section:
    """Number, laboratory and dates."""
    record, settings = material.record, material.certificate
    laboratory = settings.laboratory
    what = "document" if record.verdict == "refused" else "certificate"
    facts = (
        Fact("number", f"number of the {what}", _given(settings.numbers.get(record.camera.name))),
        Fact("laboratory", "laboratory", _given(laboratory.name)),
        Fact("address", "address", laboratory.address),
        Fact("accreditation", "accreditation", _given(laboratory.accreditation)),
        Fact("calibrated", "date of calibration", _day(settings.calibrated)),
        Fact("issued", "date of issue", _day(settings.issued)),
    )
    return Section("laboratory", "Laboratory", (Facts("laboratory", "", facts),))


def signatures(material: CertificateMaterial) -> Signatures:
    """A place for the date of issue, and one for everybody who signs."""
    settings = material.certificate
    people = [Signature(item.role, item.name) for item in settings.signatories]
    day = "" if settings.issued is None else settings.issued.isoformat()
    return Signatures(
        (Signature("Place, date", filled=day), *(people or (Signature(role) for role in _ROLES)))
    )


def _given(text: str | None) -> tuple[str, ...]:
    return () if text is None else (text,)


def _day(day: date | None) -> tuple[str, ...]:
    return () if day is None else (day.isoformat(),)
