"""Numbers with as many digits as the accuracy of an orientation needs, and no more."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.rotation import to_omega_phi_kappa, to_phi_omega_kappa
from tasks.handover.delivery import Angles, Delivery

#: Decimals of metres, of an angle (1e-7° are 0.007 mm at 4 km), of elements of a rotation.
METRES, ANGLES, ROTATION = 4, 7, 12
#: The same of angles in each unit.
DECIMALS = {"deg": ANGLES, "gon": ANGLES, "rad": ANGLES + 2}
_PER_RADIAN = {"deg": 180.0 / np.pi, "gon": 200.0 / np.pi, "rad": 1.0}


def in_angles(rotations: Floats, angles: Angles) -> Floats:
    """(n, 3) angles of rotations world from camera (n, 3, 3), in the order their system names them."""
    if angles.order == "omega-phi-kappa":
        found = to_omega_phi_kappa(rotations)
    else:
        found = to_phi_omega_kappa(rotations)[:, [1, 0, 2]]
    return np.asarray(found * _PER_RADIAN[angles.unit])


def orientations(delivery: Delivery, angles: Angles | None = None) -> list[list[str]]:
    """X, Y, Z and three angles of each image, as texts; angles in the order their system names them."""
    pose, system = delivery.handed.pose, Angles() if angles is None else angles
    turned = in_angles(pose.map_from_camera, system)
    return [
        [*fixed(centre, METRES), *fixed(turn, DECIMALS[system.unit])]
        for centre, turn in zip(pose.centre, turned, strict=True)
    ]


def table(header: Sequence[str], rows: Iterable[Sequence[object]], separator: str = ",") -> str:
    """Rows of texts with a header as a text file; names with separators are quoted."""
    stream = io.StringIO()
    writer = csv.writer(stream, delimiter=separator, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return stream.getvalue()


def fixed(values: Iterable[float], decimals: int) -> list[str]:
    """Numbers with this many decimals; never −0."""
    return [
        f"{value + 0.0:.{decimals}f}"
        for value in np.round(np.fromiter(values, np.float64), decimals).tolist()
    ]


def known(values: Iterable[float], decimals: int) -> list[str]:
    """The same; empty where one is not known."""
    return [text if text != "nan" else "" for text in fixed(values, decimals)]


def fixed_rows(values: Floats, decimals: int) -> list[list[str]]:
    """Rows (n, k) of numbers with this many decimals, as ``fixed``."""
    cells, width = fixed(values.ravel(), decimals), values.shape[1]
    return [cells[k : k + width] for k in range(0, len(cells), width)]
