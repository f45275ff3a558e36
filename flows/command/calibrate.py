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
    estimated together in the adjustment, released in stages; what the flight does not determine is held, and
    reported together with what to fly. The two-step calibration (adjustment on control alone, then means of
    the differences to GNSS and INS) is computed for comparison, with a test whether both agree, and the
    direct-georeferencing check with the calibrated values.

    Without image points, but with orientations of another adjustment (calibration.adjusted), the second step
    is all there is: boresight and lever arm or shift, no interior orientation and no certificate.

    The tables calibration and calibration.limits of the project say what is estimated and what is good
    enough. Results: calibration.json (all parameters with their full covariance), report.html,
    georeferencing_check.html, and the tables of an adjustment.

    [bold]Examples[/bold]

      aerocal calibrate project.toml

      aerocal calibrate project.toml --set 'calibration.free=["boresight", "lever_arm", "gnss_strip_bias"]'

      aerocal calibrate project.toml --set 'adjustment.self_calibration.parameters="bluh:1-12"'

    [bold]Exit codes[/bold]  0 accepted · 2 input wrong · 3 not computable · 4 flight refused or gate failed
    """
    from flows.command.execution import execute

    end_with(
        lambda: execute(
            project, out, tuple(overrides or ()), data, server, as_json=json, story="system_calibration"
        )
    )
