"""Sets made of products g_i(x) h_j(y), with one polynomial of each degree 0 … N along each axis.

Ebner (1976), Grün (1978) and Tang, Fritsch and Cramer (2012) follow one pattern. Shift, scale, rotation and
tilt of the image belong to the exterior orientation and must not be parameters as well. So the products
1, x, y, x², x y, y² (x² for g_2, y² for h_2) appear in six combinations only,

    1: (x, −y)    2: (y, x)    3: (−x², x y)    4: (x y, −y²)    5: (y², 0)    6: (0, x²)

with weights on their parts, and every other product is one parameter in x and another in y:
2 (N + 1)² − 6 parameters. Where the polynomials are orthogonal over the points of the image, and the
weights chosen for it, the parameters are orthogonal to each other and to the exterior orientation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import Basis, ImageFormat, ParameterSet, Status, Term

Degrees = tuple[int, int]


@dataclass(frozen=True)
class Products:
    """The products of one parameter: degrees (i, j) of g_i h_j in Δx and in Δy; None where there is none."""

    in_x: Degrees | None
    in_y: Degrees | None


COMBINED = (
    Products((1, 0), (0, 1)),
    Products((0, 1), (1, 0)),
    Products((2, 0), (1, 1)),
    Products((1, 1), (0, 2)),
    Products((0, 2), None),
    Products(None, (2, 0)),
)


def all_products(degree: int) -> tuple[Products, ...]:
    """The six combinations, then every other product by total degree, in x and in y."""
    in_combinations = {(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)}
    others = [
        (i, total - i)
        for total in range(2 * degree + 1)
        for i in range(min(total, degree), max(total - degree, 0) - 1, -1)
        if (i, total - i) not in in_combinations
    ]
    return (*COMBINED, *(item for ij in others for item in (Products(ij, None), Products(None, ij))))


@dataclass(frozen=True)
class ProductScheme:
    """What distinguishes one set of products from another.

    Attributes
    ----------
    symbol : letter of the polynomials.
    products : of every parameter, in order; the first six are ``COMBINED``.
    polynomials : (coordinates (n,), half side of the image) → (N + 1, n), the polynomials of one axis.
    weights : image format → (4, 2) weights of the parts in x and in y of parameters 1 … 4.
    unit : of a parameter whose products have the total degree d.
    metres : length of the unit in which the polynomials are evaluated; for normalised ones any.
    effect : Δ in metres of a product with the value 1.
    """

    symbol: str
    products: tuple[Products, ...]
    polynomials: Callable[[Floats, float], Floats]
    weights: Callable[[ImageFormat], Floats]
    unit: Callable[[int], str]
    metres: float
    effect: float

    def parameter_set(
        self, name: str, title: str, source: str, status: Status, note: str, formulas: str
    ) -> ParameterSet:
        """The set of these products, its terms numbered from 1."""
        terms = tuple(
            Term(str(number), self._meaning(item), self.unit(_total_degree(item)), status)
            for number, item in enumerate(self.products, start=1)
        )
        return ParameterSet(name, title, source, terms, self._basis(), note, formulas=formulas)

    def _basis(self) -> Basis:
        def basis(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:
            of_x = self.polynomials(xy[:, 0] / self.metres, image_format.half_x / self.metres)
            of_y = self.polynomials(xy[:, 1] / self.metres, image_format.half_y / self.metres)
            weights = np.ones((len(self.products), 2))
            weights[:4] = self.weights(image_format)
            weights *= self.effect
            result = np.zeros((len(xy), 2, len(names)))
            for column, name in enumerate(names):
                item = self.products[int(name) - 1]
                for axis, degrees in enumerate((item.in_x, item.in_y)):
                    if degrees is not None:
                        i, j = degrees
                        result[:, axis, column] = weights[int(name) - 1, axis] * of_x[i] * of_y[j]
            return result

        return basis

    def _meaning(self, item: Products) -> str:
        parts = []
        for axis, degrees in (("x", item.in_x), ("y", item.in_y)):
            if degrees is not None:
                factors = zip(degrees, "xy", strict=True)
                product = " ".join(f"{self.symbol}{degree}({along})" for degree, along in factors if degree)
                parts.append(f"{product} in {axis}")
        return ", ".join(parts)


def _total_degree(item: Products) -> int:
    return max(sum(degrees) for degrees in (item.in_x, item.in_y) if degrees is not None)


def per_millimetre(degree: int) -> str:
    """Unit of a parameter whose products have a total degree: ``1``, ``1/mm``, ``1/mm²`` and so on."""
    superscripts = ("", "", "²", "³", "⁴", "⁵", "⁶", "⁷")
    return "1" if degree == 1 else f"1/mm{superscripts[degree - 1]}"


def weights_against_orientation(image_format: ImageFormat, second: float, fourth: float) -> Floats:
    """Weights (4, 2) that keep parameters 1 … 4 clear of scale, rotation and tilt.

    A tilt moves the points by (x², x y) and (x y, y²) in addition to a shift. With mean squares ⟨x²⟩ and
    ⟨k²⟩, k = x² − ⟨x²⟩, the combination (−w k, x y) is orthogonal to (k, x y) if w = ⟨x²⟩⟨y²⟩/⟨k²⟩; likewise
    (x, −w y) to the scale (x, y) if w = ⟨x²⟩/⟨y²⟩. In a square image parameters 1 and 2 have the weight 1.

    Parameters
    ----------
    second, fourth : ⟨x²⟩/b² and ⟨k²⟩/b⁴ over the points of one axis with the half side b.
    """
    ratio = (image_format.half_y / image_format.half_x) ** 2
    tilt = second**2 / fourth
    return np.array([[1.0, -1.0 / ratio], [1.0, ratio], [-tilt * ratio, 1.0], [1.0, -tilt / ratio]])
