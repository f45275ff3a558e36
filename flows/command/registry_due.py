"""Carry out ``aerocal registry due``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import date

from rich.table import Table
from rich.text import Text

from flows.command.exit_code import DONE, GATE_FAILED
from flows.command.registry_actions import opened
from flows.command.screen_table import print_listed, screen, screen_table
from tasks.errors import InputError
from tasks.files.json_text import json_text
from tasks.nearest_name import did_you_mean
from tasks.registry.drift import DRIFT_LIMITS, DriftLimits
from tasks.registry.due import KINDS, CameraDue, DueLimits
from tasks.registry.watch import as_json as json_of
from tasks.registry.watch import watch_of


def show_due(
    within: int,
    max_age: int,
    sigma: float | None,
    limits: Sequence[str],
    without: Sequence[str],
    address: str | None,
    *,
    as_json: bool,
) -> int:
    """Print every camera and why it needs a calibration; returns the exit code of a gate."""
    wanted = DueLimits(within, max_age or None, drift_limits(sigma, limits), tuple(without))
    watch = watch_of(opened(address).contents(), date.today(), wanted)
    if as_json:
        print(json_text(json_of(watch), indent=2))
    else:
        console = screen()
        console.print(_table(watch.cameras))
        print_listed(console, watch.sentences, "yellow" if watch.due else "green", wrap=False)
    return GATE_FAILED if watch.due else DONE


def drift_limits(sigma: float | None, texts: Sequence[str]) -> DriftLimits:
    """Limits from their notation on the command line.

    Raises
    ------
    InputError
        If a text is not a known name, an equals sign and a positive number.
    """
    given: dict[str, float] = {}
    for text in texts:
        name, _, number = text.partition("=")
        if name not in DRIFT_LIMITS:
            raise InputError(f"There is no limit '{name}'.", did_you_mean(name, DRIFT_LIMITS))
        given[DRIFT_LIMITS[name]] = _positive(text, number)
    return DriftLimits(sigma, **given)


def _positive(text: str, number: str) -> float:
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"'{text}' has no positive number.", "Write for example --limit focal_length=5.")
    return value


def _table(cameras: Sequence[CameraDue]) -> Table:
    """Every camera and mounting, one a row."""
    table = screen_table(
        "camera", "mounting", "in force", "flown", "age [d]", "ends", "due", right=("age [d]",)
    )
    for one in cameras:
        held = one.in_force
        kinds = ", ".join(dict.fromkeys(KINDS[reason.kind] for reason in one.reasons))
        table.add_row(
            f"{one.camera}, {one.product}",
            one.mounting,
            "–" if held is None else str(held.id),
            "–" if held is None or held.flown is None else str(held.flown),
            "–" if one.age_days is None else str(one.age_days),
            "–" if one.ends is None else str(one.ends),
            Text(kinds, "bold yellow") if one.in_use else Text("mounting no longer in use"),
            style="" if one.in_use else "dim",
        )
    return table
