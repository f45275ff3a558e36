"""Distances between object points of all input files, in metres."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from adjust.arrays import Floats
from tasks.deliveries.control import roles_of_rows
from tasks.deliveries.source_rows import METRES, Places, SigmaRange, about_extra, joined, refuse_sigmas
from tasks.formats.records import DistanceRecords
from tasks.formats.register import DISTANCE_FORMATS
from tasks.settings.inputs import DistancesInput

_METRES = {"m": 1.0, "mm": 1e-3}


def distance_columns(
    sources: Sequence[DistancesInput],
) -> tuple[Mapping[str, Any], Mapping[str, pa.Array], tuple[str, ...]]:
    """Columns of ``distances.parquet``, further columns of the files, and remarks.

    Raises
    ------
    InputError
        For a distance given twice, one from a point to itself, one that is not positive or has no standard
        deviation, an unknown role.
    """
    records = [DISTANCE_FORMATS[source.format](source.file) for source in sources]
    places = Places.of_files([r.file for r in records], [r.line for r in records])
    _refuse_same_pairs(records, places)
    values = [_metres(source, own) for source, own in zip(sources, records, strict=True)]
    columns = {
        "point": pa.concat_arrays([r.point for r in records]),
        "other_point": pa.concat_arrays([r.other_point for r in records]),
        "distance_m": np.concatenate([distance for distance, _ in values]),
        "sigma_m": np.concatenate([sigma for _, sigma in values]),
        "role": [
            role or source.role
            for source, own in zip(sources, records, strict=True)
            for role in roles_of_rows(own.role, Places.of_files([own.file], [own.line]), own.point)
        ],
    }
    extra = joined([r.extra for r in records], [len(r.line) for r in records])
    return columns, extra, tuple(about_extra(records))


def _refuse_same_pairs(records: Sequence[DistanceRecords], places: Places) -> None:
    """Refuse a distance from a point to itself, and one given twice, in either direction."""
    ends = [
        [str(name) for own in records for name in getattr(own, side).to_pylist()]
        for side in ("point", "other_point")
    ]
    same = np.array(ends[0], dtype=object) == np.array(ends[1], dtype=object)
    places.refuse(same, ends[0], "The distance is from a point to itself.", "Name the other end point.")
    names, place = np.unique(np.array(ends[0] + ends[1], dtype=object), return_inverse=True)
    one, other = np.sort(place.reshape(2, -1), axis=0)
    places.refuse_duplicates(one * len(names) + other, "distance", ends)


def _metres(source: DistancesInput, records: DistanceRecords) -> tuple[Floats, Floats]:
    """Distances and standard deviations (n,) of one input."""
    places = Places.of_files([source.file], [records.line])
    factor, names = _METRES[source.unit], records.point
    places.refuse(
        ~(records.distance > 0.0),
        names,
        lambda row: f"The distance {records.distance[row]:g} is not positive.",
        "Correct it, or delete the line.",
    )
    own = SigmaRange(METRES.lowest / factor, METRES.highest / factor, source.unit)
    refuse_sigmas(places, records.sigma[:, None], names, own)
    given = np.nan if source.sigma is None else source.sigma
    sigma = np.where(np.isnan(records.sigma), given, records.sigma)
    remedy = "Give `sigma` in [inputs.distances], or a column sigma."
    places.refuse(np.isnan(sigma), names, "The distance has no standard deviation.", remedy)
    return records.distance * factor, sigma * factor
