"""The verdict: its sentence, the result in brief, reasons, remarks and the limits it is based on.

Limits of the flight are those of `tasks.settings.calibration.AcceptanceLimits`, limits of the results the
gates of the project. Tests that state their own limits in words stand with the verdict.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from adjust.parameters import FAMILIES, INTERIOR_ORIENTATION
from tasks.calibration.evidence import LEAST_REDUNDANCY, SEVERAL
from tasks.calibration.record import CalibratedParameter, CalibrationRecord
from tasks.calibration.verdicts import REFUSED, RESTRICTED
from tasks.document_kit.table import Cell, Column, Number, Row, Table, decimals_for, text_column
from tasks.documents.certificate import quantities
from tasks.documents.certificate.content import Block, Fact, Facts, Listing, Section, Sentences, Words
from tasks.documents.certificate.coverage import coverage_of
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.certificate.quantities import finding, has_result, in_order, quantity_of
from tasks.documents.certificate.words import in_words
from tasks.documents.report.figures import gate_words
from tasks.documents.report.material import IMAGE_POINTS
from tasks.quantities import (
    COMPONENTS,
    KINDS,
    entity_words,
    group_words,
    is_additional,
    kind_of,
    quantity_words,
    unit_words,
)
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
        *_of_pattern(material, limits),
        *_of_groups(material, limits),
        *_of_global_test(material),
        *_of_model(material, limits),
        *_of_gates(material),
    )
    note = (
        "σ as certified, including the parameters that were held fixed. The global test does not decide: "
        "with many degrees of freedom it fails where σ0 differs from 1 by far less than matters; the σ0 of "
        "each group of observations decides. A calibration that meets these "
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
    decides: bool = True,
) -> Row:
    """A figure with its lower and upper limit; a missing one meets none, and refuses where that decides."""
    lower, upper = bounds
    kept = value is not None and (lower is None or value >= lower) and (upper is None or value <= upper)
    cells = (
        words,
        Number(value, decimals),
        "" if lower is None else Number(lower, decimals),
        "" if upper is None else Number(upper, decimals),
        unit,
        "met" if kept else "not met" if decides else "not met, not decisive",
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


def _of_pattern(material: CertificateMaterial, limits: AcceptanceLimits) -> Iterator[Row]:
    """Flight directions and heights, where what is calibrated needs them."""
    if not any(group.group == "gnss_positions" for group in material.results.figures.groups):
        return
    record = material.record
    known = {kind_of(item.parameter) for item in record.estimated}
    if any(kind.needs_headings for name, kind in KINDS.items() if name in known):
        directions = float(len(record.flight.headings_deg))
        yield _row(
            "headings", "number of flight directions", directions, (float(limits.headings), None), decimals=0
        )
    arm_and_point = {"principal_point", "lever_arm"} <= known
    if record.flight.heights_m and ("focal_length" in known or arm_and_point):
        ratio = max(record.flight.heights_m) / min(record.flight.heights_m)
        # An accepted rig needed none: its heads look in different directions.
        if ratio >= limits.height_ratio or not record.heads or record.verdict == "refused":
            yield _row(
                "height_ratio",
                "highest over lowest flying height",
                ratio,
                (limits.height_ratio, None),
                decimals=1,
            )


def _of_groups(material: CertificateMaterial, limits: AcceptanceLimits) -> Iterator[Row]:
    """σ0 of each group of observations, and the rejected part of it, where the verdict tests them."""
    factor = limits.sigma0_factor
    for group in material.results.figures.groups:
        enough = (group.redundancy or 0.0) >= LEAST_REDUNDANCY
        if group.group in _OBSERVED and group.sigma0 is not None and enough:
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
        if own.mean() > limits.rejected_part and own.sum() < SEVERAL:
            continue
        part = 100.0 * float(own.mean())
        words = f"rejected {group_words(str(name))}"
        yield _row(f"rejected:{name}", words, part, (None, 100.0 * limits.rejected_part), "%", 1)


def _of_global_test(material: CertificateMaterial) -> Iterator[Row]:
    test, sigma0 = material.results.figures.global_test, material.results.summary.sigma0
    if test is not None and test.lower is not None and test.upper is not None:
        words = f"σ0 of the adjustment, global test at {100 * test.confidence:g} %"
        yield _row("global_test", words, sigma0, (test.lower, test.upper), decimals=3, decides=False)


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


_VERDICTS = {
    "determined": "determined",
    "weak": "weakly determined",
    "not_determinable": "not determinable",
    "held": "held",
}

_IN_THEIR_TABLE = "See the table of additional parameters."


def verdict_sentence(record: CalibrationRecord) -> str:
    """The verdict in one sentence."""
    if record.verdict == "accepted":
        return "Accepted: the flight meets the requirements of a calibration flight."
    if record.verdict == "restricted":
        number = len(record.restrictions)
        what = "one restriction" if number == 1 else f"{number} restrictions"
        return f"Accepted with {what}, which must be observed."
    if len(record.reasons) == 1:
        return f"Not accepted: {in_words(record.reasons[0])}"
    number = len(record.reasons)
    words = f"Not accepted, for {number} reasons." if number else "Not accepted."
    return f"{words} None of the values may be used."


def reasons_section(material: CertificateMaterial) -> Section | None:
    """Why the calibration is not accepted, or what restricts its use, before everything else."""
    record = material.record
    named = (("Not accepted, because", record.reasons), ("Restrictions of use", record.restrictions))
    blocks = tuple(
        Sentences(heading, tuple(in_words(item) for item in items)) for heading, items in named if items
    )
    return Section("reasons", "Verdict", blocks) if blocks else None


def brief_section(material: CertificateMaterial) -> Section:
    """The main parameters with their expanded uncertainty, for the first page."""
    facts = [fact for family in FAMILIES for fact in _of_family(material, family)]
    additional = [item for item in material.parameters if is_additional(item.parameter)]
    if additional:
        count = Number(sum(has_result(item) for item in additional))
        offered = Number(len(additional))
        facts.append(Fact("additional", "additional parameters kept", (count, offered), "offered", " of "))
    heading = "Result in brief"
    if material.record.verdict == "refused":
        heading += ", refused and must not be used"
    blocks: list[Block] = [Facts("result", "", tuple(facts))]
    if any(" ± " in fact.joint for fact in facts):
        blocks.append(Words(f"{coverage_of(material).words} Standard deviations σ are given below.", "note"))
    return Section("brief", heading, tuple(blocks))


def _of_family(material: CertificateMaterial, family: str) -> list[Fact]:
    """One fact for each parameter of a family; one for all of an entity without any remark."""
    own = quantities.in_order(tuple(item for item in material.parameters if quantities.is_of(item, family)))
    facts, k = list[Fact](), coverage_of(material).k
    for entity in dict.fromkeys(item.entity for item in own):
        items = [item for item in own if item.entity == entity]
        words = {finding(item) for item in items}
        if len(items) > 1 and len(words) == 1 and not any(has_result(item) for item in items):
            together = ", ".join(quantity_of(item).words for item in items)
            said = [replace(_brief(items[0], k), label=_label(items[0], together))]
        else:
            said = [_brief(item, k) for item in items]
        is_head = bool(material.record.heads) and entity in material.record.names
        facts += [replace(fact, label=f"{fact.label} ({entity})") for fact in said] if is_head else said
    return facts


def _label(item: CalibratedParameter, words: str) -> str:
    """A quantity with the name of its kind, and of a flight where it belongs to one."""
    if quantities.is_of(item, INTERIOR_ORIENTATION):
        return words
    component = COMPONENTS[item.parameter]
    if component.direction:
        words = f"{quantity_words(component.kind.name)}, {words}"
    return f"{words} (flight {item.entity})" if component.kind.entity_kind == "flight" else words


def _brief(item: CalibratedParameter, k: float) -> Fact:
    """A parameter as value ± U in the unit of the value, U = k σ; one without a result in words."""
    quantity = quantity_of(item)
    label = _label(item, quantity.words)
    key = f"{item.parameter}@{item.entity}"
    if not has_result(item) or item.sigma is None:
        return Fact(key, label, (finding(item),))
    expanded = k * item.sigma * quantity.value.factor
    decimals = decimals_for(expanded)
    values = (Number(item.value * quantity.value.factor, decimals), Number(expanded, decimals))
    return Fact(key, label, values, quantity.value.unit, " ± ")


def verdict_section(material: CertificateMaterial) -> Section:
    """Verdict, the finding for each parameter, and the limits of the project."""
    record = material.record
    blocks: list[Block] = [Words(verdict_sentence(record))]
    blocks.append(Listing(determinability_table(material), ("because",)))
    blocks.append(Listing(limit_table(material)))
    if record.remarks:
        blocks.append(Sentences("Remarks", tuple(in_words(remark) for remark in record.remarks)))
    said = {*record.remarks, *record.reasons, *record.restrictions}
    problems = tuple(
        in_words(problem)
        for problem in material.results.summary.problems
        if problem.removeprefix(REFUSED).removeprefix(RESTRICTED) not in said
    )
    if problems:
        blocks.append(Sentences("Remarks of the adjustment", problems))
    return Section("verdict", "Limits and verdict", tuple(blocks))


def determinability_table(material: CertificateMaterial) -> Table:
    """What the flight could determine: one row for each kind of verdict and reason."""
    columns = (
        text_column("parameters", "parameters"),
        text_column("verdict", "verdict"),
        text_column("because", "because"),
    )
    together: dict[tuple[str, str], list[str]] = {}
    for item in quantities.in_order(material.parameters):
        words = "eliminated" if item.status == "eliminated" else _VERDICTS[item.verdict]
        # There may be scores of additional parameters; their σ are in a table of their own.
        plain = is_additional(item.parameter) and item.verdict in ("determined", "held")
        because = _IN_THEIR_TABLE if plain else in_words(item.because)
        together.setdefault((words, because), []).append(quantities.short_name(item))
    rows = []
    for number, ((words, because), names) in enumerate(together.items(), start=1):
        cells: tuple[Cell, ...] = (", ".join(dict.fromkeys(names)), words, because)
        rows.append(Row(f"{number}", cells))
    return Table("determinability", "What this flight could determine", columns, tuple(rows))
