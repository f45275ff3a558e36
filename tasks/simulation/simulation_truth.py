"""The truth of a simulated block as tables: what the results of an adjustment are compared with.

Orientations, points and parameters are in the units, frames and names of the results, so that a join on
the key is all a comparison needs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.parameters import BORESIGHT, FAMILIES, INTERIOR_ORIENTATION, LEVER_ARM
from adjust.rig import OF_HEADS
from adjust.simulate.block import SimulatedBlock
from adjust.simulate.heads import stated_heads
from adjust.simulate.system import certified_interior
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, local_from_grid, map_from_local
from tasks.files.toml_text import TomlValue, toml_text
from tasks.quantities import reported_unit
from tasks.settings.simulation import Simulation
from tasks.tables.parquet import write_table
from tasks.tables.schemas.columns import Column, TableSchema

#: Folder of the truth next to a simulated project, and the specification in it.
TRUTH = "truth"
SPECIFICATION = "spec.toml"

_XYZ_M = ("x_m", "y_m", "z_m")
_GRID = 25
_ARROW = {"string": pa.string(), "float64": pa.float64()}
_CAMERA = Column("camera", "string", "", "camera")


def _numbers(unit: str, *names: str, nullable: bool = False) -> tuple[Column, ...]:
    return tuple(Column(name, "float64", unit, f"true {name}", nullable) for name in names)


ORIENTATIONS = TableSchema(
    "true_exterior_orientations",
    "True orientation of an image; angles as in exterior_orientations.",
    (
        Column("image", "string", "", "image"),
        *_numbers("m", *_XYZ_M),
        *_numbers("deg", "omega_deg", "phi_deg", "kappa_deg"),
    ),
    ("image",),
    _XYZ_M,
)
POINTS = TableSchema(
    "true_object_points",
    "True object point.",
    (
        Column("point", "string", "", "point"),
        *_numbers("m", *_XYZ_M),
        Column("rays", "int32", "", "number of image points"),
    ),
    ("point",),
    _XYZ_M,
)
SURVEYED = TableSchema(
    "true_control_points",
    "True position of a surveyed point.",
    (
        Column("point", "string", "", "point"),
        *_numbers("m", *_XYZ_M),
        Column("role", "string", "", "control or check", values=("control", "check")),
        Column("known", "string", "", "coordinates that are delivered", values=("xyz", "xy", "z")),
    ),
    ("point",),
    _XYZ_M,
)
PARAMETERS = TableSchema(
    "true_parameters",
    "True value of a system parameter.",
    (
        Column("parameter", "string", "", "name as in parameters"),
        Column("entity", "string", "", "camera, flight or strip"),
        Column("value", "float64", "see unit", "true value"),
        Column("stated", "float64", "see unit", "value in the project"),
        Column("unit", "string", "", "unit of value and stated"),
    ),
    ("parameter", "entity"),
)
GROSS_ERRORS = TableSchema(
    "gross_errors",
    "A gross error that was put in.",
    (
        Column("kind", "string", "", "what is wrong", values=("image_point", "control_swap", "strip_time")),
        Column("image", "string", "", "image of a wrong image point", nullable=True),
        Column("point", "string", "", "wrong image point, or control point with another's coordinates", True),
        Column("strip", "string", "", "strip whose positions belong to another moment", nullable=True),
        *_numbers("um", "dx_um", "dy_um", nullable=True),
        Column("other", "string", "", "the point whose coordinates it got", nullable=True),
        Column("time_s", "float64", "s", "error of the time of the strip", nullable=True),
    ),
    ("kind", "image", "point", "strip"),
)
IMAGE_ERRORS = TableSchema(
    "image_errors",
    "Systematic image error at a place of the format: measured minus ideal.",
    (
        _CAMERA,
        Column("x_mm", "float64", "mm", "reduced measured x"),
        Column("y_mm", "float64", "mm", "reduced measured y"),
        Column("ex_um", "float64", "um", "error along x"),
        Column("ey_um", "float64", "um", "error along y"),
        Column("column", "int32", "", "column of the grid"),
        Column("row", "int32", "", "row of the grid"),
    ),
    ("camera", "column", "row"),
)


def write_truth(
    folder: Path, simulation: Simulation, block: SimulatedBlock, map_frame: MapFrame, frame: AdjustmentFrame
) -> None:
    """Write all tables of the truth and the specification, by which a simulation knows its folder."""
    (folder / SPECIFICATION).write_text(toml_text(_as_toml(simulation)), encoding="utf-8")
    _write_orientations(folder, block, map_frame, frame)
    _write_points(folder, block, map_frame, frame)
    _write_parameters(folder, block)
    _write_gross_errors(folder, block)
    _write_image_errors(folder, block)


def _as_toml(simulation: Simulation) -> Mapping[str, TomlValue]:
    """Everything the simulation used, without unset values."""
    content: Mapping[str, TomlValue] = simulation.model_dump(mode="json", exclude_none=True)
    return content


def _write_orientations(
    folder: Path, block: SimulatedBlock, map_frame: MapFrame, frame: AdjustmentFrame
) -> None:
    state = block.true_state()
    pictures = state.pictures
    x_in_map = map_from_local(map_frame, frame, pictures.projection_centre)
    grid_from_local = np.swapaxes(local_from_grid(map_frame, frame, x_in_map), 1, 2)
    angles = np.rad2deg(rotation.to_omega_phi_kappa(grid_from_local @ pictures.local_from_camera))
    names = ("omega_deg", "phi_deg", "kappa_deg")
    write_table(
        folder / "exterior_orientations.parquet",
        ORIENTATIONS,
        {"image": block.truth.images, **_columns(_XYZ_M, x_in_map), **_columns(names, angles)},
        map_frame,
    )


def _write_points(folder: Path, block: SimulatedBlock, map_frame: MapFrame, frame: AdjustmentFrame) -> None:
    truth = block.truth
    x_in_map = map_from_local(map_frame, frame, truth.state.object_point)
    rays = np.bincount(truth.point, minlength=len(truth.points))
    write_table(
        folder / "object_points.parquet",
        POINTS,
        {"point": truth.points, **_columns(_XYZ_M, x_in_map), "rays": rays},
        map_frame,
    )
    known = np.where(truth.present.all(axis=1), "xyz", np.where(truth.present[:, 2], "z", "xy"))
    write_table(
        folder / "control_points.parquet",
        SURVEYED,
        {
            "point": [truth.points[i] for i in truth.surveyed],
            **_columns(_XYZ_M, x_in_map[truth.surveyed]),
            "role": np.where(truth.is_check, "check", "control").astype(object),
            "known": known.astype(object),
        },
        map_frame,
    )


def _write_parameters(folder: Path, block: SimulatedBlock) -> None:
    specification, plan = block.specification, block.truth.plan
    entities = {
        "camera": tuple(camera.name for camera in specification.cameras),
        "flight": plan.flights,
        "strip": plan.strips,
    }
    heads = {head.camera for head in specification.heads}
    rows: list[tuple[str, str, float, float, str]] = []
    for name, values in block.true_state().system.items():
        unit, factor = reported_unit(FAMILIES[name])
        stated = np.zeros_like(values)
        if name == INTERIOR_ORIENTATION:
            stated = certified_interior(specification.cameras)
        elif name in OF_HEADS:
            stated = stated_heads(specification.heads, len(specification.cameras))[name]
        for (entity, component), value in np.ndenumerate(values):
            if name in (BORESIGHT, LEVER_ARM) and entity in heads:  # they follow from the reference head
                continue
            family = FAMILIES[name]
            given = float(stated[entity, component]) * factor
            entity_name = entities[family.entity_kind][entity]
            rows.append((family.components[component], entity_name, float(value) * factor, given, unit))
    names = [column.name for column in PARAMETERS.columns]
    write_table(
        folder / "parameters.parquet", PARAMETERS, dict(zip(names, zip(*rows, strict=True), strict=True))
    )


@dataclass(frozen=True)
class _GrossError:
    """A row of the table of gross errors."""

    kind: str
    image: str | None = None
    point: str | None = None
    strip: str | None = None
    dx_um: float | None = None
    dy_um: float | None = None
    other: str | None = None
    time_s: float | None = None


def _write_gross_errors(folder: Path, block: SimulatedBlock) -> None:
    rows = _gross_errors(block)
    columns = {
        column.name: pa.array([getattr(row, column.name) for row in rows], _ARROW[column.type])
        for column in GROSS_ERRORS.columns
    }
    write_table(folder / "gross_errors.parquet", GROSS_ERRORS, columns)


def _gross_errors(block: SimulatedBlock) -> list[_GrossError]:
    truth, wrong = block.truth, block.measured.gross_errors
    surveyed = [truth.points[i] for i in truth.surveyed]
    rows = [
        _GrossError(
            "image_point",
            image=truth.images[truth.image[ray]],
            point=truth.points[truth.point[ray]],
            dx_um=float(dx) * 1e6,
            dy_um=float(dy) * 1e6,
        )
        for ray, (dx, dy) in zip(wrong.image_points, wrong.displacement, strict=True)
    ]
    for one, other in wrong.swapped:
        rows.append(_GrossError("control_swap", point=surveyed[one], other=surveyed[other]))
        rows.append(_GrossError("control_swap", point=surveyed[other], other=surveyed[one]))
    strips = truth.plan.strips
    return rows + [
        _GrossError("strip_time", strip=strips[strip], time_s=wrong.time_error) for strip in wrong.strips
    ]


def _write_image_errors(folder: Path, block: SimulatedBlock) -> None:
    """The fields of the cameras at the middles of 25 × 25 cells."""
    column, row = (index.ravel() for index in np.meshgrid(np.arange(_GRID), np.arange(_GRID)))
    steps = 2.0 * (np.stack([column, row], -1) + 0.5) / _GRID - 1.0
    parts = []
    for camera, errors in zip(block.specification.cameras, block.truth.image_errors, strict=True):
        place = steps * camera.half_format
        error = errors.error(place)
        parts.append(([camera.name] * len(place), np.hstack([place * 1e3, error * 1e6])))
    values = np.concatenate([part[1] for part in parts])
    write_table(
        folder / "image_errors.parquet",
        IMAGE_ERRORS,
        {
            "camera": [name for part in parts for name in part[0]],
            **_columns(("x_mm", "y_mm", "ex_um", "ey_um"), values),
            "column": np.tile(column, len(parts)),
            "row": np.tile(row, len(parts)),
        },
    )


def _columns(names: tuple[str, ...], values: Floats) -> dict[str, Floats]:
    return dict(zip(names, values.T, strict=True))
