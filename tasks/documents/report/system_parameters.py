"""System parameters with their σ and status."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

from tasks.document_kit.table import Cell, Column, Row, Table, decimals_for, numbers, text_column
from tasks.documents.report.material import Material
from tasks.quantities import quantity_words

MOST_ROWS = 80
_WORDS = {
    "significant": "significant",
    "not_significant": "not significant",
    "eliminated": "eliminated",
    "fixed": "held at its given value",
    "considered": "held, its σ included in all others",
    "prior_only": "determined by its prior only: this block adds no information",
    "not_determinable": "not determinable: cannot be separated from others in this block",
}


def parameter_table(material: Material) -> Table:
    """The estimated parameters."""
    table = material.parameters
    estimated = table[table["sigma"].notna()]
    shown = estimated.head(MOST_ROWS)
    eliminated = int((table["status"] == "eliminated").sum())
    held = len(table) - len(estimated) - eliminated
    notes = []
    if len(shown) < len(estimated):
        notes.append(f"The first {len(shown)} of {len(estimated):,}; all in parameters.parquet.")
    if held:
        more = " more" if len(estimated) else ""
        notes.append(f"{held}{more} are held at their given values (parameters.parquet).")
    if eliminated:
        were = "additional parameter was" if eliminated == 1 else "additional parameters were"
        notes.append(f"{eliminated} {were} eliminated (see self-calibration).")
    columns = (
        text_column("parameter", "parameter"),
        text_column("entity", "of"),
        Column("value", "value"),
        Column("sigma", "σ"),
        Column("change", "change"),
        Column("t", "t"),
        Column("sigma_prior", "σ prior"),
        text_column("unit", "unit"),
        text_column("status", "status"),
    )
    rows = tuple(_row(row) for row in shown.to_dict("records"))
    return Table("parameters", "Estimated system parameters", columns, rows, " ".join(notes))


def _row(row: Mapping[Hashable, Any]) -> Row:
    """A parameter with as many decimals as give its σ two digits."""
    value, sigma, change, t, prior = (
        float(str(row[n])) for n in ("value", "sigma", "change", "t", "sigma_prior")
    )
    decimals = decimals_for(sigma)
    cells: tuple[Cell, ...] = (
        quantity_words(str(row["parameter"])),
        str(row["entity"]),
        *numbers((value,), decimals),
        *numbers((sigma,), decimals),
        *numbers((change,), decimals, plus=True),
        *numbers((t,), 1, plus=True),
        *numbers((prior,), decimals_for(prior)),
        str(row["unit"]),
        _WORDS.get(str(row["status"]), str(row["status"])),
    )
    return Row(f"{row['parameter']}@{row['entity']}", cells)


_USES = {"consider": "considered", "prior": "observed"}


def registered_table(material: Material) -> Table:
    """Whether the block contradicts the calibrations of the registry, camera by camera."""
    columns = (
        text_column("camera", "camera"),
        text_column("use", "its values are"),
        Column("parameters", "parameters"),
        Column("statistic", "T"),
        Column("freedom", "degrees of freedom"),
        Column("probability", "exceeded by chance", "%"),
        text_column("contradicted", "contradicts the block"),
    )
    rows = tuple(
        Row(
            item.camera,
            (
                item.camera,
                _USES[item.use],
                *numbers((item.parameters,), 0),
                *numbers((item.statistic,), 1),
                *numbers((item.freedom,), 0),
                *numbers((100.0 * item.probability,), 2),
                "yes" if item.contradicted else "no",
            ),
        )
        for item in material.figures.registered_calibrations
    )
    note = (
        "T compares the calibrated values and their covariance with the values from the block; below 0.1 % "
        "they contradict each other."
    )
    return Table("registered-calibrations", "Calibrations from the registry", columns, rows, note)
