"""``aerocal run``, ``adjust``, ``calibrate`` and ``check``: the stories of a project."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from flows.command.exit_code import end_with
from flows.command.options import Data, Json, Out, Overrides, ProjectFile, Server

if TYPE_CHECKING:
    from flows.runs.project_run import StoryName


def _command(story: StoryName | None) -> Callable[[Callable[[], None]], Callable[..., None]]:
    """Make a command with the options of a run; its name and its help are those of the function."""

    def with_options(described: Callable[[], None]) -> Callable[..., None]:
        def command(
            project: ProjectFile,
            out: Out = None,
            overrides: Overrides = None,
            data: Data = None,
            server: Server = None,
            json: Json = False,
        ) -> None:
            from flows.command.execution import execute

            end_with(
                lambda: execute(project, out, tuple(overrides or ()), data, server, as_json=json, story=story)
            )

        command.__name__, command.__doc__ = described.__name__, described.__doc__
        return command

    return with_options


@_command(None)
def run() -> None:
    r"""Run the flow declared in the project file.

    A project file with a table \[calibration] runs the system calibration, one with a table
    \[direct_georeferencing] the check of direct georeferencing, any other the adjustment. To choose one of
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


@_command("aerial_triangulation")
def adjust() -> None:
    """Adjust the block of a project (aerial triangulation only).

    [bold]Example[/bold]

      aerocal adjust project.toml --set 'adjustment.free=["boresight"]'

    [bold]Exit codes[/bold]  0 done · 2 wrong input · 3 not computable · 4 gate failed
    """


@_command("system_calibration")
def calibrate() -> None:
    """Calibrate camera, mounting and GNSS from a calibration flight.

    Focal length, principal point, additional parameters, boresight and GNSS shift (or lever arm) are
    estimated together in the adjustment, in stages. Parameters that the flight does not determine are held
    fixed and reported, with advice on what to fly. For comparison, a two-step calibration follows
    (adjustment with control points only, then means of the differences to GNSS and INS); a test shows whether
    both agree. Finally, direct georeferencing is checked with the calibrated values.

    With orientations of another adjustment (calibration.adjusted) instead of image points, only the second
    step is computed: boresight and lever arm or shift, without interior orientation and certificate.

    The tables calibration and calibration.limits of the project contain the parameters to estimate and the
    limits. Results: calibration.json (all parameters with their full covariance), report.html,
    georeferencing_check.html, and the tables of an adjustment.

    [bold]Examples[/bold]

      aerocal calibrate project.toml

      aerocal calibrate project.toml --set 'calibration.free=["boresight", "lever_arm", "gnss_strip_bias"]'

      aerocal calibrate project.toml --set 'adjustment.self_calibration.parameters="bluh:1-12"'

    [bold]Exit codes[/bold]  0 accepted · 2 wrong input · 3 not computable · 4 flight refused or gate failed
    """


@_command("direct_georeferencing_check")
def check() -> None:
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
