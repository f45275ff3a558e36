"""Rational polynomials (RPC00B) instead of a camera: row and column as ratios of cubic polynomials.

    row_n = Σ a_i m_i(P, L, H) / Σ b_i m_i(P, L, H),   b_1 = 1,

with latitude P, longitude L and ellipsoidal height H, all scaled to −1 … 1, and the twenty monomials of the
standard (STDI-0002, appendix E). The ratio is fitted linearly, row · denominator = numerator, each equation
divided by the denominator found before (Tao and Hu, 2001); a small ridge keeps terms apart that a frame image
does not tell from each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats

TERMS = 20
# Ridge on coefficients of scaled monomials, and how often the denominators are found again.
_RIDGE = 1e-9
_ROUNDS = 4


@dataclass(frozen=True, eq=False)
class RationalPolynomials:
    """One image.

    Attributes
    ----------
    image_offset, image_scale : (2,) of row and column, pixels; the centre of the top-left pixel is (0, 0).
    ground_offset, ground_scale : (3,) of latitude, longitude (degrees) and ellipsoidal height (metres).
    numerator, denominator : (2, 20) coefficients of row and column.
    """

    image_offset: Floats
    image_scale: Floats
    ground_offset: Floats
    ground_scale: Floats
    numerator: Floats
    denominator: Floats

    def project(self, ground: Floats) -> Floats:
        """Row and column (n, 2) of latitude, longitude (degrees) and ellipsoidal height (n, 3)."""
        terms = monomials((ground - self.ground_offset) / self.ground_scale)
        scaled = (terms @ self.numerator.T) / (terms @ self.denominator.T)
        return np.asarray(scaled * self.image_scale + self.image_offset)


def monomials(ground: Floats) -> Floats:
    """The monomials (n, 20) of scaled latitude, longitude and height (n, 3), in the order of the standard."""
    p, l, h = ground.T  # noqa: E741  (the letters of the standard)
    one = np.ones_like(p)
    return np.stack(
        [
            one, l, p, h, l * p, l * h, p * h, l * l, p * p, h * h, p * l * h, l**3, l * p * p, l * h * h,
            l * l * p, p**3, p * h * h, l * l * h, p * p * h, h**3,
        ],
        axis=-1,
    )  # fmt: skip


def fit_rational_polynomials(ground: Floats, image: Floats) -> RationalPolynomials:
    """Rational polynomials of one image from ground points and where they are seen.

    Parameters
    ----------
    ground : (n, 3) latitude, longitude in degrees, ellipsoidal height in metres; spread over the image and
        over all heights that it will be used for.
    image : (n, 2) row and column.
    """
    ground_offset, ground_scale = _centred(ground)
    image_offset, image_scale = _centred(image)
    terms = monomials((ground - ground_offset) / ground_scale)
    scaled = (image - image_offset) / image_scale
    fitted = [_ratio(terms, scaled[:, k]) for k in range(2)]
    return RationalPolynomials(
        image_offset,
        image_scale,
        ground_offset,
        ground_scale,
        np.stack([numerator for numerator, _ in fitted]),
        np.stack([denominator for _, denominator in fitted]),
    )


def _centred(values: Floats) -> tuple[Floats, Floats]:
    low, high = values.min(axis=0), values.max(axis=0)
    return 0.5 * (low + high), np.maximum(0.5 * (high - low), np.finfo(float).tiny)


def _ratio(terms: Floats, value: Floats) -> tuple[Floats, Floats]:
    """Numerator and denominator (20,) whose ratio is the value (n,) at the points."""
    design = np.concatenate([terms, -value[:, None] * terms[:, 1:]], axis=1)
    denominator = np.concatenate([[1.0], np.zeros(TERMS - 1)])
    solved = np.zeros(design.shape[1])
    for _ in range(_ROUNDS):
        weight = 1.0 / (terms @ denominator)
        weighted = design * weight[:, None]
        normal = weighted.T @ weighted + _RIDGE * np.eye(design.shape[1])
        solved = np.linalg.solve(normal, weighted.T @ (value * weight))
        denominator = np.concatenate([[1.0], solved[TERMS:]])
    return solved[:TERMS], denominator
