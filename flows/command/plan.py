"""``aerocal plan``: what a flight will determine, before it is flown."""

from __future__ import annotations

from typing import Annotated

import typer

from flows.command.exit_code import end_with
from flows.command.options import Data


def plan(
    source: Annotated[
        str,
        typer.Argument(
            metavar="PRESET|SPEC.toml|PROJECT.toml",
            help="A flight plan for the simulator, or a project with given orientations.",
        ),
    ],
    free: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME,…",
            help="Parameters to calibrate, as in [bold]calibration.free[/bold] of a project: focal_length, "
            "principal_point, boresight, gnss_shift, lever_arm …",
            show_default="calibration.free in the file",
        ),
    ] = None,
    additional: Annotated[
        str | None,
        typer.Option(
            metavar="SELECTION",
            help="Additional parameters to calibrate, e.g. [bold]bluh:1-12[/bold]; "
            "[bold]none[/bold] for none.",
            show_default="self_calibration of a project",
        ),
    ] = None,
    strip_bias: Annotated[
        float | None,
        typer.Option(
            metavar="M",
            min=0.0,
            help="σ of the GNSS error common to all images of a strip, m; [bold]0[/bold]: "
            "independent errors, which is too optimistic.",
            show_default="gnss_strip_bias_m of a project, otherwise 0.03; none if "
            "calibration.free does not contain gnss_strip_bias",
        ),
    ] = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Replace a value of the file, e.g. [bold]--set noise.gnss_m=0.02[/bold]. Repeatable.",
        ),
    ] = None,
    data: Data = None,
    proposals: Annotated[
        bool,
        typer.Option(
            "--proposals/--no-proposals", help="Search for the cheapest addition if the flight is refused."
        ),
    ] = True,
    json: Annotated[
        bool, typer.Option("--json", help="Print only the plan as JSON on standard output.")
    ] = False,
) -> None:
    """Plan a calibration flight: what it will determine, with standard deviations.

    These depend only on the geometry and the σ of the observations; nothing is measured or adjusted.

    Flight directions and heights are recognised from the exposures. Every quantity is determined, weak or not
    determinable, with the reason. If the flight is refused, additions (lines back, lines across, a second
    height, more control) are tried in order of their number of images until one meets the limits.

    [bold]Examples[/bold]

      aerocal plan uce-calibration

      aerocal plan my-flight.toml --free boresight,lever_arm

      aerocal plan uce-calibration --additional brown:K1,K2

      aerocal plan project.toml --set calibration.limits.focal_length_um=1

    What limits a calibration, and a comparison of nine flight patterns: docs/plan.md

    [bold]Exit codes[/bold]  0 accepted · 2 wrong input · 3 not computable · 4 refused
    """
    from flows.command.plan_execution import PlanOptions, execute_plan

    options = PlanOptions(source, free, additional, strip_bias, tuple(overrides or ()), data, proposals)
    end_with(lambda: execute_plan(options, as_json=json))
