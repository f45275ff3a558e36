"""Tests of the model: what it may lack, what this flight cannot detect, and what no flight can."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from tasks.calibration.record import CalibratedParameter
from tasks.coordinates.crs import MapFrame
from tasks.document_kit.row_table import number_of, table_of, text_of
from tasks.document_kit.table import Table
from tasks.documents.certificate.content import Block, Listing, Section, Words
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.certificate.quantities import short_name
from tasks.documents.certificate.words import AXES_NOTE, in_words
from tasks.documents.report.model_tests import strongest_table, unnoticed_table
from tasks.quantities import kind_of


def model_section(material: CertificateMaterial) -> Section:
    """The strongest alternatives, the errors that may stay unnoticed with what they would do, assumptions."""
    strongest, unnoticed = strongest_table(material.results), unnoticed_table(material.results)
    blocks: list[Block] = [
        Words(
            "The calibration is valid only if the model is. Parameters held fixed, or assumed to be equal in "
            "all flights, heights, directions and strips, were tested with the observations of this flight."
        ),
        Words(AXES_NOTE, "note"),
    ]
    blocks += [
        Listing(replace(table, note=in_words(table.note)), ("alternative",))
        for table in (strongest, unnoticed)
        if table.rows
    ]
    assumptions = assumption_table(material)
    if assumptions.rows:
        blocks.append(Listing(assumptions, ("assumption", "otherwise")))
    return Section("model", "Tests of the model", tuple(blocks))


@dataclass(frozen=True)
class _Assumption:
    """Change of a parameter if a declaration were wrong; `factor`: of its unit to that of the record."""

    item: CalibratedParameter
    assumption: str
    otherwise: str
    change: float
    unit: str
    factor: float


def assumption_table(material: CertificateMaterial) -> Table:
    """Declarations whose opposite fits every flight as well, with what it would change."""
    shown = (
        text_of("assumption", "declared, and assumed to be correct"),
        text_of("otherwise", "otherwise"),
        number_of("change", "changes by", decimals="change"),
        text_of("unit", "unit"),
        number_of("in_sigma", "in σ", decimals=1, of=lambda row: row.change * row.factor / row.item.sigma),
    )
    note = "No observation of this flight can verify these: they are as correct as their declaration."
    rows = (*_origin(material), *_north(material))
    return table_of("assumptions", "Assumptions", shown, rows, _key, note)


def _key(row: _Assumption) -> str:
    return f"{row.item.parameter}@{row.item.entity}"


def _origin(material: CertificateMaterial) -> Iterator[_Assumption]:
    """Whether pixel (0, 0) is the corner or the centre of the first pixel: half a pixel of x0 and y0."""
    camera = material.record.camera
    origin = material.results.project.cameras[camera.name].pixel_origin
    other = "centre" if origin == "corner" else "corner"
    declared = f"pixel (0, 0) is the {origin} of the first pixel"
    for item in material.parameters:
        if kind_of(item.parameter) == "principal_point" and item.sigma:
            otherwise = f"the {other}: {short_name(item)}"
            yield _Assumption(item, declared, otherwise, 0.5 * camera.pixel_um, "µm", 1e-3)


def _north(material: CertificateMaterial) -> Iterator[_Assumption]:
    """Whether attitudes count from true or grid north: the convergence of the meridians in the yaw.

    Where the convergence differs enough between the exposures the tests of the model tell.
    """
    tests = material.results.model_alternatives
    told = tests[(tests["quantity"] == "convergence") & (tests["detectable"] < 1.0)]
    project = material.results.project
    frame = MapFrame.of(project.project.crs, project.project.heights)
    places = material.images[["x_m", "y_m", "z_m"]].to_numpy(np.float64)
    if frame.is_local or len(places) == 0 or len(told):
        return
    angle = float(np.rad2deg(np.mean(frame.convergence(places))))
    references = sorted(
        {item.angles.reference for item in project.inputs.exposures if item.angles is not None}
    )
    declared = f"angles refer to {' and '.join(name.replace('-', ' ') for name in references)}"
    for item in material.parameters:
        if item.parameter == "boresight_yaw" and item.sigma:
            yield _Assumption(item, declared, f"the other north: {short_name(item)}", abs(angle), "°", 1.0)
