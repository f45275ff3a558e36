"""``aerocal check``: the direct-georeferencing check of a project."""

from __future__ import annotations

from flows.command.exit_code import end_with
from flows.command.options import Data, Json, Out, Overrides, ProjectFile, Server


def check(
    project: ProjectFile,
    out: Out = None,
    overrides: Overrides = None,
    data: Data = None,
    server: Server = None,
    json: Json = False,
) -> None:
    """Check the accuracy of GNSS, INS and a calibration without control points.

    Points are intersected with the corrected orientations and compared with their survey; y-parallaxes of
    all stereo models show how well neighbouring images fit. Both are compared with what the stated σ predict.

    The table direct_georeferencing of the project specifies the calibration: that of the cameras, of another
    project, of this project's own adjustment, or the one approved in the registry (aerocal registry) for the
    camera and date. Results: georeferencing_check.html and four tables.

    [bold]Examples[/bold]

      aerocal check project.toml --set direct_georeferencing.calibration=../calibration/results

      aerocal check project.toml --set direct_georeferencing.calibration=adjustment

      aerocal check project.toml --set 'gates.y_parallax_max_um={ max = 12 }'

    [bold]Exit codes[/bold]  0 done · 2 wrong input · 3 not computable · 4 gate failed
    """
    from flows.command.execution import execute

    end_with(
        lambda: execute(
            project,
            out,
            tuple(overrides or ()),
            data,
            server,
            as_json=json,
            story="direct_georeferencing_check",
        )
    )
