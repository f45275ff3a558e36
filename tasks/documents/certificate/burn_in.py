"""The burn-in protocol: platform calibration and triangulation of the virtual images.

Made of the sections of the certificate, with a published protocol next to it. The title weighs all evidence:
the report's verdict on the triangulation, and the verdict of the platform calibration.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd

from tasks.calibration.record import Verdict
from tasks.document_kit.row_table import number_of, numbers_of, table_of, text_of
from tasks.document_kit.table import Column, Number, Row, Table, numbers, text_column
from tasks.documents.certificate.content import (
    Block,
    CertificateContent,
    Fact,
    Facts,
    Listing,
    Section,
    Sentences,
    Signature,
    Signatures,
    Words,
)
from tasks.documents.certificate.origin_section import software_table
from tasks.documents.certificate.statistics_section import facts_of, statistics_section, statistics_table
from tasks.documents.report.causes import causes
from tasks.documents.report.figures import gate_words
from tasks.documents.report.key_figures import Tone, verdict
from tasks.documents.report.material import Material
from tasks.quantities import KINDS, unit_words, with_unit
from tasks.results.calibration_figures import CalibrationFigures
from tasks.results.quality_gates import GateResult
from tasks.settings.published_sweep import PublishedTable

FILE = "burn_in_protocol"
_ANGLES = ("omega", "phi", "kappa")
_SYMBOLS = ("ω", "φ", "κ")


def burn_in_content(
    results: Material,
    platform: pd.DataFrame,
    calibration: CalibrationFigures,
    published: PublishedTable | None,
    code: str,
    software: Mapping[str, str],
) -> CertificateContent:
    """The complete protocol.

    Parameters
    ----------
    results : of the triangulation with the virtual images.
    platform : platform.parquet.
    calibration : verdict of the platform calibration.
    published : a protocol to compare with; None: without comparison.
    code : digest of what the protocol is made from.
    """
    name = str(platform["platform"].iloc[0])
    missed = _missed(results.summary.gates, calibration)
    sections = [
        *([Section("reasons", "Verdict", (Sentences("Not met", missed),))] if missed else []),
        _camera(results, name),
        _platform(platform, published),
        _flight(results),
        statistics_section(results),
        *([] if published is None else [_comparison(results, published)]),
        _origin(software),
    ]
    found = verdict(results, causes(results))
    sentence = found.sentence
    if calibration.verdict != "accepted":
        sentence += f" The platform calibration is {calibration.verdict}."
    return CertificateContent(
        camera=name,
        project=results.project.project.name,
        verdict=title_verdict(found.tone, calibration.verdict),
        sentence=sentence,
        code=code,
        sections=tuple(sections),
        kind="burn_in",
        file=FILE,
    )


def title_verdict(triangulation: Tone, calibration: str) -> Verdict:
    """The worse of the report's verdict on the triangulation and that of the platform calibration."""
    if triangulation == "failed" or calibration == "refused":
        return "refused"
    return "accepted" if triangulation == "good" and calibration == "accepted" else "restricted"


def _missed(gates: Sequence[GateResult], calibration: CalibrationFigures) -> tuple[str, ...]:
    """Limits of the project that are not met, and evidence against the platform calibration."""
    of_gates = (
        f"{gate_words(gate.name)}: {gate.value if gate.value is None else format(gate.value, '.3f')}, limit "
        f"{with_unit(gate.limit, unit_words(gate.unit))}"
        for gate in gates
        if not gate.passed
    )
    against = (*calibration.reasons, *calibration.restrictions)
    return (*of_gates, *(f"Platform calibration: {sentence}" for sentence in against))


def _camera(results: Material, name: str) -> Section:
    camera = results.cameras[name]
    point = tuple(1e3 * value for value in camera.principal_point)
    facts = (
        Fact("focal_length_mm", "focal length", (Number(camera.focal_length * 1e3, 3),), "mm"),
        Fact("size_px", "columns × rows", (Number(camera.columns), Number(camera.rows)), "px", " × "),
        Fact("pixel_um", "pixel", (Number(camera.pixel_size * 1e6, 1),), "µm"),
        Fact("principal_point_mm", "principal point x, y", numbers(point, 3), "mm"),
        Fact("distortion", "distortion", ("none: removed by the composition",)),
    )
    words = (
        "The virtual image is composed of the images of the heads. Certificates of the heads must not be "
        "applied to it."
    )
    return Section("camera", "Virtual image", (Facts("camera", "", facts), Words(words, "note")))


def _platform(platform: pd.DataFrame, published: PublishedTable | None) -> Section:
    """Positions and attitudes of the heads, and the published attitudes of heads of the same names."""
    shown = [text_of("head", "head"), *numbers_of("{}_m", "XYZ", "m", "xyz", 3)]
    for name, symbol in zip(_ANGLES, _SYMBOLS, strict=True):
        shown.append(number_of(f"{name}_deg", symbol, "°", 5))
        shown.append(number_of(f"sigma_{name}_mdeg", "σ", "mdeg", 2, factor=1e3, of=f"sigma_{name}_deg"))
    note = (
        "Positions are held fixed. Rotation order ω (x), φ (y), κ (z), axes of the virtual image; the mean "
        "rotation of all heads relative to the given attitudes is zero."
    )
    tables = [table_of("platform", "Heads of the platform", shown, platform, "{head}", note)]
    if published is not None and set(platform["head"]) & published.heads.keys():
        tables.append(_published_heads(platform, published))
    return Section("platform", "Platform calibration", tuple(Listing(table) for table in tables))


def _published_heads(platform: pd.DataFrame, published: PublishedTable) -> Table:
    """The published attitudes, and the differences of ours from them."""
    rows = tuple(
        Row(
            str(head["head"]),
            (
                str(head["head"]),
                *numbers(known, 6),
                *numbers(
                    (1e3 * (head[f"{n}_deg"] - k) for n, k in zip(_ANGLES, known, strict=True)), 2, plus=True
                ),
            ),
        )
        for head in platform.to_dict("records")
        if (known := published.heads.get(str(head["head"]))) is not None
    )
    columns = (
        text_column("head", "head"),
        *(Column(f"published_{n}_deg", s, "°") for n, s in zip(_ANGLES, _SYMBOLS, strict=True)),
        *(
            Column(f"difference_{n}_mdeg", f"difference {s}", "mdeg")
            for n, s in zip(_ANGLES, _SYMBOLS, strict=True)
        ),
    )
    note = "Differences: this flight − published. A rotation of all heads together is not determined."
    return Table("published-heads", f"Published attitudes: {published.title}", columns, rows, note)


def _flight(results: Material) -> Section:
    images, free = results.oriented, results.project.adjustment.free
    height = float((images["z_m"] - images["ground_m"]).mean())
    camera = next(iter(results.cameras.values()))
    strips = images["strip"].value_counts()
    facts = (
        Fact("height_m", "flying height above ground", (Number(height, 0),), "m"),
        Fact("ground_m", "height of the ground", (Number(float(images["ground_m"].mean()), 0),), "m"),
        Fact("scale", "image scale 1 :", (Number(height / camera.focal_length, 0),)),
        Fact("gsd_m", "ground sampling distance", (Number(1e2 * results.gsd_m, 1),), "cm"),
        Fact("strips", "strips", (Number(len(strips)),)),
        Fact("exposures", "images in a strip", numbers(sorted(set(strips)), 0)),
        Fact("control", "control points", (Number(results.summary.counts.control),)),
        Fact("free", "corrections estimated", tuple(KINDS[name].words for name in free) or ("none",)),
        Fact("self_calibration", "self-calibration", ("none",)),
        Fact("rejection", "search for gross errors", (_rejection(results),)),
    )
    return Section("flight", "Burn-in flight", (Facts("flight", "", facts),))


def _rejection(results: Material) -> str:
    critical = results.project.adjustment.rejection.critical_value
    return "none" if critical is None else f"critical value {critical:g}"


def _comparison(results: Material, published: PublishedTable) -> Section:
    """Every figure of the published protocol next to ours."""
    own = {fact.key: fact for fact in facts_of(results)}
    single = tuple(
        Row(key, (own[key].label, *(own[key].values), Number(value, 3 if value % 1 else 0), own[key].unit))
        for key, value in published.facts.items()
        if key in own
    )
    facts = Table(
        "published-facts",
        "Key statistics",
        (
            text_column("figure", ""),
            Column("own", "this flight"),
            Column("published", "published"),
            text_column("unit", "unit"),
        ),
        single,
    )
    columns = (
        text_column("figure", ""),
        text_column("unit", "unit"),
        *(Column(f"own_{n}", s) for n, s in zip("xyz", ("X / ω", "Y / φ", "Z / κ"), strict=True)),
        *(
            Column(f"published_{n}", f"{s} publ.")
            for n, s in zip("xyz", ("X / ω", "Y / φ", "Z / κ"), strict=True)
        ),
    )
    rows = tuple(
        Row(row.key, (*row.cells[:5], *numbers(published.statistics[row.key], 3)))
        for row in statistics_table(results).rows
        if row.key in published.statistics
    )
    table = Table(
        "published-statistics", "RMS, largest residuals, mean σ and limits", columns, rows, published.source
    )
    blocks: list[Block] = [Listing(facts), Listing(table, ("figure",))]
    if published.remarks:
        blocks.append(Sentences("Remarks on the published protocol", published.remarks))
    return Section("published", f"Compared with {published.title}", tuple(blocks))


def _origin(software: Mapping[str, str]) -> Section:
    words = Words("The code is the SHA-256 of the digests of all tables this protocol is made from.", "note")
    places = Signatures((Signature("Place, date"), Signature("Responsible for the triangulation")))
    versions = software_table("software", "Software of this document", software)
    return Section("origin", "Origin", (Listing(versions), words, places))
