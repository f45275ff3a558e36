"""Write results for another program, with a statement of what was written."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from adjust.handover.refit import Freed
from tasks.errors import InputError
from tasks.files.delivered_file import require_folder, require_none_replaced
from tasks.handover.block_points import BlockPoints, read_points
from tasks.handover.delivery import Angles, Delivery, DeliveryFormat
from tasks.handover.distortion_grid import distortion_grids
from tasks.handover.formats.eo_csv import write_eo_csv
from tasks.handover.formats.register import REGISTER
from tasks.handover.lens import Lenses, lens_models
from tasks.handover.on_wgs84 import block_on_wgs84
from tasks.handover.receiver import REFUSED_PX, HandedOver, hand_over
from tasks.handover.results import Results, read_results
from tasks.handover.statement import statement
from tasks.handover.written_files import STATEMENT, write_files
from tasks.nearest_name import did_you_mean
from tasks.plain_text import quoted
from tasks.results.manifest import read_manifest
from tasks.settings.deliver import CHOSEN_ANGLES, World, own_angles

# Bytes of the name of a file, on all usual file systems.
_LONGEST_NAME = 255


@dataclass(frozen=True)
class Export:
    """What was written.

    Attributes
    ----------
    folder, files : where, and which files.
    statement : the text of HANDOVER.txt, without the digests.
    misfit_px : largest misfit of the program's model.
    """

    folder: Path
    files: tuple[str, ...]
    statement: str
    misfit_px: float


@dataclass
class DeliveryRefusedError(InputError):
    """The results would be wrong by a pixel or more in the receiving program.

    Attributes
    ----------
    misfit_px : by how many.
    """

    misfit_px: float = REFUSED_PX

    __str__ = InputError.__str__


def export_results(
    results: Path,
    to: str,
    out: Path | None = None,
    world: str | None = None,
    angles: Angles | None = None,
    *,
    force: bool = False,
) -> Export:
    """Export the results in a folder in a format.

    Parameters
    ----------
    to : name of the format.
    out : folder of the files; None: RESULTS/export/FORMAT.
    world : kind of program; None: the usual one for the format.
    force : write even if the program's model misses ours by a pixel and more.

    Raises
    ------
    InputError
        If there is no such format or kind, no results, the format has angles of its own, or the misfit is
        too large, or a file would be replaced that is not by aerocal or was changed since. Nothing is written
        then.
    """
    form = chosen_format(to, REGISTER)
    if angles is not None and angles != Angles() and to not in CHOSEN_ANGLES:
        raise InputError(*own_angles(to), entity="--angles, --unit")
    folder = results / "export" / to if out is None else out
    require_folder(folder)
    block, manifest = read_results(results), read_manifest(results)
    delivered = () if manifest is None else tuple(manifest.inputs)
    wanted = Wanted(form, chosen_world(world, form), angles or Angles(), force=force, delivered=delivered)
    return write_block(block, lambda: read_points(results, block), wanted, folder)


@dataclass(frozen=True)
class Wanted:
    """What is to be written.

    Attributes
    ----------
    form, world, angles : format, kind of program, angle system.
    force : whether also if the program's model misses ours by a pixel and more.
    adjusted : whether the block is adjusted, or as it was delivered.
    delivered : paths of the files that the block was read from; none of them is replaced.
    """

    form: DeliveryFormat
    world: World
    angles: Angles
    force: bool = False
    adjusted: bool = True
    delivered: Collection[str] = ()


def write_block(block: Results, points: Callable[[], BlockPoints], wanted: Wanted, folder: Path) -> Export:
    """Write a block into a folder.

    Parameters
    ----------
    points : of the block; asked only for a format that takes points.

    Raises
    ------
    InputError
        If the format cannot hold the block, the misfit is too large, or a file would be replaced that is not
        by aerocal or was changed since. Nothing is written then.
    """
    form = wanted.form
    if wanted.world == "rpc" and block.film:
        raise InputError(
            "Rational polynomials lead to pixels of the delivered image, and where an image of film lies in "
            "its scan differs from scan to scan.",
            "Choose a format with orientations, and let the program measure the fiducial marks.",
            entity=f"camera {min(block.film)}",
        )
    delivery = Delivery(block, hand_over(block, wanted.world, form.freed), wanted.angles)
    if form.lens:
        delivery = replace(delivery, lenses=lenses_of(block, delivery.handed, form.lens))
    misfit = float(delivery.misfit_px.max(initial=0.0))
    if misfit >= REFUSED_PX and not wanted.force:
        raise _refusal(delivery, wanted, misfit)
    if form.grid:
        delivery = replace(delivery, grids=tuple(distortion_grids(camera) for camera in block.cameras))
    if form.points:
        delivery = replace(delivery, points=points())
    if form.on_wgs84:
        delivery = block_on_wgs84(delivery)
    files = dict(form.write(delivery))
    if delivery.handed.refitted:
        files["eo_rigorous.csv"] = _rigorous(block)
    text = statement(delivery, form, adjusted=wanted.adjusted)
    _require_short(files)
    require_none_replaced((folder / name for name in (*files, STATEMENT)), wanted.delivered)
    write_files(folder, files, text)
    return Export(folder, tuple(files), text, misfit)


def lenses_of(block: Results, handed: HandedOver, terms: tuple[str, ...]) -> Lenses:
    """Cameras with these distortion terms, for the orientations of a kind of program."""
    return lens_models(block, terms, handed.pose if handed.refitted else None)


def _refusal(delivery: Delivery, wanted: Wanted, misfit: float) -> DeliveryRefusedError:
    worst = delivery.names[int(np.argmax(delivery.misfit_px))]
    what = "this camera" if wanted.form.lens else "these orientations"
    return DeliveryRefusedError(
        f"A program of the kind '{wanted.world}' would be wrong by {misfit:.1f} pixels with {what}.",
        "Write them for another kind of program (--world local, map or map-cartesian-curved; --to rpc), "
        "or use --force.",
        entity=f"image {worst}",
        misfit_px=misfit,
    )


def chosen_format(name: str, register: Mapping[str, DeliveryFormat]) -> DeliveryFormat:
    """The format of a register; InputError if it has none of this name."""
    if name not in register:
        raise InputError(f"There is no format '{name}'.", did_you_mean(name, list(register)), entity="--to")
    return register[name]


def chosen_world(text: str | None, form: DeliveryFormat) -> World:
    """The kind of program, None: the usual one; InputError if the format cannot be written for it."""
    if text is None:
        return form.world
    for world in form.worlds:
        if text == world:
            return world
    raise InputError(
        f"The format {form.name} cannot be written for programs of the kind '{text}'.",
        did_you_mean(text, list(form.worlds)),
        entity="--world",
    )


def _rigorous(block: Results) -> str | bytes:
    true: HandedOver = hand_over(block, "map", Freed())
    return write_eo_csv(Delivery(block, true))["eo.csv"]


def _require_short(files: Collection[str]) -> None:
    """Refuse names of files, made of those of images, that no file can have."""
    for name in files:
        if len(os.fsencode(name)) > _LONGEST_NAME:
            raise InputError(
                f"A file of an image would be called {quoted(name)}: {len(os.fsencode(name))} "
                f"bytes, and no name of a file has more than {_LONGEST_NAME}.",
                "Write a format with one file for all images, or give the images shorter names.",
            )
