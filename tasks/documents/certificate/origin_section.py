"""Verification code and signatures; annex of the origin: digests of the deliveries, versions."""

from __future__ import annotations

from collections.abc import Mapping

from tasks.calibration.record import CalibrationRecord
from tasks.document_kit.table import Row, Table, text_column
from tasks.documents.certificate.content import (
    Block,
    Fact,
    Facts,
    Listing,
    Section,
    Words,
    beside,
    short_code,
)
from tasks.documents.certificate.laboratory_section import signatures
from tasks.documents.certificate.material import CertificateMaterial
from tasks.settings.project import ProjectSource

_VERIFY = (
    "The code is the SHA-256 of the record of this calibration. To verify it, fetch the record from the "
    "registry by its code: aerocal registry export {} writes the text whose SHA-256 is the code (aerocal "
    "registry verify examines the whole registry). Or take the record from certificate.json, under the key "
    "“record”: the code is the SHA-256 of its JSON text in UTF-8, keys sorted, one space after every comma "
    "and colon. With one number changed the code is another. Then compare the numbers on paper with those "
    "of the record."
)


def verification_section(material: CertificateMaterial) -> Section:
    """How the certificate is verified, and who answers for it."""
    record = material.record
    code = (
        Fact("short_code", "short form, in the head of every page", (short_code(record.digest),)),
        Fact("code", "verification code", (record.digest,)),
    )
    blocks: list[Block] = [
        Facts("verification", "", code),
        Words(_VERIFY.format(short_code(record.digest))),
        signatures(material),
    ]
    return Section("verification", "Verification", tuple(blocks))


def origin_section(material: CertificateMaterial, software: Mapping[str, str]) -> Section:
    """Annex: what the values were computed from and with, and what produced the document."""
    record = material.record
    blocks = (
        *_project_file(material.source),
        Listing(input_table(record), ("sha256",)),
        *beside(
            Listing(software_table("software", "Software of the calibration", record.software)),
            Listing(software_table("document-software", "Software of this document", software)),
        ),
    )
    return Section("origin", "Annex: deliveries and software", blocks)


def _project_file(source: ProjectSource) -> tuple[Block, ...]:
    """Digest of the project file, and the values that replaced some of it."""
    replaced = "listed below" if source.overrides else "none"
    facts = (
        Fact("project_file", "project file, SHA-256", (source.sha256 or "read from no file",)),
        Fact("overrides", "values replaced for this run", (replaced,)),
    )
    columns = (text_column("setting", "setting of the project file"), text_column("value", "replaced by"))
    pairs = [text.partition("=") for text in source.overrides]
    rows = tuple(Row(key, (key.strip(), value.strip())) for key, _, value in pairs)
    table = Table("overrides", "Values replaced for this run", columns, rows)
    return (Facts("project-file", "", facts), *([Listing(table, ("value",))] if rows else []))


def input_table(record: CalibrationRecord) -> Table:
    """The delivered files with their digests."""
    rows = tuple(Row(name, (name, sha256)) for name, sha256 in sorted(record.inputs.items()))
    columns = (text_column("file", "delivered file"), text_column("sha256", "SHA-256"))
    return Table("inputs", "Delivered files", columns, rows, "" if rows else "The record names none.")


def software_table(name: str, caption: str, software: Mapping[str, str]) -> Table:
    """Names and versions of software."""
    rows = tuple(Row(each, (each, version)) for each, version in sorted(software.items()))
    columns = (text_column("software", "software"), text_column("version", "version"))
    return Table(name, caption, columns, rows)
