"""System calibration: what the flight determines, the stages of release, and both methods side by side."""

from __future__ import annotations

from collections.abc import Collection

from tasks.calibration.verdicts import REFUSED, RESTRICTED
from tasks.document_kit.row_table import number_of, table_of, text_of
from tasks.document_kit.table import Table, decimals_for
from tasks.documents.report.material import Material
from tasks.quantities import quantity_words
from tasks.results.calibration_figures import (
    CalibrationFigures,
    CalibrationVerdictFigure,
    ComparedStepFigure,
    ReleaseFigure,
)

_VERDICTS = {"not_determinable": "not determinable"}
_PARAMETER = text_of("parameter", "parameter", lambda item: quantity_words(item.parameter))


def calibration_tables(material: Material) -> tuple[Table, ...]:
    """Verdicts, releases, and the comparison with two steps; without a calibration nothing."""
    found = material.figures.calibration
    if found is None:
        return ()
    return _verdicts(material, found), _releases(found), _steps(found)


def against(material: Material, said: Collection[str]) -> tuple[str, ...]:
    """The reasons that refuse or restrict a calibration, without those that the page has already given."""
    found = material.figures.calibration
    if found is None:
        return ()
    of_both = ((REFUSED, found.reasons), (RESTRICTED, found.restrictions))
    return tuple(f"{verdict}{one}" for verdict, reasons in of_both for one in reasons if one not in said)


def _verdicts(material: Material, found: CalibrationFigures) -> Table:
    """Values with as many decimals as give σ two digits; what is not determinable has none."""
    rows_of = {(row["parameter"], row["entity"]): row for row in material.parameters.to_dict("records")}

    def change(item: CalibrationVerdictFigure) -> float | None:
        known = item.sigma is not None and item.verdict != "not_determinable"
        return rows_of[item.parameter, item.entity]["change"] if known else None

    shown = (
        _PARAMETER,
        text_of("entity", "of"),
        number_of("change", "change", decimals="sigma", plus=True, of=change),
        number_of("sigma", "σ", decimals="sigma"),
        number_of("limit", "limit of σ", decimals="limit"),
        number_of("sigma_over_prior", "σ/σ prior", decimals=2),
        text_of("unit", "unit", lambda item: rows_of[item.parameter, item.entity]["unit"]),
        number_of("correlation", "strongest correlation", decimals=2, plus=True),
        text_of("correlated_with", "with", lambda item: quantity_words(item.correlated_with or "")),
        text_of("verdict", "verdict", lambda item: _VERDICTS.get(item.verdict, item.verdict)),
    )
    judged = [item for item in found.parameters if item.verdict != "held"]
    held = len(found.parameters) - len(judged)
    note = f"{held} more are held at their given values." if held else ""
    caption = "Parameters determined by this flight"
    return table_of("calibration", caption, shown, judged, "{parameter}@{entity}", note)


def _releases(found: CalibrationFigures) -> Table:
    stages = [{"stage": number, "release": one} for number, one in enumerate(found.releases, start=1)]
    shown = (
        text_of("stage", "stage"),
        text_of("free", "free", lambda row: _free(row["release"])),
        text_of("additional", "additional parameters", lambda row: row["release"].additional),
        text_of("held", "then held fixed, with reason", lambda row: _held(row["release"])),
    )
    return table_of("calibration-releases", "Parameters freed step by step", shown, stages, "{stage}")


def _free(release: ReleaseFigure) -> str:
    return ", ".join(quantity_words(name) for name in release.free) or "nothing"


def _held(release: ReleaseFigure) -> str:
    return " ".join(f"{quantity_words(name)}: {why}" for name, why in release.held.items()) or "nothing"


def _steps(found: CalibrationFigures) -> Table:
    def digits(item: ComparedStepFigure) -> int:
        return decimals_for(min(item.one_step_sigma, item.two_step_sigma))

    shown = (
        _PARAMETER,
        text_of("entity", "of"),
        number_of("one_step", "one step", decimals=digits),
        number_of("one_step_sigma", "σ", decimals=digits),
        number_of("two_step", "two steps", decimals=digits),
        number_of("two_step_sigma", "σ", decimals=digits),
        number_of("difference", "difference", decimals=digits, plus=True),
        number_of("t", "t", decimals=1, plus=True),
        text_of("unit", "unit"),
    )
    compared = () if found.two_step is None else found.two_step.parameters
    caption = "One-step and two-step calibration"
    return table_of("calibration-steps", caption, shown, compared, "{parameter}@{entity}")
