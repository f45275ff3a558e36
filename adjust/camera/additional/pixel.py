"""The shape of the pixels: columns wider or narrower than rows.

    x̃ = (1 + aspect) x,    ỹ = y

The sensor is stretched before the lens is modelled, so this set is applied first and the other sets are
evaluated at (x̃, ỹ). It is the aspect parameter of DBAT's camera models 3 and 5. B1 of Brown is its linear
form, applied in parallel with the distortion. The two differ by the aspect times the distortion, and
only one of them can be determined.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat, ParameterSet, Term


def _basis(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:  # noqa: ARG001
    result = np.zeros((len(xy), 2, len(names)))
    result[:, 0, :] = xy[:, :1]
    return result


SET = ParameterSet(
    "pixel",
    "shape of the pixels",
    "Börlin and Grussenmeyer, DBAT, camera models 3 and 5",
    (Term("aspect", "x is stretched before everything else", "1", "published"),),
    _basis,
    "The other sets are evaluated at the point displaced by the aspect. Use either this or B1 of Brown.",
    formulas=__doc__ or "",
    comes_first=("aspect",),
)
