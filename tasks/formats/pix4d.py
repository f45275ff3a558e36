"""Pix4Dmapper's parameter folder: ``…_calibrated_external_camera_parameters.txt`` and ``…_tp_pix4d.txt``.

| file | line | read |
|---|---|---|
| external camera parameters | imageName X Y Z Omega Phi Kappa | CRS of the output, ω, φ, κ in degrees |
| tie points | image, then id x y scale, then −99 | pixels; as `photo_lists` |

The folder's ``…_tp_bingo.txt`` is read as ``bingo`` (mm, from the middle of the image).
"""

from __future__ import annotations

from pathlib import Path

from tasks.errors import InputError
from tasks.formats.plain_lines import lines
from tasks.formats.plain_records import exposures_of, numbers_of
from tasks.formats.records import AngleOrder, ExposureRecords, FileStatement

_HEAD = ["imagename", "x", "y", "z", "omega", "phi", "kappa"]


def read_pix4d_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read calibrated external camera parameters.

    Raises
    ------
    InputError
        With file and line: another header, fields missing.
    """
    rows = lines(path)
    if rows[0].lower().split() != _HEAD:
        raise InputError(
            "The first line is not 'imageName X Y Z Omega Phi Kappa'.",
            "Check that this is …_calibrated_external_camera_parameters.txt.",
            file=path,
            line=1,
        )
    image, values, at = [], [], []
    for number, line in enumerate(rows[1:], start=2):
        fields = line.rsplit(maxsplit=6)
        if not fields:
            continue
        values.append(numbers_of(path, fields[1:], 6, number, "X, Y, Z, ω, φ, κ"))
        image.append(fields[0].strip())
        at.append(number)
    return exposures_of(
        path,
        image,
        [row[:3] for row in values],
        [row[3:] for row in values],
        at,
        unit="deg",
        states=FileStatement(order="omega-phi-kappa"),
    )
