"""``aerocal doctor``: read and check a project, adjust nothing."""

from __future__ import annotations

from flows.command.exit_code import end_with
from flows.command.options import Data, Json, Out, Overrides, ProjectFile


def doctor(
    project: ProjectFile,
    out: Out = None,
    overrides: Overrides = None,
    data: Data = None,
    json: Json = False,
) -> None:
    """Read and check a project: contents, and suspicious values.

    All mistakes are listed at once, each with the evidence for every hypothesis and the line of the project
    file that corrects it: units, order and reference of angles, rotated or mirrored images, swapped axes,
    feet, heights, zones, antenna, time offset, mixed-up names, images and points that are not used. Errors
    that would stop a run are corrected in memory or skipped, so that the rest can be checked as well. What
    the settings of the adjustment require of the data, such as times for gnss_correlation_s, is checked by
    the run.

    Nothing is published; with --out, completed stages are kept for the next run.

    [bold]Example[/bold]

      aerocal doctor project.toml

    [bold]Exit codes[/bold]  0 clean, or suspicions only · 2 wrong input
    """
    from flows.command.examination import examine

    end_with(lambda: examine(project, out, tuple(overrides or ()), data, as_json=json))
