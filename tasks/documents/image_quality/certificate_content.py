"""The content of the radiometric certificate, from tables and figures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import cast

from tasks.document_kit.table import Cell, Number
from tasks.documents.certificate.content import (
    Block,
    CertificateContent,
    Fact,
    Facts,
    Figure,
    Listing,
    Section,
    Sentences,
    Signature,
    Signatures,
    Words,
)
from tasks.documents.image_quality import plots
from tasks.documents.image_quality.material import QualityMaterial, SceneMaterial, SensorMaterial
from tasks.documents.image_quality.quality_tables import (
    column_table,
    pixel_table,
    resolution_table,
    sheet_table,
    transfer_table,
)
from tasks.files.json_text import JSON, json_text
from tasks.image_quality.radiometric_record import (
    RadiometricQuantity,
    RadiometricRecord,
    digest_of,
)
from tasks.store.artifact import Artifact

FILE = "radiometric_certificate"
_ROLES = ("Responsible for the examination", "Approved")
_LISTED = 200


def radiometric_record(
    stages: Sequence[Mapping[str, Artifact]],
    material: QualityMaterial,
    name: str,
    software: Mapping[str, str],
) -> Mapping[str, JSON]:
    """The basis of the certificate: camera, verdict, quantities, digests of all tables, software."""
    camera, identity = material.settings.camera or name, material.settings.identity
    tables = {
        name: artifact.sha256 for outputs in stages for name, artifact in outputs.items() if name != "notes"
    }
    figures = {
        name: dict(part.figures)
        for name, part in (("scenes", material.scenes), ("sensor", material.sensor))
        if part is not None
    }
    settings = material.settings.key_content()
    about = RadiometricRecord(
        camera=camera,
        body=None if identity is None else identity.body,
        lens=None if identity is None else identity.lens,
        product="virtual_image" if identity is None else identity.product,
        examined=material.settings.examined,
        verdict="accepted" if material.sensor is None or material.sensor.figures["passed"] else "refused",
        quantities=tuple(_quantities(material)),
    )
    return {
        **cast(Mapping[str, JSON], about.model_dump(mode="json")),
        "tables": dict(tables),
        "figures": figures,
        "settings": settings,
        "software": dict(software),
    }


def _quantities(material: QualityMaterial) -> Iterator[RadiometricQuantity]:
    """The figures that another date can be compared with."""
    if material.scenes is not None:
        for _, row in material.scenes.whole.iterrows():
            degrees = row["edges"] - 1.0 if row["method"] == "model" else None
            yield _quantity(row["band"], "factor", row["factor"], row["sigma_factor"], "px", degrees)
    if material.sensor is None:
        return
    for _, row in material.sensor.sheets.iterrows():
        if row["sheet"] in _KEPT:
            quantity, unit = _KEPT[row["sheet"]]
            degrees = row["degrees_of_freedom"]
            yield _quantity(row["band"], quantity, row["value"], row["sigma"], unit, degrees)


_KEPT = {
    "defect_pixels": ("defect_pixels", ""),
    "defect_columns_single": ("defect_columns_single", ""),
    "defect_columns_double": ("defect_columns_double", ""),
    "sensitivity": ("sensitivity", "grey values/ms"),
    "noise": ("read_noise", "electrons"),
    "aperture": ("light_at_corners", ""),
}


def _quantity(
    band: int, quantity: str, value: float, sigma: float | None, unit: str, degrees: float | None
) -> RadiometricQuantity:
    known = sigma is not None and math.isfinite(sigma)
    return RadiometricQuantity(
        band=int(band),
        quantity=quantity,
        value=float(value),
        sigma=float(cast(float, sigma)) if known else None,
        unit=unit,
        degrees_of_freedom=None if degrees is None or not math.isfinite(degrees) else float(degrees),
    )


def radiometric_content(
    material: QualityMaterial, record: Mapping[str, JSON], name: str
) -> CertificateContent:
    """The certificate of a sensor, with the resolution of scenes where there are any."""
    sensor, scenes, settings = material.sensor, material.scenes, material.settings
    assert sensor is not None  # a certificate is written of a sensor
    passed = bool(sensor.figures["passed"])
    sections = [
        _identity(material),
        *([] if passed else [_reasons(sensor)]),
        Section("sheets", "Sheets", (Listing(sheet_table(sensor), wide=("unit",)),)),
        *([] if not len(sensor.transfer) else [_transfer(sensor)]),
        *([] if not len(sensor.aperture) else [_aperture(sensor)]),
        *([] if scenes is None or not len(scenes.whole) else [_resolution(scenes)]),
        _lists(sensor),
        _verification(),
    ]
    return CertificateContent(
        camera=settings.camera or name,
        project=name,
        verdict="accepted" if passed else "refused",
        sentence=_sentence(sensor),
        code=digest_of(json_text(cast(JSON, dict(record)))),
        sections=tuple(sections),
        kind="radiometric",
        file=FILE,
    )


def _sentence(sensor: SensorMaterial) -> str:
    missed = int((~sensor.sheets["passed"]).sum())
    if not missed:
        return f"All {len(sensor.sheets)} thresholds are met."
    return f"{missed} of {len(sensor.sheets)} thresholds are not met."


def _reasons(sensor: SensorMaterial) -> Section:
    missed = sensor.sheets[~sensor.sheets["passed"]]
    items = tuple(
        f"{str(row['sheet']).replace('_', ' ')} of band {row['band']}: {row['largest_residual']:.4g}, "
        f"threshold {row['threshold']:.4g}"
        for _, row in missed.iterrows()
    )
    return Section("reasons", "Verdict", (Sentences("Not met", items),))


def _identity(material: QualityMaterial) -> Section:
    settings, scenes = material.settings, material.scenes
    day: tuple[Cell, ...] = () if settings.examined is None else (settings.examined.isoformat(),)
    facts = [Fact("camera", "camera", () if settings.camera is None else (settings.camera,))]
    numbers = (
        {} if settings.identity is None else {"body": settings.identity.body, "lens": settings.identity.lens}
    )
    facts += [Fact(name, name, (number,)) for name, number in numbers.items() if number is not None]
    facts.append(Fact("examined", "date of the images", day))
    if settings.sensor is not None:
        facts.append(Fact("kind", "sensor", (settings.sensor.kind,)))
    if scenes is not None:
        facts.append(Fact("size", "columns, rows", tuple(Number(size) for size in scenes.size)))
        facts.append(Fact("images", "images of scenes", (Number(cast(int, scenes.figures["images"])),)))
    return Section("identity", "Camera", (Facts("identity", "", tuple(facts)),))


def _transfer(sensor: SensorMaterial) -> Section:
    drawing = plots.transfer_plot(sensor)
    figure = Figure("transfer", "Photon transfer", "Variance of the grey values against the signal", drawing)
    return Section("transfer", "Photon transfer", (Listing(transfer_table(sensor)), figure))


def _aperture(sensor: SensorMaterial) -> Section:
    drawing = plots.aperture_plot(sensor)
    figure = Figure("aperture", "Aperture", "Light against the distance from the middle", drawing)
    words = "The table of correction, 32 × 48 cells of each band, is aperture.parquet."
    return Section("aperture", "Aperture correction", (figure, Words(words, "note")))


def _resolution(scenes: SceneMaterial) -> Section:
    edges = tuple(
        Figure(
            f"edges-{band}", f"Edges of band {band} over the format", "Edges coloured by their factor", drawn
        )
        for band, drawn in plots.edge_maps(scenes).items()
    )
    drawing = plots.response_plot(scenes)
    response = Figure("response", "Response", "Response against spatial frequency", drawing)
    table = Listing(resolution_table(scenes))
    return Section("resolution", "Effective resolution", (table, *edges, response))


def _lists(sensor: SensorMaterial) -> Section:
    blocks: list[Block] = []
    if len(sensor.pixels):
        blocks.append(Listing(pixel_table(sensor, _LISTED)))
    if len(sensor.columns):
        blocks.append(Listing(column_table(sensor)))
    if not blocks:
        blocks.append(Words("There are no defect pixels or columns."))
    return Section("defects", "Defects", tuple(blocks))


def _verification() -> Section:
    words = Words(
        "The verification code is the SHA-256 of the record in the JSON file, which has the digests of all "
        "tables, the settings and the figures.",
        "note",
    )
    places = (Signature("Place, date"), *(Signature(role) for role in _ROLES))
    return Section("verification", "Verification", (words, Signatures(places)))
