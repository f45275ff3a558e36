"""``aerocal flight-check``: whether this installation is sound."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flows.command.exit_code import end_with
from flows.command.options import FOLDER, Seed, SpecificationOverrides


def flight_check(
    source: Annotated[
        str, typer.Argument(metavar="[PRESET|SPEC.toml]", help="Name of a preset, or a specification.")
    ] = "uce-low",
    out: Annotated[Path, typer.Option(**FOLDER, help="Folder for the simulated project.")] = Path(
        "flight-check"
    ),
    overrides: SpecificationOverrides = None,
    seed: Seed = None,
    calibrate: Annotated[
        bool, typer.Option("--calibrate", help="Run the system calibration and its checks.")
    ] = False,
) -> None:
    """Simulate a flight, adjust it (or calibrate from it), and compare every estimate with its true value.

    If the installation is correct, the errors agree with the stated standard deviations.

    [bold]Examples[/bold]

      aerocal flight-check

      aerocal flight-check uce-calibration --calibrate

      aerocal flight-check dmc-burn-in --out trial --seed 7

    [bold]Exit codes[/bold]  0 agrees with the true values · 2 wrong specification · 4 contradicts the true
    values
    """
    from flows.command.truth_table import check_and_show

    end_with(lambda: check_and_show(source, out, tuple(overrides or ()), seed, calibrates=calibrate))
