"""Carry out ``aerocal export`` and report what was written."""

from __future__ import annotations

from pathlib import Path
from typing import cast, get_args

from rich.console import Console
from rich.text import Text

from flows.command.exit_code import DONE
from flows.command.screen_table import screen
from tasks.errors import InputError
from tasks.handover.delivery import Angles
from tasks.handover.export import Export, export_results
from tasks.nearest_name import did_you_mean
from tasks.settings.deliver import AngleOrder, AngleUnit


def write_export(
    results: Path, to: str, out: Path | None, world: str | None, order: str, unit: str, *, force: bool
) -> int:
    """Write and show the statement; wrong input raises InputError."""
    angles = Angles(
        cast(AngleOrder, _one_of(order, get_args(AngleOrder), "--angles")),
        cast(AngleUnit, _one_of(unit, get_args(AngleUnit), "--unit")),
    )
    show_export(screen(), export_results(results, to, out, world, angles, force=force))
    return DONE


def show_export(console: Console, written: Export) -> None:
    """The statement, and where the files are."""
    console.print(Text(written.statement))
    count = len(written.files)
    shown = ", ".join(written.files[:4]) + (f" and {count - 4} more" if count > 4 else "")
    console.print(Text(f"{shown} and HANDOVER.txt are in {written.folder}."), soft_wrap=True)


def _one_of(text: str, known: tuple[str, ...], option: str) -> str:
    if text not in known:
        raise InputError(f"'{text}' is not known.", did_you_mean(text, list(known)), entity=option)
    return text
