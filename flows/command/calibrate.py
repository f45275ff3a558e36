"""``aerocal calibrate``: the system calibration of a project."""

from __future__ import annotations

from flows.command.exit_code import end_with
from flows.command.options import Data, Json, Out, Overrides, ProjectFile, Server


def calibrate(
    project: ProjectFile,
    out: Out = None,
    overrides: Overrides = None,
    data: Data = None,
    server: Server = None,
    json: Json = False,
) -> None:
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
    from flows.command.execution import execute

    end_with(
        lambda: execute(
            project, out, tuple(overrides or ()), data, server, as_json=json, story="system_calibration"
        )
    )
