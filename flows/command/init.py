"""``aerocal init``: start a project from a folder of delivered files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flows.command.exit_code import end_with


def init(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the delivered files.")],
) -> None:
    """Identify delivered files and create its project file.

    Identifies each file by its content. FOLDER/project.toml lists the files and contains what they state.
    Values that must be declared (units, coordinate systems, heights, angles) are marked DECLARE, and aerocal
    run refuses the project until they are. A project file is never overwritten.

    [bold]Example[/bold]

      aerocal init delivery && $EDITOR delivery/project.toml && aerocal doctor delivery/project.toml

    [bold]Exit codes[/bold]  0 written · 2 no delivery, or a project file already exists
    """
    from flows.command.initiation import initiate

    end_with(lambda: initiate(folder))
