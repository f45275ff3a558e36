"""The verdict in one sentence, and the key figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from tasks.document_kit.row_table import flag_of, number_of, table_of, text_of
from tasks.document_kit.table import Column, Row, Table, numbers, text_column
from tasks.documents.report.causes import Cause, by_place
from tasks.documents.report.figures import gate_words
from tasks.documents.report.material import IMAGE_POINTS, Material
from tasks.quantities import group_words, unit_words
from tasks.remarks.adjustment import beside_limits
from tasks.results.figures import AdjustmentFigures
from tasks.results.quality_gates import GateResult

Tone: TypeAlias = Literal["good", "attention", "failed"]


@dataclass(frozen=True)
class Verdict:
    """The verdict on the result in one sentence.

    Attributes
    ----------
    tone : ``good``; ``attention`` (the global test fails, or nothing could be tested); ``failed`` (a gate).
    sentence : for people.
    """

    tone: Tone
    sentence: str


def verdict(material: Material, causes: Sequence[Cause] = ()) -> Verdict:
    """Gates, global test and other contradictions in one sentence."""
    gates = material.summary.gates
    free = material.figures.free_network
    what = "The free network" if free is not None and free.defect else "The block"
    failed = [gate_words(gate.name) for gate in gates if not gate.passed]
    test, good = _test_words(material)
    missed = material.summary.missed_checks
    if missed is not None:
        test, good = f"the {missed} are beyond their limits, {'although' if good else 'and'} {test}", False
    if any(item.contradicted for item in material.figures.registered_calibrations):
        test, good = f"{test}; it contradicts a calibration of the registry", False
    link = "and" if good else "but"
    if causes:
        places = len(by_place(causes))
        things = "one thing contradicts" if places == 1 else f"{places} things contradict"
        test, good = f"{test}, {'but' if good else 'and'} {things} the rest", False
    if failed:
        named = "; ".join(failed)
        of = f"{len(failed)} of {len(gates)} limits" if len(gates) > 1 else "the only limit"
        return Verdict("failed", f"{what} is adjusted, but {of} failed ({named}); {test}.")
    passed = ""
    if gates:
        passed = f"all {len(gates)} limits passed, " if len(gates) > 1 else "the only limit passed, "
    return Verdict("good" if good else "attention", f"{what} is adjusted, {passed}{link} {test}.")


def rejection_note(figures: AdjustmentFigures) -> str:
    """What was rejected in each pass, and what was not."""
    if figures.critical_value is None:
        return "Nothing was rejected: rejection is off (adjustment.rejection)."
    kept = (
        ", except what control points that contradict each other explain"
        if figures.inseparable_control
        else ""
    )
    passes = ", ".join(map(str, figures.rejected_per_pass)) or "none"
    return (
        f"Observations with |w| above {figures.critical_value} were rejected{kept}; rejected in each pass: "
        f"{passes}."
    )


def _test_words(material: Material) -> tuple[str, bool]:
    """The global test in words, and whether it is passed."""
    sigma0, test = material.summary.sigma0, material.figures.global_test
    if sigma0 is None or test is None or test.lower is None or test.upper is None:
        return "nothing could be tested because the block has no redundancy", False
    found, lower, upper = beside_limits(sigma0, test.lower, test.upper)
    limits = f"σ0 = {found}, allowed {lower} to {upper}, {100 * test.confidence:g}\u00a0%"
    others = _other_sigmas(material)
    if test.passed:
        sigmas = "the estimated σ, not with all stated ones" if others else "the stated σ"
        return f"the residuals agree with {sigmas} ({limits})", True
    side, sigmas = "larger" if sigma0 > test.upper else "smaller", "estimated" if others else "stated"
    return f"the residuals are {side} than expected from the {sigmas} σ ({limits})", False


def _other_sigmas(material: Material) -> bool:
    """Whether variance components have replaced a stated σ by one from which it differs significantly."""
    found = material.figures.variance_components
    factors = () if found is None else found.components
    return any(
        item.factor_lower is not None
        and item.factor_upper is not None
        and not item.factor_lower <= 1.0 <= item.factor_upper
        for item in factors
    )


def key_table(material: Material) -> Table:
    """The figures of the whole block."""
    summary, figures = material.summary, material.figures
    counts = summary.counts
    rms = figures.image_rms_px or (None, None)
    height = material.oriented["z_m"] - material.oriented["ground_m"]
    free = figures.free_network
    redundancy = f"redundancy n − u + {free.defect}" if free and free.defect else "redundancy n − u"
    rows = [
        _row("sigma0", "σ0 a posteriori / a priori", "", (summary.sigma0,), 3),
        _row("sigma0_um", "σ0 of an image coordinate", "µm", (summary.sigma0_um,), 2),
        _row("sigma0_px", "σ0 of an image coordinate", "px", (summary.sigma0_px,), 3),
        _row("sigma_relative_um", "σ relative: of the image points only", "µm", (relative_um(material),), 3),
        _row("sigma_absolute_um", "σ absolute: of all observations", "µm", (summary.sigma0_um,), 3),
        _row("image_rms_px", "RMS of the image residuals x, y", "px", rms, 3),
        _row("redundancy", redundancy, "", (summary.redundancy,), 0),
        _row("images", "images", "", (counts.images,), 0),
        _row("object_points", "object points", "", (counts.object_points,), 0),
        _row("image_points", "image points used", "", (counts.image_points,), 0),
        _row("rejected", "rejected observations", "", (counts.rejected,), 0),
        _row("control", "control points", "", (counts.control,), 0),
        _row("check", "check points", "", (counts.check,), 0),
        _row(
            "rmse_control_m",
            f"RMS at control points x, y, z{_of_one(counts.control)}",
            "m",
            _three(summary.rmse_control_m),
            3,
        ),
        _row(
            "rmse_check_m",
            f"RMS at check points x, y, z{_of_one(counts.check)}",
            "m",
            _three(summary.rmse_check_m),
            3,
        ),
        _row("rays_control", "rays of a control point, mean", "", (_mean_rays(material, False),), 1),
        _row("rays_check", "rays of a check point, mean", "", (_mean_rays(material, True),), 1),
        _row("gsd_m", "ground sampling distance, median", "m", (material.gsd_m,), 3),
        _row("height_m", "height above ground, median", "m", (float(height.median()),), 0),
        _row("iterations", "iterations", "", (summary.iterations,), 0),
        _row("critical_value", "critical value of the rejection", "", (figures.critical_value,), 2),
        _row("sigma_scaled_by", "factor of all standard deviations", "", (figures.sigma_scaled_by,), 3),
    ]
    columns = (
        text_column("figure", "figure"),
        text_column("unit", "unit"),
        *(Column(f"value_{index}", heading) for index, heading in enumerate(("value, or x", "y", "z"))),
    )
    return Table("key-figures", "Figures of the whole block", columns, tuple(rows))


def relative_um(material: Material) -> float | None:
    """σ of an image coordinate from the residuals and the redundancy of the image points alone."""
    sigma0, um = material.summary.sigma0, material.summary.sigma0_um
    own = next((group.sigma0 for group in material.figures.groups if group.group == IMAGE_POINTS), None)
    return None if own is None or um is None or not sigma0 else own * um / sigma0


def _mean_rays(material: Material, is_check: bool) -> float | None:
    """Of the points that were used."""
    table = material.check_points if is_check else material.control_residuals
    table = table if is_check or table.empty else table[table["status"] == "used"]
    return float(table["rays"].mean()) if len(table) else None


def _of_one(points: int | None) -> str:
    """A warning after figures of a single point, which say nothing about the others."""
    return " (of ONE point: not an accuracy)" if points == 1 else ""


def _three(values: tuple[float | None, ...] | None) -> tuple[float | None, ...]:
    return values if values is not None else (None, None, None)


def _row(key: str, words: str, unit: str, values: tuple[float | None, ...], decimals: int) -> Row:
    """A row with one to three values; columns beyond them stay empty."""
    empty = ("",) * (3 - len(values))
    return Row(key, (words, unit, *numbers(values, decimals), *empty))


def group_table(material: Material) -> Table:
    """The observation groups."""
    shown = (
        text_of("group", "observation group", lambda item: group_words(item.group)),
        number_of("observations", "observed components"),
        number_of("redundancy", "redundancy", decimals=1),
        number_of("sigma0", "σ0 of the group", decimals=3),
        number_of("rejected", "rejected"),
        number_of("uncontrolled", "uncontrolled"),
    )
    return table_of("groups", "Observation groups", shown, material.figures.groups, "{group}")


def gate_table(gates: Sequence[GateResult]) -> Table:
    """The limits of the project, and whether they are met."""
    shown = (
        text_of("gate", "limit of", lambda gate: gate_words(gate.name)),
        number_of("value", "value", decimals=_digits),
        text_of("bound", "", lambda gate: "≤" if gate.bound == "max" else "≥"),
        number_of("limit", "limit", decimals=_digits),
        text_of("unit", "unit", lambda gate: unit_words(gate.unit)),
        flag_of("passed", "verdict", "met", "not met"),
    )
    return table_of("gates", "Limits set in the project", shown, gates, "{name}:{bound}")


def _digits(gate: GateResult) -> int:
    """Decimals that show the whole limit, and a value beyond it as another number; none of counts."""
    if gate.value is not None and gate.limit.is_integer() and gate.value.is_integer():
        return 0
    limit = len(f"{gate.limit:.6f}".rstrip("0").partition(".")[2])
    words = beside_limits(gate.limit if gate.value is None else gate.value, gate.limit)
    beyond = 0 if gate.passed or gate.value is None else len(words[0].partition(".")[2])
    return max(3, limit, beyond)
