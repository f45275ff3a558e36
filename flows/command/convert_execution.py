"""Carry out ``aerocal convert`` and report what was written."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

from flows.command.exit_code import DONE
from flows.command.export_execution import show_export
from flows.command.progress import show_progress
from flows.command.screen_table import print_listed, screen
from flows.runs.project_run import RunRequest
from flows.stories.block_conversion import converted_block
from tasks.errors import InputError
from tasks.files.delivered_file import require_folder
from tasks.handover.export import chosen_format, chosen_world
from tasks.handover.formats.exchange import EXCHANGE
from tasks.handover.recognised import project_text, recognised
from tasks.store.run_lock import run_lock
from tasks.store.store import Store


def convert_and_show(
    given: Path,
    to: str,
    out: Path | None,
    world: str | None,
    pixel_um: float | None,
    *,
    overrides: tuple[str, ...],
    data: Path | None,
) -> int:
    """Convert and show the statement; wrong input raises InputError."""
    chosen_world(world, chosen_format(to, EXCHANGE))
    show_progress()
    folder = given.absolute().parent / to if out is None else out
    require_folder(folder)
    block = recognised(given)
    _require_pixel_size(pixel_um, of_block=block is not None)
    with tempfile.TemporaryDirectory(prefix="aerocal-convert-") as temporary:
        project_file = given
        if block is not None:
            project_file = Path(temporary) / "project.toml"
            project_file.write_text(project_text(block, given.absolute().stem, pixel_um), encoding="utf-8")
        project = RunRequest.of(project_file, None, overrides, data).project()
        store = Store.of(Path(temporary))
        with run_lock(store.folder.parent):
            store.begin_run()
            written, remarks = converted_block(project, store, to, folder, world)
    console = screen()
    print_listed(console, remarks, "yellow")
    show_export(console, written)
    return DONE


def _require_pixel_size(pixel_um: float | None, *, of_block: bool) -> None:
    """Refuse a pixel size that is none, or that a project file states itself."""
    if pixel_um is None:
        return
    if not 0.0 < pixel_um < math.inf:
        raise InputError(
            f"{pixel_um:g} is not the size of a pixel.", "Give it in µm, e.g. 4.", entity="--pixel-um"
        )
    if not of_block:
        raise InputError(
            "A project file states the pixel size of its cameras.",
            "Omit the option, or correct cameras.NAME.pixel_um.",
            entity="--pixel-um",
        )
