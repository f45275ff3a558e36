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

    All files are read and approximate values computed: wrong units, swapped axes, unknown images are found.
    Nothing is published; with --out the finished stages are kept there for the run that follows.

    [bold]Example[/bold]

      aerocal doctor project.toml

    [bold]Exit codes[/bold]  0 clean, or suspicions only · 2 input wrong
    """
    from flows.command.examination import examine

    end_with(lambda: examine(project, out, tuple(overrides or ()), data, as_json=json))
