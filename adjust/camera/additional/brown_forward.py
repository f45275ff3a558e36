"""Brown's distortion from the ideal to the measured point: OpenCV, COLMAP, Metashape, OpenSfM, Pix4D.

With the ideal point u = x/c, v = −y/c (v positive down the image, as in those programs) and r² = u² + v²

    u' = u (1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸) + 2 p1 u v + p2 (r² + 2 u²)
    v' = v (1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸) + p1 (r² + 2 v²) + 2 p2 u v
    x_measured − x0 = c (u' + b1 u' + b2 v'),    y_measured − y0 = −c v'

All coefficients are dimensionless, because the ideal point is divided by the current focal length.
k1, k2, k3, p1, p2 are identical to those of OpenCV, COLMAP, OpenSfM and OPF. Metashape calls p2, p1 P1, P2,
and its B1, B2 are b1, b2 times the focal length in pixels. fx = c (1 + b1), fy = c. k4 is Metashape's; k4 to
k6 of OpenCV's rational model have a different meaning.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat, ParameterSet, Term

_LENS = (
    Term("k1", "radial, r³", "1", "published"),
    Term("k2", "radial, r⁵", "1", "published"),
    Term("k3", "radial, r⁷", "1", "published"),
    Term("k4", "radial, r⁹", "1", "published"),
    Term("p1", "tangential, across x", "1", "published"),
    Term("p2", "tangential, along x", "1", "published"),
)
_SENSOR = (
    Term("b1", "affinity: x is stretched after the lens", "1", "published"),
    Term("b2", "shear: x grows with v after the lens", "1", "published"),
)


def _basis(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:
    c = image_format.needed_focal_length
    u, v = xy[:, 0] / c, -xy[:, 1] / c
    square = u * u + v * v
    result = np.zeros((len(xy), 2, len(names)))
    for column, name in enumerate(names):
        of_u, of_v = result[:, 0, column], result[:, 1, column]
        match name:
            case "k1" | "k2" | "k3" | "k4":
                power = square ** int(name[1])
                of_u[:], of_v[:] = u * power, v * power
            case "p1":
                of_u[:], of_v[:] = 2.0 * u * v, square + 2.0 * v * v
            case "p2":
                of_u[:], of_v[:] = square + 2.0 * u * u, 2.0 * u * v
            case "b1":
                of_u[:] = u
            case "b2":
                of_u[:] = v
    return np.asarray(result * np.array([c, -c])[:, None])


SET = ParameterSet(
    "brown-forward",
    "Brown, from ideal to measured",
    "OpenCV, calib3d: projectPoints; COLMAP, OPENCV; Agisoft Metashape, Appendix C: Camera models",
    (*_LENS, *_SENSOR),
    _basis,
    "A distortion, evaluated at the ideal point: values of `brown` are not values of this set, neither "
    "with their sign nor without; `aerocal convert-distortion` converts. k1 to k4 are strongly "
    "correlated with each other and with the focal length.",
    formulas=__doc__ or "",
    comes_first=tuple(term.name for term in _LENS),
    direction="forward",
)
