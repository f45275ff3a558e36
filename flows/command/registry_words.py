"""Calibrations of a registry on the screen: tables of parameters, changes and history."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from flows.command.screen_table import screen_table
from tasks.document_kit.table import Number, decimals_for
from tasks.files.json_text import JSON, attributes
from tasks.quantities import quantity_words, shown
from tasks.registry.compatibility import Compatibility
from tasks.registry.contents import StoredCalibration
from tasks.registry.history import Validity

_STYLES = {"draft": "yellow", "approved": "green", "superseded": "dim"}


def changes_table(test: Compatibility) -> Table:
    """Every compared parameter with its change."""
    table = screen_table("parameter", "change", "± σ", "", "in σ", right=("change", "± σ", "in σ"))
    for change in test.changes:
        unit, factor, _ = shown(change.unit, "change")
        sigma = change.sigma * factor
        style = "bold yellow" if change.outstanding else ""
        table.add_row(
            change.words,
            str(Number(change.change * factor, decimals_for(sigma), plus=True)),
            str(Number(sigma, decimals_for(sigma))),
            unit,
            Text(str(Number(change.t, 1, plus=True)), style),
        )
    return table


def calibrations_table(items: Sequence[StoredCalibration]) -> Table:
    """Calibrations of one camera and mounting, one a row."""
    heads = ("ID", "ver.", "flown", "c [mm] ± σ [µm]", "state", "flights of")
    table = screen_table(*heads, right=("ID", "ver."))
    for item in items:
        refused = Text(", refused", "red") if item.record.verdict == "refused" else Text()
        table.add_row(
            str(item.id),
            str(item.version),
            "–" if item.flown is None else str(item.flown),
            focal_length(item),
            Text(item.state, _STYLES[item.state]) + refused,
            _days(item.validity),
        )
    return table


def focal_length(item: StoredCalibration) -> str:
    """The focal length, by which engineers recognise a camera."""
    for parameter in item.record.parameters:
        if (parameter.parameter, parameter.entity) == ("focal_length", item.record.camera.name):
            sigma = "held" if parameter.sigma is None else f"± {parameter.sigma * 1e3:.1f}"
            return f"{parameter.value:.4f} {sigma}"
    return "–"


def parameters_table(item: StoredCalibration, test: Compatibility | None) -> Table:
    """Every parameter of a calibration; those that were compared with their change."""
    changes = {} if test is None else {(change.parameter, change.head): change for change in test.changes}
    heads = ("parameter", "entity", "value", "± σ", "unit", "verdict", "change", "in σ")
    table = screen_table(*heads, right=("value", "± σ", "change", "in σ"))
    for one in item.record.parameters:
        decimals = 6 if one.sigma is None else decimals_for(one.sigma)
        head = "" if one.entity == item.record.camera.name else one.entity
        change = changes.get((one.parameter, head))
        style = "bold yellow" if change is not None and change.outstanding else ""
        table.add_row(
            quantity_words(one.parameter),
            one.entity,
            f"{one.value:g}" if one.sigma is None else str(Number(one.value, decimals)),
            "" if one.sigma is None else str(Number(one.sigma, decimals)),
            one.unit,
            one.verdict.replace("_", " "),
            "" if change is None else str(Number(change.change, decimals, plus=True)),
            "" if change is None else Text(str(Number(change.t, 1, plus=True)), style),
        )
    return table


def _days(validity: Validity | None) -> str:
    if validity is None:
        return "–"
    return f"{validity.start} –" + ("" if validity.end is None else f" {validity.end}")


def history_table(item: StoredCalibration) -> Table:
    """The history of a calibration."""
    table = screen_table("when (UTC)", "state", "flights of", "by", "note")
    for event in item.events:
        words = [event.note] if event.note else []
        words += [f"although refused: {event.although}"] if event.although else []
        words += [f"by calibration {event.successor}"] if event.successor is not None else []
        table.add_row(
            event.at[:16].replace("T", " "),
            event.state,
            _days(event.validity),
            event.person,
            "; ".join(words),
        )
    return table


def as_json(item: StoredCalibration) -> dict[str, JSON]:
    """A calibration for programs, its record included."""
    held = item.validity
    return {
        "id": item.id,
        "version": item.version,
        "digest": item.sealed.digest,
        "state": item.state,
        "valid_from": None if held is None else held.start.isoformat(),
        "valid_to": None if held is None or held.end is None else held.end.isoformat(),
        "history": [
            {
                **attributes(event, "state", "at", "note", "valid_from", "valid_to", "successor", "digest"),
                "by": event.person,
                "although": event.although or None,
            }
            for event in item.events
        ],
        "record": item.record.model_dump(mode="json"),
    }
