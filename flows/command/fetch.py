"""``aerocal fetch``: results from object storage into a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flows.command.exit_code import DONE, end_with, remark
from flows.command.options import FOLDER


def fetch(
    address: Annotated[
        str, typer.Argument(metavar="s3://BUCKET/PREFIX", help="The [bold]--out[/bold] of the run.")
    ],
    to: Annotated[Path, typer.Option(**FOLDER, help="Folder for the results.")],
) -> None:
    """Fetch the results of a run from object storage into a folder.

    Every file is checked against its digest in the manifest; existing files are not fetched again, and
    files that are not by aerocal or were changed since are not replaced. The folder is then the same as
    after a run, for registry add, figures and everything else that reads results.

    Endpoint, region and credentials come from the environment: AWS_ENDPOINT_URL, AWS_REGION,
    AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY.

    [bold]Example[/bold]

      aerocal fetch s3://surveys/2026/block-42 --to block-42

    [bold]Exit codes[/bold]  0 done · 2 no results found, or a file of yours would be replaced · 1 the storage
    does not answer or refuses
    """
    end_with(lambda: _fetch(address, to))


def _fetch(address: str, to: Path) -> int:
    from flows.command.progress import show_progress
    from tasks.object_storage.address import address_of
    from tasks.object_storage.fetch import fetch_results

    show_progress()
    found = fetch_results(address_of(address), to)
    if found.is_older and found.last_run is not None:
        reason = " ".join(found.last_run.problems) or found.last_run.status
        remark(f"The latest run there ended without results ({reason}); these are from an earlier run.")
    here = len(found.files) - len(found.brought)
    typer.echo(f"{len(found.files)} files are in {to}" + (f", {here} of them unchanged." if here else "."))
    return DONE
