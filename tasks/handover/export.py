"""Write results for another program, with a statement of what was written."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from adjust.handover.refit import Freed
from tasks.errors import InputError
from tasks.files.installation import writing_into
from tasks.handover.block_points import read_points
from tasks.handover.delivery import Angles, Delivery
from tasks.handover.formats.eo_csv import write_eo_csv
from tasks.handover.formats.register import REGISTER
from tasks.handover.lens import lens_models
from tasks.handover.receiver import REFUSED_PX, HandedOver, World, hand_over
from tasks.handover.results import Results, read_results
from tasks.handover.statement import statement
from tasks.nearest_name import did_you_mean

STATEMENT = "HANDOVER.txt"


@dataclass(frozen=True)
class Export:
    """What was written.

    Attributes
    ----------
    folder, files : where, and which files.
    statement : the text of HANDOVER.txt.
    misfit_px : largest misfit of the program's model.
    """

    folder: Path
    files: tuple[str, ...]
    statement: str
    misfit_px: float


def export_results(
    results: Path,
    to: str,
    out: Path | None = None,
    world: str | None = None,
    angles: Angles | None = None,
    *,
    force: bool = False,
) -> Export:
    """Hand the results in a folder over in a format.

    Parameters
    ----------
    to : name of the format.
    out : folder of the files; None: RESULTS/export/FORMAT.
    world : kind of program; None: the usual one of the format.
    force : write even if the program's model misses ours by a pixel and more.

    Raises
    ------
    InputError
        If there is no such format or kind, no results, or the misfit is too large. Nothing is written then.
    """
    if to not in REGISTER:
        raise InputError(f"There is no format '{to}'.", did_you_mean(to, list(REGISTER)), entity="--to")
    form = REGISTER[to]
    found: World = form.world if world is None else _world(world, form.name, form.worlds)
    block = read_results(results)
    handed = hand_over(block, found, form.freed)
    delivery = Delivery(block, handed, angles or Angles())
    if form.lens:
        delivery = replace(delivery, lenses=lens_models(block, form.lens))
    misfit = float(delivery.misfit_px.max(initial=0.0))
    if misfit >= REFUSED_PX and not force:
        worst = block.images.names[int(np.argmax(delivery.misfit_px))]
        what = "this camera" if form.lens else "these orientations"
        raise InputError(
            f"A program of the kind '{found}' would be wrong by {misfit:.1f} pixels with {what}.",
            "Write them for another kind (--world local, map or map-cartesian-curved; --to rpc), or "
            "insist with --force.",
            entity=f"image {worst}",
        )
    if form.points:
        delivery = replace(delivery, points=read_points(results, block))
    files = dict(form.write(delivery))
    if handed.refitted:
        files["eo_rigorous.csv"] = _rigorous(block)
    text = statement(delivery, form, results.resolve().parent.name)
    folder = results / "export" / to if out is None else out
    _write(folder, {**files, STATEMENT: text})
    return Export(folder, tuple(files), text, misfit)


def _world(text: str, form: str, worlds: tuple[World, ...]) -> World:
    for world in worlds:
        if text == world:
            return world
    raise InputError(
        f"The format {form} cannot be written for the kind '{text}'.",
        did_you_mean(text, list(worlds)),
        entity="--world",
    )


def _rigorous(block: Results) -> str | bytes:
    true: HandedOver = hand_over(block, "map", Freed())
    return write_eo_csv(Delivery(block, true))["eo.csv"]


def _write(folder: Path, files: dict[str, str | bytes]) -> None:
    """All files, each whole or not at all; the statement last."""
    if folder.is_file():
        raise InputError("This is a file, not a folder.", "Give --out another name.", file=folder)
    with writing_into(folder):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / STATEMENT).unlink(missing_ok=True)
        for name, content in files.items():
            part = folder / f".{name}.part"
            part.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
            part.replace(folder / name)
