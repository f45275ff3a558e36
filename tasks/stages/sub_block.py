"""The inputs of a scenario: the image points of a sub-block, and the surveyed points with their roles."""

from __future__ import annotations

from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Bools
from tasks.coordinates.crs import MapFrame
from tasks.errors import InputError
from tasks.nearest_name import did_you_mean
from tasks.settings.project import ProjectSettings
from tasks.settings.sweep import BlockSelection, ControlScenario
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, write_notes
from tasks.store.store import stored
from tasks.sweep.control_choice import control_chosen
from tasks.tables.parquet import of_schema, read_table, write_stage_table
from tasks.tables.schemas.deliveries import CONTROL_POINTS, IMAGE_POINTS


@stored("sub_block")
def select_images(
    folder: Path, *, images: Artifact, image_points: Artifact, block: BlockSelection, name: str
) -> None:
    """Write image_points.parquet with the points of the images of a sub-block only.

    Parameters
    ----------
    name : of the sub-block, for messages.

    Raises
    ------
    InputError
        If a named flight or strip is not in the block, or no image meets the conditions.
    """
    table = read_table(images)
    chosen = table.loc[_in_block(table, block, name), "image"]
    if len(chosen) == 0:
        raise InputError("No image belongs to this sub-block.", "Widen its conditions.", entity=_entity(name))
    points = read_table(image_points)
    points = points[points["image"].isin(chosen)]
    write_stage_table(folder, IMAGE_POINTS, of_schema(points, IMAGE_POINTS))
    write_notes(folder, Notes())


def _in_block(images: pd.DataFrame, block: BlockSelection, name: str) -> Bools:
    """Which images (n,) meet every condition of a sub-block."""
    chosen = np.ones(len(images), dtype=bool)
    if block.flights is not None:
        known = sorted(set(images["flight"].dropna()))
        for flight in block.flights:
            if flight not in known:
                raise InputError(
                    f"The block has no flight '{flight}'.", did_you_mean(flight, known), entity=_entity(name)
                )
        chosen &= images["flight"].isin(block.flights).to_numpy()
    if block.strips is not None:
        known = sorted(set(images["strip"].dropna()))
        wanted: set[str] = set()
        for pattern in block.strips:
            matching = {strip for strip in known if fnmatchcase(strip, pattern)}
            if not matching:
                raise InputError(
                    f"The block has no strip '{pattern}'.", did_you_mean(pattern, known), entity=_entity(name)
                )
            wanted |= matching
        chosen &= images["strip"].isin(wanted).to_numpy()
    if block.height_m is not None:
        low, high = block.height_m
        chosen &= images["height_above_ground_m"].between(low, high).to_numpy()
    return _thinned(images, chosen, block)


def _thinned(images: pd.DataFrame, chosen: Bools, block: BlockSelection) -> Bools:
    """Of the chosen images (n,) every p-th strip of a flight and every q-th image of a strip, by name."""
    table = images.loc[chosen, ["flight", "strip", "image"]].fillna("")
    strip = table.groupby("flight")["strip"].rank(method="dense") - 1.0
    image = table.groupby(["flight", "strip"])["image"].rank(method="first") - 1.0
    kept = np.zeros(len(chosen), dtype=bool)
    kept[chosen] = ((strip % block.every_strip == 0.0) & (image % block.every_image == 0.0)).to_numpy()
    return kept


def _entity(name: str) -> str:
    return f"sweep.blocks.{name}"


@stored("control_roles")
def assign_roles(
    folder: Path,
    *,
    control_points: Artifact,
    image_points: Artifact,
    control: ControlScenario,
    name: str,
    project: ProjectSettings,
) -> None:
    """Write control_points.parquet with the roles of a scenario.

    Parameters
    ----------
    image_points : of the whole block.
    name : of the scenario, for messages.

    Raises
    ------
    InputError
        See `tasks.sweep.control_choice`.
    """
    surveyed = read_table(control_points)
    chosen = control_chosen(control, name, surveyed, read_table(image_points))
    roles = np.where(chosen, "control", "check").astype(object)
    table = of_schema(surveyed.assign(role=roles), CONTROL_POINTS)
    write_stage_table(folder, CONTROL_POINTS, table, MapFrame.of(project.crs, project.heights))
    counts = {"control": int(chosen.sum()), "check": int((~chosen).sum())}
    write_notes(folder, Notes((), {"counts": counts}))
