"""``aerocal registry``: calibrations, their approval and their validity."""

from __future__ import annotations

from datetime import date, datetime
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from flows.command.exit_code import end_with

registry = typer.Typer(
    help="Registry of calibrations: immutable versions, approved by a person, valid from a date.\n\n"
    "A calibration is added as a draft (add), compared with the one in force and approved (approve), "
    "and later superseded by the next one. Nothing is ever changed or removed; editing the database directly "
    "is detected (verify).\n\n"
    'With calibration = "registry", a project uses the calibrations in force on the day of its flight '
    "(project.flown).\n\n"
    "[bold]Examples[/bold]\n\n"
    "  aerocal registry add results --note 'after the change of the shutter'\n\n"
    "  aerocal registry approve 3 --from 2026-03-01\n\n"
    "  aerocal registry show UC-Eagle-1-42 --plot camera.html\n\n"
    "  aerocal registry due --within 60\n\n"
    "The registry is a SQLite file of this user, unless AEROCAL_REGISTRY or --registry names another one.",
    epilog="[bold]Exit codes[/bold]  0 done · 2 wrong input, conflict, or the registry was edited · 1 the "
    "database cannot be reached · 4 due: a camera needs a calibration",
    no_args_is_help=True,
    rich_markup_mode="rich",
)

Address: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--registry",
        metavar="URL",
        help="The registry: path of a SQLite file, or postgresql://USER@HOST/DATABASE (password in "
        "PGPASSWORD).",
        show_default="AEROCAL_REGISTRY, otherwise a file of this user",
    ),
]
Person: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--by",
        metavar="NAME",
        help="Name of the person responsible.",
        show_default="name of the user's account",
    ),
]
Note: TypeAlias = Annotated[str, typer.Option("--note", metavar="TEXT", help="A comment.")]
Json: TypeAlias = Annotated[bool, typer.Option("--json", help="Print only JSON on standard output.")]
Number: TypeAlias = Annotated[
    str, typer.Argument(metavar="ID", help="Number of the calibration, or 8 digits of its verification code.")
]


def _day(text: str) -> date:
    try:
        return datetime.strptime(text, "%Y-%m-%d").date()
    except ValueError as error:
        raise typer.BadParameter(f"'{text}' is no day. Write year-month-day, e.g. 2026-03-01.") from error


_DAY = {"parser": _day, "metavar": "DATE"}
#: A century.
_MOST_DAYS = 36_500


@registry.command()
def add(
    source: Annotated[
        Path, typer.Argument(metavar="FILE|RESULTS", help="calibration.json, or a folder of results.")
    ],
    person: Person = None,
    note: Note = "",
    code: Annotated[
        list[str] | None,
        typer.Option(
            metavar="CODE",
            help="Verification code on the certificate, 16 digits or all of them; required for a file "
            "outside its results folder. Repeatable.",
        ),
    ] = None,
    address: Address = None,
) -> None:
    """Add a calibration, or all of a folder, as a draft: the next version of its camera.

    The camera is identified by body, lens and product (cameras.NAME.identity), otherwise by its name. The
    file must be the one referred to by the manifest and the certificate in its folder.
    """
    from flows.command.registry_actions import add_calibrations

    end_with(lambda: add_calibrations(source, person, note, code or [], address))


@registry.command("list")
def list_(
    camera: Annotated[
        str | None, typer.Argument(metavar="CAMERA", help="Only this camera: its name, body or lens.")
    ] = None,
    json: Json = False,
    address: Address = None,
) -> None:
    """List the calibrations with state and validity, camera by camera."""
    from flows.command.registry_tables import list_calibrations

    end_with(lambda: list_calibrations(camera, address, as_json=json))


@registry.command()
def show(
    what: Annotated[
        str,
        typer.Argument(
            metavar="ID|CAMERA",
            help="A calibration (its number, or the beginning of its verification code) or a camera (its "
            "name, body or lens).",
        ),
    ],
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.html", help="Write a page with the parameters of the camera over the years."
        ),
    ] = None,
    json: Json = False,
    address: Address = None,
) -> None:
    """Show one calibration with its parameters and history, or how a camera has changed.

    A calibration is compared with the previous approved one: every change with its σ.
    """
    from flows.command.registry_tables import show_calibrations

    end_with(lambda: show_calibrations(what, plot, address, as_json=json))


@registry.command()
def approve(
    number: Number,
    start: Annotated[date, typer.Option("--from", help="First day of validity.", **_DAY)],
    end: Annotated[
        date | None,
        typer.Option("--to", help="Last day of validity.", show_default="until superseded", **_DAY),
    ] = None,
    person: Person = None,
    note: Note = "",
    although: Annotated[
        str,
        typer.Option(
            metavar="REASON",
            help="Approve a calibration although it was refused, or although the camera has changed; "
            "give the reason.",
        ),
    ] = "",
    address: Address = None,
) -> None:
    """Approve a draft: it is valid from a given day and supersedes the previous calibration.

    It is compared with the previous one, as in aerocal registry show: χ² with both covariances, each
    parameter.

    A difference does not prevent the approval; the decision is yours.

    If two people approve calibrations of one camera at the same time, one of them gets an error message;
    nothing is lost.
    """
    from flows.command.registry_actions import approve_calibration

    end_with(lambda: approve_calibration(number, (start, end), person, note, although, address))


@registry.command()
def export(
    number: Number,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write to this file.", show_default="screen")
    ] = None,
    address: Address = None,
) -> None:
    """Write a calibration as JSON: exactly the bytes whose SHA-256 is its verification code."""
    from flows.command.registry_actions import export_calibration

    end_with(lambda: export_calibration(number, out, address))


@registry.command()
def verify(
    since: Annotated[
        str | None, typer.Option(metavar="DIGEST", help="A previously recorded state of the registry.")
    ] = None,
    json: Json = False,
    address: Address = None,
) -> None:
    """Compare every record with its digest and the history; report everything that was edited.

    It prints the digest of the current state. If you note it elsewhere (on a certificate, in an e-mail) and
    give it later as --since, this shows that no earlier event was rewritten, even with all digests
    recomputed.
    """
    from flows.command.registry_actions import verify_registry

    end_with(lambda: verify_registry(since, address, as_json=json))


@registry.command()
def due(
    within: Annotated[
        int,
        typer.Option(
            metavar="DAYS",
            help="Days before the end of validity at which a calibration becomes due.",
            min=0,
            max=_MOST_DAYS,
        ),
    ] = 30,
    max_age: Annotated[
        int,
        typer.Option(
            metavar="DAYS",
            help="Age in days at which a calibration becomes due; 0: no limit.",
            min=0,
            max=_MOST_DAYS,
        ),
    ] = 730,
    sigma: Annotated[
        float | None,
        typer.Option(
            metavar="T",
            help="Limit of a single parameter, in σ of its change.",
            show_default="exceeded by chance once in 1,000 cases",
            min=1.0,
        ),
    ] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=NUMBER",
            help="Additional absolute limit: focal_length or principal_point in µm, boresight in °, "
            "lever_arm in mm. Repeatable.",
        ),
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(metavar="CAMERA", help="Exclude a camera: its name, body or lens. Repeatable."),
    ] = None,
    json: Json = False,
    address: Address = None,
) -> None:
    """List cameras that need a calibration: none in force, expired or about to expire, too old, or drifted.

    The latest calibration of a camera is compared with the previous one, and with the first of its mounting.

    [bold]Exit codes[/bold]  0 none is due · 4 some are
    """
    from flows.command.registry_due import show_due

    end_with(lambda: show_due(within, max_age, sigma, limit or [], without or [], address, as_json=json))
