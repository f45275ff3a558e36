"""Quaternions of files as rotations."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from adjust.arrays import Floats
from tasks.errors import Location


def rotations_of_quaternions(
    path: Path, quaternion: Floats, name: Sequence[str], line: Sequence[int]
) -> Floats:
    """Rotations (n, 3, 3) of quaternions w, x, y, z (n, 4), named by what they belong to.

    Raises
    ------
    InputError
        If one is not of length 1.
    """
    length = np.linalg.norm(quaternion, axis=1)
    bad = ~(np.abs(length - 1.0) < 1e-3)
    if bad.any():
        row = int(np.argmax(bad))
        raise Location(path, line[row], name[row]).error(
            f"The quaternion has the length {length[row]:.6g}; that of a rotation must be 1.",
            "Deliver the file again.",
        )
    w, x, y, z = (quaternion / length[:, None]).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.asarray(np.moveaxis(np.array(rows), -1, 0))
