"""The verdict on a run: one line, then problems, limits, figures, parameters, and what to do."""

from __future__ import annotations

from collections.abc import Mapping

from tasks.dashboard.lights import Light, lit
from tasks.dashboard.markdown import in_one_line, link, render
from tasks.dashboard.run import EndedRun
from tasks.figures import CalibrationVerdictFigure
from tasks.quality_gates import GateResult
from tasks.quantities import quantity_words, unit_words, with_unit
from tasks.report.figures import gate_words
from tasks.report.table import Number, decimals_for, numbers

#: Rows of a table of parameters, so that the artifact stays small; sentences among the problems.
MOST_PARAMETERS = 60
MOST_PROBLEMS = 40
_DETERMINED: Mapping[str, tuple[Light | None, str]] = {
    "determined": ("good", "determined"),
    "weak": ("attention", "weak"),
    "not_determinable": ("bad", "not determinable"),
}
_STATUS: Mapping[str, tuple[Light | None, str]] = {
    "significant": (None, "significant"),
    "not_significant": (None, "not significant"),
    "prior_only": ("attention", "known from its prior only"),
    "not_determinable": ("bad", "not determinable"),
}
_REMEDIES: Mapping[str, str] = {
    "InputError": "Correct what the message names, then run again. A delivery is begun again when its file "
    "DELIVERED is written anew. Nothing of an earlier result was changed.",
    "NotComputable": "Deliver more observations, or free fewer parameters (the message names them), then run "
    "again. Nothing of an earlier result was changed.",
    "GateFailed": "Read the problems and the report. The results are there; whether they may be used is a "
    "decision of yours. The same input gives the same answer, so running again changes nothing.",
    "Failed": "The machine or aerocal is at fault, not the delivery: see message and log of the run. "
    "Run again when it is mended; finished stages are taken up.",
}
#: Pages of a run, by their names in the manifest, the most important first.
PAGES: Mapping[str, str] = {
    "report": "Report",
    "georeferencing_check": "Direct-georeferencing check",
    "sweep.html": "Scenarios",
}
_FOR_PEOPLE = (".html", ".pdf", ".svg")


def verdict_markdown(run: EndedRun) -> str:
    """The artifact as Markdown."""
    problems = () if run.summary is None or not run.has_results else run.summary.problems
    return render(
        "verdict.md.j2",
        run=run,
        verdict=verdict_line(run),
        problems=problems[:MOST_PROBLEMS],
        more_problems=max(len(problems) - MOST_PROBLEMS, 0),
        sigma0=_sigma0(run),
        gates=[_gate_row(gate) for gate in run.summary.gates] if run.summary is not None else [],
        figures=_figures(run),
        check=_check_rows(run),
        scenarios=_scenarios(run),
        calibration=run.figures.calibration,
        parameters=_parameters(run)[:MOST_PARAMETERS],
        more_parameters=max(len(_parameters(run)) - MOST_PARAMETERS, 0),
        links=[link(words, address) for words, address in page_links(run)],
        pages=[one.path.name for one in run.published.values() if one.path.suffix in _FOR_PEOPLE],
        remedy=_REMEDIES.get(run.state),
    )


def verdict_line(run: EndedRun) -> str:
    """Light, state and reason in one line of plain text."""
    light, why = _verdict(run)
    return in_one_line(f"{lit(light, run.state)}: {why}")


def page_links(run: EndedRun) -> list[tuple[str, str]]:
    """Words and address of every page of the run that is served."""
    found = []
    for name, artifact in run.published.items():
        words, address = _page_words(name), run.address(artifact)
        if words and address is not None:
            found.append((list(PAGES).index(name) if name in PAGES else len(PAGES), words, address))
    return [(words, address) for _, words, address in sorted(found)]


def _page_words(name: str) -> str:
    if name.startswith("certificate") and name.endswith(".html"):
        of = name.removesuffix(".html").removeprefix("certificate").strip("_")
        return f"Certificate of {of}" if of else "Certificate"
    return PAGES.get(name, "")


def _verdict(run: EndedRun) -> tuple[Light, str]:
    """Light and reason."""
    if run.summary is None or not run.has_results:
        return "bad", run.message
    if run.state not in ("Completed", "GateFailed"):
        return "bad", run.message
    gates = run.summary.gates
    missed = [gate for gate in gates if not gate.passed]
    if missed:
        named = "; ".join(_missed_words(gate) for gate in missed)
        of = f"{len(missed)} of {len(gates)} limits" if len(gates) > 1 else "the only limit is"
        return "bad", f"{of} not kept: {named}."
    kept = f"all {len(gates)} limits are kept" if gates else "no limits are set in the project"
    beyond = run.summary.missed_checks
    if beyond is not None:
        return "attention", f"{kept}, but the {beyond} are beyond their limits."
    test, sigma0 = run.figures.global_test, run.summary.sigma0
    if test is not None and not test.passed and sigma0 is not None and test.upper is not None:
        side = "larger" if sigma0 > test.upper else "smaller"
        return "attention", f"{kept}, but the residuals are {side} than the stated σ allow."
    return "good", f"{kept}."


def _missed_words(gate: GateResult) -> str:
    if gate.value is None:
        return f"{gate_words(gate.name)} (no such figure)"
    sign = "≤" if gate.bound == "max" else "≥"
    value, limit = _sized(gate)
    return f"{gate_words(gate.name)} {value} (limit {sign} {limit})"


def _sized(gate: GateResult) -> tuple[str, str]:
    """Value and limit with their unit; a number of things has no decimals."""
    decimals = 0 if gate.name.startswith("missed_") else 3
    unit = unit_words(gate.unit)
    value = Number(gate.value, decimals)
    limit = with_unit(Number(gate.limit, decimals), unit)
    return with_unit(value, unit) if value.exists else str(value), limit


def _gate_row(gate: GateResult) -> tuple[str, str, str, str]:
    """Figure, value, limit, verdict."""
    sign, (value, limit) = "≤" if gate.bound == "max" else "≥", _sized(gate)
    words = "kept" if gate.passed else ("not kept" if gate.value is not None else "not kept: no such figure")
    return (
        gate_words(gate.name),
        value,
        f"{sign} {limit}",
        lit("good" if gate.passed else "bad", words),
    )


def _sigma0(run: EndedRun) -> str | None:
    """σ0 with the limits of the global test, a sentence; None without an adjustment."""
    summary, test = run.summary, run.figures.global_test
    if summary is None or summary.sigma0 is None:
        return None
    words = f"σ0 = {Number(summary.sigma0, 3)}"
    if summary.sigma0_um is not None:
        words += f" ({Number(summary.sigma0_um, 2)} µm, {Number(summary.sigma0_px, 2)} px in the image)"
    if test is None or test.lower is None or test.upper is None:
        return words
    limits = f"the stated σ allow {test.lower:.3f} to {test.upper:.3f} ({100 * test.confidence:g} %)"
    return f"{words}; {limits}: " + lit(
        "good" if test.passed else "attention", "agrees" if test.passed else "does not agree"
    )


def _figures(run: EndedRun) -> list[tuple[str, str]]:
    """Counts, and differences at surveyed points; only what there is."""
    summary = run.summary
    if summary is None or summary.sigma0 is None:
        return []
    counts = summary.counts
    rows: list[tuple[str, str]] = [
        (words, str(Number(count)))
        for words, count in (
            ("images", counts.images),
            ("object points", counts.object_points),
            ("image points", counts.image_points),
            ("rejected observations", counts.rejected),
            ("control points", counts.control),
            ("check points", counts.check),
            ("redundancy", summary.redundancy),
            ("iterations", summary.iterations),
        )
        if count is not None
    ]
    for words, three in (
        ("RMS at control points, east, north, up", summary.rmse_control_m),
        ("RMS at check points, east, north, up", summary.rmse_check_m),
        ("largest difference at check points", summary.max_check_m),
    ):
        if three is not None:
            rows.append((words, _metres(three)))
    return rows


def _metres(three: tuple[float | None, ...]) -> str:
    return f"{', '.join(str(number) for number in numbers(three, 3))} m"


def _check_rows(run: EndedRun) -> list[tuple[str, str, str]]:
    """Figures of a direct-georeferencing check with what was predicted."""
    check = run.check
    if check is None:
        return []
    rows: list[tuple[str, str, str]] = []
    if check.count:
        low, high = (numbers(values, 3) for values in (check.predicted_low_m, check.predicted_high_m))
        ranges = ", ".join(f"{a}–{b}" for a, b in zip(low, high, strict=True))
        rows.append(
            (
                f"RMS at {check.count} independent points, east, north, up",
                _metres(check.rmse_m),
                f"{ranges} m",
            )
        )
        rows.append(("largest difference there", _metres(check.max_m), ""))
    if check.y_parallaxes:
        parallax = (check.y_parallax_predicted_low_um, check.y_parallax_predicted_high_um)
        expected = "–".join(str(number) for number in numbers(parallax, 1))
        rows.append(("RMS of the y-parallaxes", f"{Number(check.y_parallax_rms_um, 1)} µm", f"{expected} µm"))
        largest = Number(check.y_parallax_predicted_max_limit_um, 1)
        words = f"up to {largest} µm" if largest.exists else ""
        rows.append(("largest y-parallax", f"{Number(check.y_parallax_max_um, 1)} µm", words))
    return rows


def _scenarios(run: EndedRun) -> str | None:
    """How many scenarios of a sweep have a result; None if it is no sweep."""
    sweep = None if run.summary is None else (run.summary.model_extra or {}).get("sweep")
    if not isinstance(sweep, list):
        return None
    done = sum(isinstance(row, Mapping) and row.get("status") == "done" for row in sweep)
    return f"{done} of {len(sweep)} scenarios have a result."


def _parameters(run: EndedRun) -> list[tuple[str, str, str, str, str]]:
    """Estimated parameters: name, entity, value, σ, verdict; those of a calibration with its verdict."""
    summary = run.summary
    if summary is None or not summary.parameters:
        return []
    calibration = run.figures.calibration
    judged: Mapping[tuple[str, str], CalibrationVerdictFigure] = (
        {}
        if calibration is None
        else {(item.parameter, item.entity): item for item in calibration.parameters}
    )
    rows = []
    for item in summary.parameters:
        entity = item.entity or ""
        verdict = judged.get((item.parameter, entity))
        if calibration is not None and (verdict is None or verdict.verdict == "held"):
            continue
        known = _STATUS if verdict is None else _DETERMINED
        word = item.status if verdict is None else verdict.verdict
        if word is None or word not in known or (calibration is None and item.sigma is None):
            continue
        exists = word != "not_determinable" and item.sigma is not None
        decimals = decimals_for(item.sigma)
        value = Number(item.value if exists else None, decimals)
        rows.append(
            (
                quantity_words(item.parameter),
                entity,
                f"{value} {item.unit or ''}".strip(),
                str(Number(item.sigma, decimals)),
                lit(*known[word]),
            )
        )
    return rows
