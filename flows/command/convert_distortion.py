"""``aerocal convert-distortion``: a camera's distortion in another direction or convention."""

from __future__ import annotations

from typing import Annotated

import typer

from flows.command.exit_code import end_with
from flows.command.options import Data, Json, Overrides, ProjectFile


def convert_distortion(
    project: ProjectFile,
    to: Annotated[
        str,
        typer.Option(
            metavar="SELECTION",
            help="Parameters to convert to, e.g. [bold]brown_mm:K1-K3,P1,P2[/bold] or "
            "[bold]brown-forward:k1-k3,p1,p2[/bold].",
        ),
    ],
    camera: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Camera name; not needed if only one camera has values."),
    ] = None,
    overrides: Overrides = None,
    data: Data = None,
    json: Json = False,
) -> None:
    """Convert a camera's known distortion between directions and conventions.

    OpenCV, COLMAP and Metashape distort the ideal point, Australis and laboratories correct the measured one.
    The coefficients of one are not those of the other: the format is sampled, the other set is fitted, and
    the misfit is shown. More than 0.1 µm triggers a warning.

    [bold]Example[/bold]

      aerocal convert-distortion project.toml --to brown_mm:K1-K3,P1,P2

    [bold]Exit codes[/bold]  0 done · 2 wrong input
    """
    from flows.command.distortion_table import show_conversion

    end_with(lambda: show_conversion(project, tuple(overrides or ()), data, camera, to, as_json=json))
