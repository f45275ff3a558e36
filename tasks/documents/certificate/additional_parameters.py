"""Additional parameters of a certificate: every one that was offered, with its decision and its effect."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from typing import Any

from adjust.camera.additional.register import REGISTER
from tasks.calibration.record import CalibratedParameter
from tasks.document_kit.table import Cell, Column, Number, Row, Table, decimals_for, numbers, text_column
from tasks.documents.certificate import quantities
from tasks.documents.certificate.content import Block, Listing
from tasks.documents.certificate.coverage import coverage_of
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.certificate.quantities import change_over_sigma, finding, has_result
from tasks.documents.report.self_calibration import common_level
from tasks.quantities import additional_set, is_additional


def additional_blocks(material: CertificateMaterial) -> list[Block]:
    """The table of additional parameters; nothing where the record has none."""
    own = [item for item in quantities.in_order(material.parameters) if is_additional(item.parameter)]
    if not own:
        return []
    return [Listing(additional_table(material, own), ("meaning", "finding"))]


def additional_table(material: CertificateMaterial, items: list[CalibratedParameter]) -> Table:
    """One row for each parameter in the unit its set is published in."""
    table = material.results.self_calibration
    offered = {} if table.empty else {(r["parameter"], r["entity"]): r for r in table.to_dict("records")}
    with_entity = len({item.entity for item in items}) > 1
    columns = (
        text_column("parameter", "parameter"),
        text_column("meaning", "meaning"),
        Column("value", "value"),
        Column("sigma", "σ"),
        Column("expanded", "U"),
        text_column("unit", "unit"),
        Column("t", "t"),
        Column("effect_max_um", "largest effect", "µm"),
        Column("effect_rms_um", "RMS effect", "µm"),
        text_column("finding", "finding"),
    )
    level = common_level(str(row["reason"]) for row in offered.values())
    k = coverage_of(material).k
    rows = tuple(_row(item, offered.get(item.key, {}), level, k, with_entity=with_entity) for item in items)
    turn = material.record.camera.calibration_axes_deg
    axes = (
        "the image axes" if turn == 0 else f"axes rotated by {turn}° counter-clockwise relative to the image"
    )
    note = f"The sum is the correction Δ of a measured coordinate, in {axes}; the image error is −Δ."
    forward = distorting_sets(items)
    if forward:
        note += (
            f" Those of {', '.join(forward)} are instead a distortion d of the ideal direction u, "
            "dimensionless like u: the measured coordinate plus Δ is c (u + d), with the focal length c of "
            "this certificate."
        )
    if level:
        note += f" Tests of t are {level}."
    return Table("additional-parameters", "Additional parameters", columns, rows, note)


def distorting_sets(items: Iterable[CalibratedParameter]) -> tuple[str, ...]:
    """Names of the sets among parameters that go from the ideal to the measured point."""
    names = dict.fromkeys(additional_set(item.parameter) for item in items)
    forward = (name for name, known in REGISTER.sets.items() if known.direction == "forward")
    return tuple(name for name in forward if name in names)


def _row(
    item: CalibratedParameter, offered: Mapping[Hashable, Any], level: str, k: float, *, with_entity: bool
) -> Row:
    known = has_result(item)
    # What is held acts on the image, too, where it is not zero.
    acts = known or (item.status == "fixed" and item.value != 0.0)
    sigma = item.sigma if known else None
    effects = [offered.get(name) if known else None for name in ("effect_max_um", "effect_rms_um")]
    decimals = decimals_for(sigma) if known else decimals_for(item.value, 4)
    cells: tuple[Cell, ...] = (
        f"{item.parameter} ({item.entity})" if with_entity else item.parameter,
        str(offered.get("meaning", "")),
        *numbers((item.value if acts else None, sigma), decimals),
        Number(None if sigma is None else k * sigma, decimals),
        "" if item.unit == "1" or not acts else item.unit,
        Number(change_over_sigma(item), 1, plus=True),
        *numbers(effects, 2),
        _finding(item, offered, level),
    )
    return Row(f"{item.parameter}@{item.entity}", cells)


def _finding(item: CalibratedParameter, offered: Mapping[Hashable, Any], level: str) -> str:
    """The finding; for eliminated ones the reason, without the level common to all tests."""
    reason = str(offered.get("reason", "")).removesuffix(f" ({level})")
    if item.status == "eliminated" and reason:
        return f"{finding(item)}: {reason}"
    return finding(item)
