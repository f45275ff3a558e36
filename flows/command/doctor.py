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
    """Read and check a project: what is there, and what looks wrong.

    All files are read and approximate values are computed, so wrong units, swapped axes, unknown images
    and points far off are found before hours of computing. Nothing is published; with --out the stages
    already finished are kept in that folder for the run that follows.

    [bold]Example[/bold]

      aerocal doctor project.toml

    [bold]Exit codes[/bold]  0 clean, or suspicions only · 2 wrong input · 1 installation
    """
    from flows.command.examination import examine

    end_with(lambda: examine(project, out, tuple(overrides or ()), data, as_json=json))
