"""The verdict: its sentence, the result in brief, reasons, remarks and the limits it is based on."""

from __future__ import annotations

from dataclasses import replace

from adjust.parameters import FAMILIES, INTERIOR_ORIENTATION
from tasks.calibration.record import CalibratedParameter, CalibrationRecord
from tasks.calibration.verdicts import REFUSED, RESTRICTED
from tasks.document_kit.table import Cell, Number, Row, Table, decimals_for, text_column
from tasks.documents.certificate import quantities
from tasks.documents.certificate.content import Block, Fact, Facts, Listing, Section, Sentences, Words
from tasks.documents.certificate.coverage import coverage_of
from tasks.documents.certificate.limit_table import limit_table
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.certificate.quantities import finding, has_result, quantity_of
from tasks.documents.certificate.words import in_words
from tasks.quantities import COMPONENTS, is_additional, quantity_words

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
