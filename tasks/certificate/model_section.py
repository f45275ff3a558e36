"""Tests of the model: what it may lack, and what this flight would not notice."""

from __future__ import annotations

from tasks.certificate.content import Block, Listing, Section, Words
from tasks.certificate.material import CertificateMaterial
from tasks.report.model_tests import strongest_table, unnoticed_table


def model_section(material: CertificateMaterial) -> Section:
    """The strongest alternatives, and the errors that may stay unnoticed with what they would do."""
    strongest, unnoticed = strongest_table(material.results), unnoticed_table(material.results)
    blocks: list[Block] = [
        Words(
            "The calibration holds if the model does. What is held, or taken to be the same in every flight, "
            "height, direction and strip, was tested with the observations of this flight."
        )
    ]
    blocks += [Listing(table, ("alternative",)) for table in (strongest, unnoticed) if table.rows]
    return Section("model", "Tests of the model", tuple(blocks))
