"""A block as it was delivered, for block exchange: nothing of it is adjusted.

Orientations are the delivered ones, with the known mounting, and approximate ones of images without; object points are
intersected from them. Image points are as measured, cameras as given.
"""  # noqa: E501

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pandas as pd

from tasks.block.assembled_block import DeliveredTables
from tasks.block.oriented_images import oriented_images
from tasks.coordinates.crs import MapFrame
from tasks.handover.block_points import block_points
from tasks.handover.delivery import Angles
from tasks.handover.export import Export, Wanted, chosen_format, chosen_world, write_block
from tasks.handover.formats.exchange import EXCHANGE
from tasks.handover.results import Results, calibrated_camera, ground_heights, with_images_only
from tasks.handover.rig_heads import rig_heads
from tasks.handover.rigorous import OrientedImages
from tasks.settings.project import ProjectSettings
from tasks.store.artifact import Artifact
from tasks.tables.parquet import read_table

_SIGMAS = ("x_m", "y_m", "z_m", "omega_deg", "phi_deg", "kappa_deg")


def convert_block(
    outputs: Mapping[str, Artifact],
    project: ProjectSettings,
    to: str,
    out: Path,
    world: str | None = None,
    delivered: Collection[str] = (),
) -> Export:
    """Write a prepared block in a format of block exchange, without adjusting it.

    Parameters
    ----------
    outputs : of the stages up to the approximate values.
    to : name of the format.
    out : folder of the files.
    world : kind of program; None: the one that gets the coordinates as they are.
    delivered : paths of the files that the block was read from; none of them is replaced.

    Raises
    ------
    InputError
        If there is no such format or kind, or the format cannot hold the block. Nothing is written then.
    """
    form = chosen_format(to, EXCHANGE)
    found = chosen_world(("map" if "map" in form.worlds else "local") if world is None else world, form)
    tables = DeliveredTables.of({field.name: outputs[field.name] for field in fields(DeliveredTables)})
    block = _block(tables, project)
    if "film_orientations" in outputs:
        block = replace(block, film=frozenset(read_table(outputs["film_orientations"])["camera"].astype(str)))
    known = tables.approximate_points.dropna(subset=["x_m", "y_m", "z_m"])

    return write_block(
        block,
        lambda: block_points(block, known, tables.image_points, tables.control_points),
        Wanted(form, found, Angles(), adjusted=False, delivered=delivered),
        out,
    )


def _block(tables: DeliveredTables, project: ProjectSettings) -> Results:
    place = MapFrame.of(project.crs, project.heights)
    given, frame, _ = oriented_images(
        tables.exposures, tables.cameras, tables.image_points, place, tables.approximate_orientations
    )
    given = given.with_boresight(tables.approximate_boresight)
    centre, turn = given.orientations()
    rows = tables.cameras.set_index("camera", drop=False).loc[list(given.mountings.names)]
    cameras = tuple(calibrated_camera(row) for row in rows.to_dict("records"))
    images = OrientedImages(
        given.image,
        given.camera,
        place,
        frame,
        centre,
        turn,
        np.array([item.frame.focal_length for item in cameras]),
        np.array([item.frame.half_format for item in cameras]),
        np.array([item.frame.pixel_size for item in cameras]),
    )
    sigma = tables.exposures.set_index("image").reindex(given.image)
    orientations = pd.DataFrame(
        {f"sigma_{name}": sigma[f"sigma_{name}"].to_numpy(np.float64) for name in _SIGMAS}
    )
    ground = ground_heights(tables.approximate_points, tables.image_points, list(given.image))
    heads = rig_heads(tables.exposures, rows, list(given.image)) if given.mountings.has_heads else None
    found = Results(images, cameras, orientations, given.strip, ground, project.name, project.flown, heads)
    return with_images_only(found)
