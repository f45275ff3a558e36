"""``aerocal run``: what a project file declares."""

from __future__ import annotations

from flows.command.exit_code import end_with
from flows.command.options import Data, Json, Out, Overrides, ProjectFile, Server


def run(
    project: ProjectFile,
    out: Out = None,
    overrides: Overrides = None,
    data: Data = None,
    server: Server = None,
    json: Json = False,
) -> None:
    """Run the flow declared in the project file.

    A project file with a table [calibration] runs the system calibration, one with a table
    [direct_georeferencing] the check of direct georeferencing, any other the adjustment. To choose one of
    them regardless of the file, use aerocal calibrate, check or adjust. Delivered files are only read;
    tables, figures and a report are written.

    Stages whose inputs, settings and code did not change are reused, so a rerun is fast. On a terminal, one
    line shows the current stage and the approximate remaining time.

    [bold]Examples[/bold]

      aerocal run project.toml

      aerocal run project.toml --out strict --set adjustment.rejection.critical_value=3.29

      aerocal run project.toml --json | jq .sigma0

    [bold]Exit codes[/bold]  0 done · 2 wrong input · 3 not computable · 4 gate failed
    """
    from flows.command.execution import execute

    end_with(lambda: execute(project, out, tuple(overrides or ()), data, server, as_json=json))
