"""Tests of the model: what it may lack, what this flight cannot detect, and what no flight can."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tasks.calibration.record import CalibratedParameter
from tasks.coordinates.crs import MapFrame
from tasks.document_kit.table import Column, Number, Row, Table, decimals_for, text_column
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


def assumption_table(material: CertificateMaterial) -> Table:
    """Declarations whose opposite fits every flight as well, with what it would change."""
    columns = (
        text_column("assumption", "declared, and assumed to be correct"),
        text_column("otherwise", "otherwise"),
        Column("change", "changes by"),
        text_column("unit", "unit"),
        Column("in_sigma", "in σ"),
    )
    note = "No observation of this flight can verify these: they are as correct as their declaration."
    rows = (*_origin(material), *_north(material))
    return Table("assumptions", "Assumptions", columns, rows, note)


def _origin(material: CertificateMaterial) -> tuple[Row, ...]:
    """Whether pixel (0, 0) is the corner or the centre of the first pixel: half a pixel of x0 and y0."""
    camera = material.record.camera
    origin = material.results.project.cameras[camera.name].pixel_origin
    other = "centre" if origin == "corner" else "corner"
    return tuple(
        _row(
            item,
            f"pixel (0, 0) is the {origin} of the first pixel",
            f"the {other}: {short_name(item)}",
            0.5 * camera.pixel_um,
            "µm",
            1e-3,
        )
        for item in material.parameters
        if kind_of(item.parameter) == "principal_point" and item.sigma is not None
    )


def _north(material: CertificateMaterial) -> tuple[Row, ...]:
    """Whether attitudes count from true or grid north: the convergence of the meridians in the yaw.

    Where the convergence differs enough between the exposures the tests of the model tell.
    """
    tests = material.results.model_alternatives
    told = tests[(tests["quantity"] == "convergence") & (tests["detectable"] < 1.0)]
    project = material.results.project
    frame = MapFrame.of(project.project.crs, project.project.heights)
    places = material.images[["x_m", "y_m", "z_m"]].to_numpy(np.float64)
    if frame.is_local or len(places) == 0 or len(told):
        return ()
    angle = float(np.rad2deg(np.mean(frame.convergence(places))))
    references = sorted(
        {item.angles.reference for item in project.inputs.exposures if item.angles is not None}
    )
    words = " and ".join(name.replace("-", " ") for name in references)
    return tuple(
        _row(
            item,
            f"angles refer to {words}",
            f"the other north: {short_name(item)}",
            abs(angle),
            "°",
            1.0,
        )
        for item in material.parameters
        if item.parameter == "boresight_yaw" and item.sigma is not None
    )


def _row(
    item: CalibratedParameter, assumption: str, otherwise: str, change: float, unit: str, factor: float
) -> Row:
    """A change in a unit with its factor to the unit of the record."""
    sigma = item.sigma or float("nan")
    cells = (
        assumption,
        otherwise,
        Number(change, decimals_for(change)),
        unit,
        Number(change * factor / sigma, 1),
    )
    return Row(f"{item.parameter}@{item.entity}", cells)
