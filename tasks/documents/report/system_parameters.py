"""System parameters with their σ and status."""

from __future__ import annotations

from tasks.document_kit.row_table import flag_of, number_of, omitted, table_of, text_of
from tasks.document_kit.table import Table
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
    listed = estimated.head(MOST_ROWS)
    eliminated = int((table["status"] == "eliminated").sum())
    held = len(table) - len(estimated) - eliminated
    notes = []
    if len(listed) < len(estimated):
        notes.append(omitted(listed, estimated, "parameters.parquet"))
    if held:
        more = " more" if len(estimated) else ""
        notes.append(f"{held}{more} are held at their given values (parameters.parquet).")
    if eliminated:
        were = "additional parameter was" if eliminated == 1 else "additional parameters were"
        notes.append(f"{eliminated} {were} eliminated (see self-calibration).")
    if material.figures.calibration is not None:
        notes.append(
            "σ, t and status are those of this adjustment alone; the certificate tests with its larger σ, to "
            "which the parameters held fixed contribute."
        )
    shown = (
        text_of("parameter", "parameter", lambda row: quantity_words(row["parameter"])),
        text_of("entity", "of"),
        number_of("value", "value", decimals="sigma"),
        number_of("sigma", "σ", decimals="sigma"),
        number_of("change", "change", decimals="sigma", plus=True),
        number_of("t", "t", decimals=1, plus=True),
        number_of("sigma_prior", "σ prior", decimals="sigma_prior"),
        text_of("unit", "unit"),
        text_of("status", "status", lambda row: _WORDS.get(row["status"], row["status"])),
    )
    caption = "Estimated system parameters"
    return table_of("parameters", caption, shown, listed, "{parameter}@{entity}", " ".join(notes))


_USES = {"consider": "considered", "prior": "observed"}


def registered_table(material: Material) -> Table:
    """Whether the block contradicts the calibrations of the registry, camera by camera."""
    shown = (
        text_of("camera", "camera"),
        text_of("use", "its values are", lambda item: _USES[item.use]),
        number_of("parameters", "parameters"),
        number_of("statistic", "T", decimals=1),
        number_of("freedom", "degrees of freedom"),
        number_of("probability", "exceeded by chance", "%", 2, factor=100.0),
        flag_of("contradicted", "contradicts the block"),
    )
    note = (
        "T compares the calibrated values and their covariance with the values from the block; below 0.1 % "
        "they contradict each other."
    )
    found, caption = material.figures.registered_calibrations, "Calibrations from the registry"
    return table_of("registered-calibrations", caption, shown, found, "{camera}", note)
