"""Section of the calibrated parameters: values, change, σ and finding of each, and other conventions.

A parameter without a result (held, eliminated, not determinable) has no calibrated value and no σ: it is
fixed or unknown, and not perfectly known.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adjust.camera.interior import nominal_mounting
from adjust.geometry import rotation
from adjust.parameters import BORESIGHT, FAMILIES, GNSS_SHIFT, INTERIOR_ORIENTATION, TIME_OFFSET
from tasks.calibration.record import CalibratedParameter, RecordedHeld
from tasks.document_kit.row_table import number_of, table_of, text_of
from tasks.document_kit.table import Cell, Column, Number, Row, Table, decimals_for, numbers, text_column
from tasks.documents.certificate import quantities
from tasks.documents.certificate.additional_parameters import additional_blocks, distorting_sets
from tasks.documents.certificate.content import Block, Listing, Section, Words
from tasks.documents.certificate.coverage import coverage_of
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.certificate.quantities import change_over_sigma, finding, has_result, quantity_of
from tasks.documents.certificate.words import AXES_NOTE
from tasks.quantities import KINDS, entity_words, shown

_GON = 10.0 / 9.0
_SHIFT_NOTE = (
    "Error of the given positions, to be subtracted from them: antenna = projection centre + lever arm "
    "(rotated from body axes) + shift. As a correction to be added (like CX, CY, CZ of the program GPSPL, "
    "whose sign is not documented), each has the opposite sign."
)
_MISALIGNMENT_NOTE = (
    "R(camera) = R(INS) · Rz(yaw) Ry(pitch) Rx(roll) · T, a product of matrices; T = diag(1, −1, −1) · "
    "Rz({mount}°), body axes forward, right, down. Positive: right wing down, nose up, clockwise."
)

_WHY = (
    "The section on limits and verdict explains why a parameter is weakly determined or not determinable, "
    "and what to fly."
)


def parameter_section(material: CertificateMaterial) -> Section:
    """All calibrated quantities."""
    notes = {
        INTERIOR_ORIENTATION: _interior_note(material),
        BORESIGHT: _MISALIGNMENT_NOTE.format(mount=material.record.camera.mount_deg),
        GNSS_SHIFT: _SHIFT_NOTE,
        TIME_OFFSET: "The given positions refer to the time of exposure + Δt.",
    }
    k = coverage_of(material).k
    blocks: list[Block] = [Words(_reading(material), "note")]
    for family in FAMILIES:
        own = [item for item in quantities.in_order(material.parameters) if quantities.is_of(item, family)]
        if not own:
            continue
        caption, name = _caption(family, material), family.replace("_orientation", "").replace("_", "-")
        blocks.append(Listing(parameter_table(name, caption, own, notes.get(family, ""), k), ("finding",)))
        if family == BORESIGHT and any(has_result(item) for item in own):
            blocks.append(Listing(conventions_table(material, own), ("convention",)))
    blocks += additional_blocks(material)
    if len(material.strip_parameters):
        blocks.append(Words(_strip_words(material), "note"))
    if material.record.held:
        blocks.append(Listing(held_table(material), ("quantity", "moves")))
    if any(_needs_words(item) for item in material.parameters):
        blocks.append(Words(_WHY, "note"))
    return Section("parameters", "Calibrated parameters", tuple(blocks))


def held_table(material: CertificateMaterial) -> Table:
    """What was held, how well it is known, and the σ in which its share is largest."""
    columns = (
        text_of("quantity", "held", lambda item: entity_words(item.quantity, item.entity)),
        number_of("sigma", "declared σ", decimals=lambda item: decimals_for(_sigma(item)), of=_sigma),
        text_of("unit", "unit", lambda item: shown(item.unit).unit),
        text_of(
            "moves",
            "largest contribution to the σ of",
            lambda item: entity_words(item.moves, item.moves_entity),
        ),
        number_of("part", "part", "%", factor=100.0),
    )
    note = (
        f"{AXES_NOTE} Contributions add up in squares. How well each value is known is declared in the "
        "project, not a result."
    )
    caption, held = "Parameters held fixed, included in every σ", material.record.held
    return table_of("held-quantities", caption, columns, held, "{quantity}@{entity}", note)


def _sigma(item: RecordedHeld) -> float:
    return item.sigma * shown(item.unit).factor


def _caption(family: str, material: CertificateMaterial) -> str:
    """Heading of the parameters of a family."""
    if family == INTERIOR_ORIENTATION:
        return "Interior orientation"
    kind = next(kind for kind in KINDS.values() if kind.family == family)
    caption = kind.caption or f"{kind.words[0].upper()}{kind.words[1:]}"
    return f"{caption}, axes of {_axes(material)}" if family == GNSS_SHIFT else caption


def _axes(material: CertificateMaterial) -> str:
    crs = material.record.flight.crs
    return "the local system" if crs == "local" else f"the block (east, north, up; {crs})"


def _interior_note(material: CertificateMaterial) -> str:
    origin = material.results.project.cameras[material.record.camera.name].pixel_origin
    point = "corner" if origin == "corner" else "centre"
    return (
        "Origin at the format centre, x along increasing columns, y against increasing rows; pixel (0, 0) is "
        f"the {point} of the top-left pixel. A measured coordinate is corrected as x − x0 + Δ, Δ of the "
        f"additional parameters{' that are corrections' if distorting_sets(material.parameters) else ''}."
    )


def _reading(material: CertificateMaterial) -> str:
    confidence = material.results.project.adjustment.confidence
    known = any(has_result(item) for item in material.parameters)
    coverage = f"{coverage_of(material).words} " if known else ""
    return (
        "σ: standard deviation a posteriori, including the parameters held fixed (last table of this "
        f"section). {coverage}t: change divided by σ, tested two-sided at {100 * confidence:g} %: "
        "significant, or not significantly different from the value before. Held: not estimated, kept at "
        "the previous value. Eliminated: a candidate that was removed because the flight does not support "
        "it. Not determinable: no result. For these three, this calibration gives neither a value nor a σ."
    )


def parameter_table(
    name: str, caption: str, items: Sequence[CalibratedParameter], note: str, k: float
) -> Table:
    """One row for each parameter in customary units; k: coverage factor."""
    entities = {item.entity for item in items}
    columns = (
        text_column("quantity", "quantity"),
        text_column("symbol", ""),
        Column("given", "before"),
        Column("calibrated", "calibrated"),
        text_column("unit", ""),
        Column("change", "change"),
        Column("sigma", "σ"),
        Column("expanded", "U"),
        text_column("fine_unit", ""),
        Column("t", "t"),
        text_column("finding", "finding"),
    )
    rows = [_row(item, k, with_entity=len(entities) > 1) for item in items]
    return Table(name, caption, columns, tuple(rows), note)


def _row(item: CalibratedParameter, k: float, *, with_entity: bool) -> Row:
    quantity, known = quantity_of(item), has_result(item)
    decimals = _decimals(item)
    sigma = item.sigma * quantity.fine.factor if known and item.sigma is not None else None
    fine = decimals_for(sigma)
    value = item.value * quantity.value.factor if known else None
    change = (item.value - item.given) * quantity.fine.factor if known else None
    words = f"{quantity.words} ({item.entity})" if with_entity else quantity.words
    cells: tuple[Cell, ...] = (
        words,
        quantity.symbol,
        *numbers((item.given * quantity.value.factor, value), decimals),
        quantity.value.unit,
        Number(change, fine, plus=True),
        Number(sigma, fine),
        Number(None if sigma is None else k * sigma, decimals_for(None if sigma is None else k * sigma)),
        quantity.fine.unit if known else "",
        Number(change_over_sigma(item), 1, plus=True),
        finding(item),
    )
    return Row(f"{item.parameter}@{item.entity}", cells)


def _decimals(item: CalibratedParameter) -> int:
    """Decimals of the value: those that give its σ two digits."""
    quantity = quantity_of(item)
    if has_result(item) and item.sigma is not None:
        return decimals_for(item.sigma * quantity.value.factor)
    # What is held is printed as finely as what is usually determined.
    return quantity.value.decimals


def conventions_table(material: CertificateMaterial, items: Sequence[CalibratedParameter]) -> Table:
    """The misalignment as other programs write it, in degrees and gon."""
    by_name = {item.parameter: item for item in items}
    names = FAMILIES[BORESIGHT].components
    roll, pitch, yaw = (by_name[name].value if name in by_name else 0.0 for name in names)
    body_from_camera = nominal_mounting(material.record.camera.mount_deg)
    matrix = rotation.from_roll_pitch_yaw(np.deg2rad([roll, pitch, yaw]))
    image_side = np.rad2deg(rotation.to_omega_phi_kappa(body_from_camera.T @ matrix @ body_from_camera)) + 0.0
    columns = (
        text_column("convention", "convention"),
        text_column("angles", "angles"),
        *(Column(f"angle_{n}_deg", f"{n}.", "°") for n in (1, 2, 3)),
        *(Column(f"angle_{n}_gon", f"{n}.", "gon") for n in (1, 2, 3)),
    )
    both = (
        ("body", "Rz(yaw) Ry(pitch) Rx(roll), body axes, as above", "roll, pitch, yaw", (roll, pitch, yaw)),
        (
            "added",
            "added to the angles of the INS, as in the program GPSPL; equal to the above in level flight, "
            "otherwise different by the tilt times the misalignment",
            "CROLL, CPITCH, CYAW",
            (roll, pitch, yaw),
        ),
        (
            "image_side",
            "image side, R(camera) = R(INS) · T · Rx(ω) Ry(φ) Rz(κ), axes of the image: x = column, y = up",
            "ω, φ, κ",
            tuple(image_side.tolist()),
        ),
    )
    rows = tuple(
        Row(key, (words, angles, *numbers(deg, 5), *numbers((value * _GON for value in deg), 5)))
        for key, words, angles, deg in both
    )
    unknown = [quantity_of(item).words for item in items if not has_result(item)]
    note = f"With the previous value for {', '.join(unknown)}." if unknown else ""
    return Table("boresight-conventions", "The same misalignment in other conventions", columns, rows, note)


def _strip_words(material: CertificateMaterial) -> str:
    strips = material.strip_parameters
    parts = []
    for unit, own in strips.groupby("unit", sort=True):
        rms = float(np.sqrt(np.mean(own["value"].to_numpy(np.float64) ** 2)))
        prior = own["sigma_prior"].dropna()
        before = f", σ before {float(prior.median()):.3g} {unit}" if len(prior) else ""
        parts.append(f"{len(own)} values, RMS {rms:.3g} {unit}{before}")
    count = strips["entity"].nunique()
    return (
        f"Estimated with them, but valid for this flight only: GNSS biases or drifts of "
        f"{count} strip{'s' * (count != 1)} ({'; '.join(parts)}). The σ above include their uncertainty."
    )


def _needs_words(item: CalibratedParameter) -> bool:
    return bool(item.because) and item.verdict != "determined" and item.status != "eliminated"
