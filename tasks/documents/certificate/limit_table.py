"""The limits of a calibration: value, limit, and whether it is met.

Limits of the flight are those of `tasks.settings.calibration.AcceptanceLimits`, limits of the results the
gates of the project. Tests that state their own limits in words stand with the verdict.
"""

from __future__ import annotations

from collections.abc import Iterator

from tasks.calibration.record import CalibrationRecord
from tasks.document_kit.table import Column, Number, Row, Table, decimals_for, text_column
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.certificate.quantities import in_order, quantity_of
from tasks.documents.report.figures import gate_words
from tasks.documents.report.material import IMAGE_POINTS
from tasks.quantities import KINDS, entity_words, group_words, kind_of, unit_words
from tasks.settings.calibration import AcceptanceLimits

_OBSERVED = (IMAGE_POINTS, "control_points", "gnss_positions", "ins_attitudes")
#: The gate that stands for all limits of the flight together.
_TOGETHER = "missed_limits_of_calibration"


def limit_table(material: CertificateMaterial) -> Table:
    """One row for each limit; empty cells where there is no lower or no upper one."""
    columns = (
        text_column("figure", "limit of"),
        Column("value", "value"),
        Column("lower", "from"),
        Column("upper", "to"),
        text_column("unit", "unit"),
        text_column("kept", "limit is"),
    )
    limits = material.results.project.calibration.limits
    rows = (
        *_of_sigmas(material),
        *_of_pattern(material.record, limits),
        *_of_groups(material, limits),
        *_of_global_test(material),
        *_of_model(material, limits),
        *_of_gates(material),
    )
    note = (
        "σ as certified, including the parameters that were held fixed. A calibration that meets these "
        "limits may still be refused because of its check points, the second step or suspected errors in the "
        "deliveries; the reasons are given on the first page."
    )
    return Table("limits", "Limits of the calibration flight and of the results", columns, rows, note)


def _row(
    key: str,
    words: str,
    value: float | None,
    bounds: tuple[float | None, float | None],
    unit: str = "",
    decimals: int = 2,
) -> Row:
    """A figure with its lower and upper limit; a missing one meets none."""
    lower, upper = bounds
    kept = value is not None and (lower is None or value >= lower) and (upper is None or value <= upper)
    cells = (
        words,
        Number(value, decimals),
        "" if lower is None else Number(lower, decimals),
        "" if upper is None else Number(upper, decimals),
        unit,
        "met" if kept else "not met",
    )
    return Row(key, cells)


def _of_sigmas(material: CertificateMaterial) -> Iterator[Row]:
    """σ of each estimated parameter, whether it has a result, and the ratio to its prior σ."""
    figures = material.results.figures.calibration
    limits = material.results.project.calibration.limits
    found = {} if figures is None else {(item.parameter, item.entity): item for item in figures.parameters}
    for item in in_order(material.parameters):
        judged = found.get(item.key)
        if judged is None or judged.sigma is None:
            continue
        quantity = quantity_of(item)
        words, key = f"σ of {entity_words(*item.key)}", f"sigma:{item.parameter}@{item.entity}"
        if judged.limit is not None:
            sigma, limit = (value * quantity.fine.factor for value in (judged.sigma, judged.limit))
            decimals = decimals_for(min(sigma, limit), 3)
            yield _row(key, words, sigma, (None, limit), quantity.fine.unit, decimals)
        if judged.sigma_over_prior is not None:
            bounds = (None, limits.sigma_over_prior)
            yield _row(f"{key}:prior", f"{words} / σ before", judged.sigma_over_prior, bounds)


def _of_pattern(record: CalibrationRecord, limits: AcceptanceLimits) -> Iterator[Row]:
    """Flight directions and heights, where what is calibrated needs them."""
    known = {kind_of(item.parameter) for item in record.estimated}
    if any(kind.needs_headings for name, kind in KINDS.items() if name in known):
        directions = float(len(record.flight.headings_deg))
        yield _row(
            "headings", "number of flight directions", directions, (float(limits.headings), None), decimals=0
        )
    arm_and_point = {"principal_point", "lever_arm"} <= known
    if record.flight.heights_m and ("focal_length" in known or arm_and_point):
        ratio = max(record.flight.heights_m) / min(record.flight.heights_m)
        yield _row(
            "height_ratio",
            "highest over lowest flying height",
            ratio,
            (limits.height_ratio, None),
            decimals=1,
        )


def _of_groups(material: CertificateMaterial, limits: AcceptanceLimits) -> Iterator[Row]:
    """σ0 of each group of observations, and the part of it that was rejected."""
    factor = limits.sigma0_factor
    for group in material.results.figures.groups:
        if group.group in _OBSERVED and group.sigma0 is not None:
            words = f"σ0 of the {group_words(group.group)}"
            yield _row(f"sigma0:{group.group}", words, group.sigma0, (1.0 / factor, factor))
    residuals = material.results.residuals
    entered = residuals[residuals["group"].isin(_OBSERVED) & (residuals["status"] != "not_used")]
    wrong = (
        entered["status"]
        .eq("rejected")
        .groupby([entered["group"], entered["image"], entered["point"]], dropna=False, sort=False)
    )
    for name, own in wrong.any().groupby(level="group", sort=False):
        part = 100.0 * float(own.mean())
        words = f"rejected {group_words(str(name))}"
        yield _row(f"rejected:{name}", words, part, (None, 100.0 * limits.rejected_part), "%", 1)


def _of_global_test(material: CertificateMaterial) -> Iterator[Row]:
    test, sigma0 = material.results.figures.global_test, material.results.summary.sigma0
    if test is not None and test.lower is not None and test.upper is not None:
        words = f"σ0 of the adjustment, global test at {100 * test.confidence:g} %"
        yield _row("global_test", words, sigma0, (test.lower, test.upper), decimals=3)


def _of_model(material: CertificateMaterial, limits: AcceptanceLimits) -> Iterator[Row]:
    """What the significant errors of the model move, together and each by itself."""
    figures = material.results.figures
    if figures.moved_by_findings is not None:
        each = [item.moved_by for item in figures.model_findings]
        each += [item.moved_by for item in figures.strip_scatter]
        largest = max(figures.moved_by_findings, *each, 0.0)
        words = "significant model errors change a parameter by at most"
        yield _row("model", words, largest, (None, limits.moved_sigmas), "σ", 1)


def _of_gates(material: CertificateMaterial) -> Iterator[Row]:
    for gate in material.results.summary.gates:
        if gate.name != _TOGETHER:
            bounds = (None, gate.limit) if gate.bound == "max" else (gate.limit, None)
            words, unit = f"{gate_words(gate.name)} (project)", unit_words(gate.unit)
            yield _row(f"{gate.name}:{gate.bound}", words, gate.value, bounds, unit, 3)
