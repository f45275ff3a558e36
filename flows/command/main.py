"""The commands of ``aerocal``."""

from __future__ import annotations

from importlib.metadata import version as installed_version
from typing import Annotated, TypeAlias

import typer

from flows.command.batch import batch
from flows.command.clean import clean
from flows.command.convert import convert
from flows.command.convert_distortion import convert_distortion
from flows.command.doctor import doctor
from flows.command.export import export
from flows.command.fetch import fetch
from flows.command.figures import figures
from flows.command.flight_check import flight_check
from flows.command.image_quality import image_quality
from flows.command.init import init
from flows.command.notify import notify
from flows.command.plan import plan
from flows.command.registry import registry
from flows.command.run import adjust, calibrate, check, run
from flows.command.runner import runner
from flows.command.serve import serve
from flows.command.simulate import simulate
from flows.command.sweep import sweep
from flows.command.undistort import undistort

# One line a paragraph: the help is wrapped to the width of the screen.
_ABOUT = (
    "Aerial triangulation and calibration of large-format aerial cameras.\n\n"
    "A project is one TOML file. It lists the delivered files, their meaning (units, coordinate "
    "systems, angles) and the limits for the result.\n\n"
    "Start with [bold]aerocal init FOLDER[/bold]: it identifies the files and writes a draft of the "
    "project file. "
    "[bold]aerocal doctor PROJECT.toml[/bold] reads and checks the input without an adjustment. Then "
    "[bold]aerocal run PROJECT.toml[/bold] writes tables and figures to results/ next to the project file."
)

_EXIT_CODES = (
    "[bold]Exit codes[/bold]  0 done · 2 the input is wrong · 3 the adjustment cannot be computed · 4 done, "
    "but a quality gate failed · 1 error of the installation or of aerocal itself · 130 interrupted · "
    "143 terminated"
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"aerocal {installed_version('aerocal')}")
        raise typer.Exit


Version: TypeAlias = Annotated[
    bool,
    typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
]

app = typer.Typer(
    name="aerocal",
    help=_ABOUT,
    epilog=_EXIT_CODES,
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    # A traceback is for defects of ours only, and then it should be the plain one.
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
def _aerocal(version: Version = False) -> None:
    pass


for command in (
    init, run, adjust, calibrate, check, doctor, image_quality, simulate, plan, sweep, batch,
    export, undistort, convert, figures, convert_distortion, fetch, flight_check, clean,
    serve, notify, runner,
):  # fmt: skip
    app.command()(command)
app.add_typer(registry, name="registry")
