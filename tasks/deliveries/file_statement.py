"""Whether the statements of a file about its numbers agree with the project file."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyproj

from adjust.arrays import Floats
from tasks.coordinates.crs import MapFrame
from tasks.deliveries.length_units import METRES_PER_UNIT, length_factors
from tasks.errors import InputError, Location
from tasks.files.toml_text import toml_value
from tasks.formats.records import FileStatement
from tasks.settings.coordinates import ELLIPSOIDAL, LOCAL, Heights
from tasks.settings.inputs import ControlInput, ExposuresInput

# Two descriptions of one projection agree to rounding; different zones or parameters differ by metres.
_SAME_RAD = 1e-9
# The two feet differ by 2e-6.
_SAME_UNIT = 1e-7
_DATUMS = (
    ("WGS 84", re.compile(r"wgs\W?(19)?84|world geodetic system 1984", re.IGNORECASE)),
    ("NAD83", re.compile(r"nad\W?(19)?83|north american datum 1983", re.IGNORECASE)),
    ("NAD27", re.compile(r"nad\W?(19)?27|north american datum 1927", re.IGNORECASE)),
    ("ETRS89", re.compile(r"etrs\W?(19)?89|european terrestrial reference system 1989", re.IGNORECASE)),
    ("GDA94", re.compile(r"gda\W?(19)?94|geocentric datum of australia 1994", re.IGNORECASE)),
    ("GDA2020", re.compile(r"gda\W?2020|geocentric datum of australia 2020", re.IGNORECASE)),
)
_MISLABELLED = "If the file is mislabelled, correct it there."


def refuse_other_statement(
    file: Path,
    states: FileStatement,
    source: ExposuresInput | ControlInput,
    frame: MapFrame,
    position: Floats,
) -> None:
    """Raise if a file contradicts its declaration.

    Parameters
    ----------
    states : what the file says.
    source, frame : what the project file declares.
    position : (n, 3) as in the file.

    Raises
    ------
    InputError
        Naming what the file says, and the line of the project file that says the same.
    """
    for key, stated, declared in _plain_statements(states, source):
        if stated is not None and stated != declared:
            raise InputError(
                f"The file states {key} {stated}, the project file declares {declared}.",
                f'Declare {key} = "{stated}". {_MISLABELLED}',
                file=file,
                declare=f'{key} = "{stated}"' if stated != "geoid" else None,
            )
    if states.crs is not None and (states.crs == LOCAL) != frame.is_local:
        raise InputError(
            f'The file states the CRS "{states.crs}", the project file declares "{frame.name}".',
            f'Declare crs = "{states.crs}" for this input. {_MISLABELLED}',
            file=file,
            declare=f'crs = "{states.crs}"',
        )
    if frame.is_local:
        return
    datum = states.datum
    if states.crs is not None:
        stated_frame = _stated(file, states.crs)
        _refuse_other_units(file, stated_frame.crs, source, frame)
        _refuse_other_projection(file, _horizontal(stated_frame), frame, position)
        datum = datum or _datum_name(stated_frame)
    found, meant = _datum(datum), _datum(_datum_name(frame))
    if found is not None and meant is not None and found != meant:
        raise Location(file).error(
            f"The file states coordinates in the datum {found}, but {frame.name} is in {meant}.",
            f"Declare the CRS of the file. {_MISLABELLED}",
        )


def about_stated_heights(file: Path, states: FileStatement, heights: Heights) -> tuple[str, ...]:
    """A sentence if a file states heights above the sea, and the project file takes them as ellipsoidal."""
    if states.crs in (None, LOCAL) or heights.geoid is not None:
        return ()
    known = _stated(file, str(states.crs)).crs
    if not known.is_compound:
        return ()
    return (
        f"{file.name} states heights of {known.sub_crs_list[1].name}; they are taken as ellipsoidal, as "
        "declared. If they are above the sea, declare `heights` with their geoid.",
    )


def _stated(file: Path, crs: str) -> MapFrame:
    """The frame of a stated CRS."""
    frame = MapFrame(crs, ELLIPSOIDAL)
    try:
        _ = frame.crs
    except InputError as error:
        raise replace(error, file=file) from error
    return frame


def _horizontal(frame: MapFrame) -> MapFrame:
    """The frame without the heights that its CRS may include."""
    known = frame.crs
    return MapFrame(known.sub_crs_list[0].to_wkt(), ELLIPSOIDAL) if known.is_compound else frame


def _refuse_other_units(
    file: Path, stated: pyproj.CRS, source: ExposuresInput | ControlInput, frame: MapFrame
) -> None:
    """Refuse a file whose CRS is in another unit of length than the project file declares."""
    declared = length_factors(source, frame)
    parts = stated.sub_crs_list if stated.is_compound else [stated]
    for key, part, factor in zip(("length_unit", "height_unit"), parts, declared, strict=False):
        axis = part.axis_info[0]
        # Degrees are no lengths, of the file or of the declared CRS.
        if part.is_geographic or (key == "length_unit" and not frame.is_projected):
            continue
        if abs(axis.unit_conversion_factor / factor - 1.0) <= _SAME_UNIT:
            continue
        unit = next(
            (
                name
                for name, metres in METRES_PER_UNIT.items()
                if abs(axis.unit_conversion_factor / metres - 1.0) <= _SAME_UNIT
            ),
            None,
        )
        what = f"The file states {part.name}, which is in {axis.unit_name}."
        if unit is None:
            raise Location(file).error(what, "Convert the coordinates into metres.")
        raise Location(file).error(
            f"{what} The project file declares another {key}.", f'Declare {key} = "{unit}". {_MISLABELLED}'
        )


def _plain_statements(
    states: FileStatement, source: ExposuresInput | ControlInput
) -> list[tuple[str, str | None, str]]:
    heights = "ellipsoidal" if source.heights.geoid is None else "geoid"
    found: list[tuple[str, str | None, str]] = [("heights", states.heights, heights)]
    if isinstance(source, ExposuresInput):
        found += [
            ("position", states.position, source.position),
            ("angles.order", states.order, source.angles.order),
            ("angles.reference", states.reference, source.angles.reference),
        ]
    return found


def _refuse_other_projection(file: Path, stated: MapFrame, declared: MapFrame, position: Floats) -> None:
    """Refuse a file whose positions are different places on the earth in the two systems."""
    known = position[np.isfinite(position[:, :2]).all(axis=1)]
    if len(known) == 0:
        return
    flat = np.column_stack([known[:, :2], np.zeros(len(known))])
    # Positions are in metres already.
    unit = 1.0 if stated.crs.is_geographic else stated.crs.axis_info[0].unit_conversion_factor
    # Both are finite only where the coordinates can be in the CRS.
    away = np.abs(
        stated.to_geodetic(flat / unit)[:, :2] - MapFrame(declared.name, ELLIPSOIDAL).to_geodetic(flat)[:, :2]
    )
    if bool((away <= _SAME_RAD).all()):
        return
    code = stated.crs.to_authority(min_confidence=70)
    name = ":".join(code) if code is not None else stated.name
    if unit != 1.0:
        raise Location(file).error(
            f"The file states its coordinates in {stated.crs.name}; {declared.name} is another projection.",
            f"Declare the metric CRS of the same zone, and its length_unit. {_MISLABELLED}",
        )
    raise InputError(
        f"The file states its coordinates in {stated.crs.name} ({stated.name}), but {declared.name} is "
        "another projection.",
        f'Declare crs = "{name}" for this input. {_MISLABELLED}',
        file=file,
        declare=f"crs = {toml_value(name)}",
    )


def _datum_name(frame: MapFrame) -> str | None:
    geodetic = frame.crs.geodetic_crs
    return None if geodetic is None or geodetic.datum is None else geodetic.datum.name


def _datum(name: str | None) -> str | None:
    """The datum that a name denotes, among those that programs write; None: another one."""
    return next((datum for datum, like in _DATUMS if name and like.search(name)), None)
