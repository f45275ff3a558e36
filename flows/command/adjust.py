"""``aerocal adjust``: only the aerial triangulation of a project."""

from __future__ import annotations

from flows.command.exit_code import end_with
from flows.command.options import Data, Json, Out, Overrides, ProjectFile, Server


def adjust(
    project: ProjectFile,
    out: Out = None,
    overrides: Overrides = None,
    data: Data = None,
    server: Server = None,
    json: Json = False,
) -> None:
    """Adjust the block of a project (aerial triangulation only).

    [bold]Example[/bold]

      aerocal adjust project.toml --set 'adjustment.free=["boresight"]'

    [bold]Exit codes[/bold]  0 done · 2 wrong input · 3 not computable · 4 gate failed
    """
    from flows.command.execution import execute

    end_with(
        lambda: execute(
            project, out, tuple(overrides or ()), data, server, as_json=json, story="aerial_triangulation"
        )
    )
