"""``aerocal notify``: a test message to everyone who receives notices."""

from __future__ import annotations

import typer

from flows.command.exit_code import DEFECT, DONE, end_with


def notify() -> None:
    """Send a test message to every address that receives notices, and report the outcome.

    The addresses are secrets: they are given in AEROCAL_NOTIFY, separated by spaces, or one per line in a
    private file named by AEROCAL_NOTIFY_FILE; none is shown. [bold]aerocal serve[/bold] uses the same
    addresses.

    [bold]Example[/bold]

      AEROCAL_NOTIFY="jsons://hooks.example.org/aerocal" aerocal notify

    [bold]Exit codes[/bold]  0 accepted by all addresses · 1 not by all · 2 no address, or an invalid one
    """
    end_with(_send)


def _send() -> int:
    from tasks.production.notice_addresses import send_test_message

    sent = send_test_message()
    for address, outcome in sent.items():
        typer.echo(f"{str(address).capitalize()}: {outcome.said}.")
    return DONE if all(outcome.accepted for outcome in sent.values()) else DEFECT
