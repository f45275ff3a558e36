"""Control and check points of all input files in the coordinate system of the project."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from adjust.arrays import Floats
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.datum_change import Transfer
from tasks.coordinates.geoid_grid import refuse_damaged_geoid
from tasks.deliveries.exposures import turned_sigmas
from tasks.deliveries.file_statement import about_stated_heights, refuse_other_statement
from tasks.deliveries.length_units import control_in_metres
from tasks.deliveries.plan_position import refuse_outside_area, refuse_without_image
from tasks.deliveries.source_rows import (
    METRES,
    Places,
    about_extra,
    about_missing_sigmas,
    joined,
    refuse_sigmas,
)
from tasks.errors import Location
from tasks.formats.records import ControlRecords
from tasks.formats.register import read_control
from tasks.nearest_name import did_you_mean
from tasks.settings.inputs import ControlInput
from tasks.store.notes import Notes

_ROLES = ("control", "check")


#: σ of a point that is fixed (σ = 0), metres: small compared with any survey, but its residual can be told.
FIXED_M = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class _Converted:
    """One input in the project's coordinate system."""

    records: ControlRecords
    position: Floats
    sigma: Floats
    role: list[str]


def control_columns(
    sources: Sequence[ControlInput], project: MapFrame
) -> tuple[Mapping[str, Any], Mapping[str, pa.Array], Notes]:
    """Columns of ``control_points.parquet``, further columns of the files, and notes.

    Raises
    ------
    InputError
        For a point given twice, one without any coordinate, positions outside the CRS or the geoid grid, an
        unknown role, a check point the file does not have, standard deviations that are not positive.
    """
    inputs = [_converted(source, project) for source in sources]
    records = [entry.records for entry in inputs]
    places = Places.of_files([r.file for r in records], [r.line for r in records])
    point = pa.concat_arrays([r.point for r in records])
    codes = point.dictionary_encode().indices.to_numpy(zero_copy_only=False).astype(np.int64)
    places.refuse_duplicates(codes, "control point", [point])
    role = [name for entry in inputs for name in entry.role]
    columns: dict[str, Any] = {"point": point, "role": role}
    columns |= dict(zip(("x_m", "y_m", "z_m"), np.concatenate([e.position for e in inputs]).T, strict=True))
    names = ("sigma_x_m", "sigma_y_m", "sigma_z_m")
    columns |= dict(zip(names, np.concatenate([e.sigma for e in inputs]).T, strict=True))
    remarks = (
        *(remark for r in records for remark in r.remarks),
        *(
            remark
            for r, source in zip(records, sources, strict=True)
            for remark in about_stated_heights(r.file, r.states, source.heights)
        ),
        *(
            remark
            for r in records
            for remark in about_missing_sigmas(r.file, r.sigma, np.isfinite(r.position), "sigma_m")
        ),
        *about_extra(records),
    )
    notes = Notes(remarks, {"counts": {name: role.count(name) for name in _ROLES}})
    return columns, joined([r.extra for r in records], [len(r.line) for r in records]), notes


def _converted(source: ControlInput, project: MapFrame) -> _Converted:
    records = read_control(source.format, source.file, source.layout)
    places = Places.of_files([source.file], [records.line])
    frame = MapFrame.of(source.crs, source.heights)
    records = control_in_metres(records, source, frame)
    refuse_other_statement(records.file, records.states, source, frame, records.position)
    transfer = Transfer.between(frame, project)
    # Zero is not a mistake here: the point is fixed.
    refuse_sigmas(places, np.where(records.sigma == 0.0, np.nan, records.sigma), records.point, METRES)
    _refuse_unknown_position(records, places)
    refuse_outside_area(frame, records.position, places, records.point, "control point")
    position = _positions(records, transfer, places)
    refuse_without_image((frame, project), records.position, position, places, records.point)
    refuse_damaged_geoid(frame, records.position)
    refuse_damaged_geoid(project, position)
    sigma = np.where(np.isnan(records.sigma), source.sigma_m, records.sigma)
    sigma = turned_sigmas(transfer, sigma, np.nan_to_num(records.position), np.nan_to_num(position))
    sigma = np.where(np.isfinite(position), np.where(sigma == 0.0, FIXED_M, sigma), np.nan)
    return _Converted(records, position, sigma, _roles(source, records, places))


def _refuse_unknown_position(records: ControlRecords, places: Places) -> None:
    known = np.isfinite(records.position)
    nothing, half = np.asarray(~known.any(axis=1)), known[:, 0] != known[:, 1]
    places.refuse(nothing, records.point, "The point has no coordinates.", "Give them, or delete the line.")
    remedy = "Give both, or neither for a height control point."
    places.refuse(half, records.point, "Only one of x and y is given.", remedy)


def _positions(records: ControlRecords, transfer: Transfer, places: Places) -> Floats:
    """Positions (n, 3) in the project's system; unknown coordinates stay NaN."""
    if transfer.is_identity or transfer.source.is_local:
        return records.position
    places.refuse(
        np.isnan(records.position[:, 0]),
        records.point,
        "Only the height of the point is known, and its height system must be converted, which requires a "
        "horizontal position.",
        "Give the control points in the CRS and heights of the project, or add approximate x and y to the "
        "point.",
    )
    height_known = np.isfinite(records.position[:, 2])
    # A point without height is moved in plan at the height 0; within a datum that is exact.
    converted = transfer.positions(np.nan_to_num(records.position))
    converted[:, 2] = np.where(height_known, converted[:, 2], np.nan)
    return converted


def _roles(source: ControlInput, records: ControlRecords, places: Places) -> list[str]:
    names = records.point.to_pylist()
    unknown = [name for name in source.check_points if name not in set(names)]
    if unknown:
        raise Location(source.file, entity=unknown[0]).error(
            f"check_points names '{unknown[0]}', which is not in this file.", did_you_mean(unknown[0], names)
        )
    given = roles_of_rows(records.role, places, records.point)
    check = set(source.check_points)
    return [
        "check" if name in check else role or source.role for name, role in zip(names, given, strict=True)
    ]


def roles_of_rows(given: pa.Array, places: Places, names: pa.Array) -> list[str | None]:
    """Roles as given in the rows, None where missing.

    Raises
    ------
    InputError
        If there is another one.
    """
    roles: list[str | None] = given.to_pylist()
    for row, role in enumerate(roles):
        if role is not None and role not in _ROLES:
            raise places.error(
                row, f"The role '{role}' does not exist.", "Write control or check.", str(names[row])
            )
    return roles
