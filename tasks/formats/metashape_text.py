"""Metashape's OPK text: photo, X, Y, Z, ω, φ, κ in degrees and the rotation camera from ground, by tabs.

Coordinates and angles are of the CRS and the grid that the export was made in.
"""

from __future__ import annotations

from array import array
from pathlib import Path

import numpy as np

from tasks.errors import InputError
from tasks.formats.long_columns import table_of
from tasks.formats.plain_lines import numbered_lines
from tasks.formats.plain_records import degrees_of_rotations, exposures_of, numbers_of
from tasks.formats.records import AngleOrder, ExposureRecords, FileStatement

# Both are printed with six decimals and more.
_SAME_DEG = 1e-3
# Elements of rotations that are compared together.
_TOGETHER = 9 * 10_000


def read_metashape_opk(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read orientations.

    Raises
    ------
    InputError
        With file and line: fields missing, angles that are not those of the rotation next to them.
    """
    image: list[str] = []
    values, at = array("d"), array("q")
    rotations = array("d")
    for number, line in numbered_lines(path):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        fields = line.split("\t") if "\t" in line else line.split()
        image.append(fields[0].strip())
        found = numbers_of(path, fields[1:], 15, number, "X, Y, Z, ω, φ, κ and nine elements")
        values.extend(found[:6])
        rotations.extend(found[6:])
        at.append(number)
        if len(rotations) == _TOGETHER:
            _refuse_other_angles(path, rotations, values, image, at)
            rotations = array("d")
    _refuse_other_angles(path, rotations, values, image, at)
    table = table_of(values, 6)
    states = FileStatement(order="omega-phi-kappa")
    return exposures_of(path, image, table[:, :3], table[:, 3:], at, unit="deg", states=states)


def _refuse_other_angles(
    path: Path, rotations: array[float], values: array[float], image: list[str], at: array[int]
) -> None:
    """Compare the last rows with the rotations beside them."""
    count = len(rotations) // 9
    first = len(image) - count
    rotation = table_of(rotations, 9).reshape(-1, 3, 3).transpose(0, 2, 1)
    angles = degrees_of_rotations(path, rotation, image[first:], at[first:])
    stated = np.array(values[6 * first :]).reshape(-1, 6)[:, 3:]
    away = np.abs((angles - stated + 180.0) % 360.0 - 180.0).max(axis=1, initial=0.0)
    if (away > _SAME_DEG).any():
        row = int(np.argmax(away))
        raise InputError(
            f"Omega, phi, kappa differ by {away[row]:.3g}° from the rotation next to them.",
            "Export the orientations again, as OPK.",
            file=path,
            line=at[first + row],
            entity=image[first + row],
        )
