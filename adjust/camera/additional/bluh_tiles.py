"""BLUH's additional parameters of the CCD images that an UltraCam image is composed of.

Nine CCDs in four cones form the image. The central one defines its scale, position and rotation; each of the
eight outer tiles i has its own, relative to it. Tiles are numbered by ascending x (along flight), then by
ascending y; i counts them without the central one. With u, v from the centre of a tile in normalised
millimetres and P the value, Δ inside the tile is

    42 + i  −(u, v) P     scale
    50 + i  (−P, 0)       shift in x
    58 + i  (0, −P)       shift in y

and 66–73 are one of three types of perspective (``Tiles.perspective``):

    master4    the four corner tiles, those of the master cone, two each: −(u², uv) P, −(uv, v²) P
    outer8     each outer tile: −(uv, uv) P
    rotation8  each outer tile: (v, −u) P, a rotation

Numbers and names are published; the formulas, the numbering and the seams are reconstructed.

Seams depend on the image format. The default is 3 × 3 CCDs of 24 mm × 36 mm (along × across flight),
which fits all generations: with the format W and the CCD w, neighbours overlap by (3 w − W)/2, and the
seam is in the middle of the overlap, at ±(W − w)/4. ``Tiles.blend`` mixes the two tiles linearly over a width
about the seam, so that Δ is continuous; otherwise Δ has a step there.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import Column, ImageFormat, Perspective, Term, Tiles
from adjust.camera.additional.bluh_general import normalised_millimetre
from adjust.errors import AdditionalParametersError

_CCD_X, _CCD_Y = 24e-3, 36e-3
_GIVE_SEAMS = "Give the seams of the tiles, or check the turn between image axes and flight direction."

_PLACES = {
    (-1, -1): "rear right",
    (-1, 0): "rear",
    (-1, 1): "rear left",
    (0, -1): "right",
    (0, 1): "left",
    (1, -1): "front right",
    (1, 0): "front",
    (1, 1): "front left",
}
_OUTER = tuple(_PLACES)
_MASTER_CONE = tuple(place for place in _OUTER if 0 not in place)


def _terms_66_to_73(perspective: Perspective) -> tuple[Term, ...]:
    if perspective == "master4":
        meanings = [
            f"perspective in {axis}, {_PLACES[place]} tile" for place in _MASTER_CONE for axis in "xy"
        ]
        unit = "1/mm"
    elif perspective == "outer8":
        meanings, unit = [f"perspective, {place} tile" for place in _PLACES.values()], "1/mm"
    else:
        meanings, unit = [f"rotation, {place} tile" for place in _PLACES.values()], "1"
    return tuple(Term(str(66 + i), meaning, unit, "reconstructed") for i, meaning in enumerate(meanings))


TERMS = (
    *(
        Term(str(42 + i), f"scale, {place} tile", "1", "reconstructed")
        for i, place in enumerate(_PLACES.values())
    ),
    *(
        Term(str(50 + i), f"shift in x, {place} tile", "mm", "reconstructed")
        for i, place in enumerate(_PLACES.values())
    ),
    *(
        Term(str(58 + i), f"shift in y, {place} tile", "mm", "reconstructed")
        for i, place in enumerate(_PLACES.values())
    ),
    *_terms_66_to_73("master4"),
)


def variants(image_format: ImageFormat) -> tuple[Term, ...]:
    """The terms 66–73 as they are in an image format."""
    return () if image_format.tiles is None else _terms_66_to_73(image_format.tiles.perspective)


def tiles_of(image_format: ImageFormat) -> Tiles:
    """The 3 × 3 tiles of a format: its own, or those of CCDs of 24 mm × 36 mm.

    Raises
    ------
    AdditionalParametersError : if the format has other tiles than 3 × 3, or such CCDs do not make it up.
    """
    half_x, half_y = image_format.half_x, image_format.half_y
    tiles = image_format.tiles
    if tiles is None:
        _check_default_layout(half_x, half_y)
        seam_x, seam_y = (2.0 * half_x - _CCD_X) / 4.0, (2.0 * half_y - _CCD_Y) / 4.0
        return Tiles((-seam_x, seam_x), (-seam_y, seam_y))
    for axis, seams, half in (("x", tiles.seams_x, half_x), ("y", tiles.seams_y, half_y)):
        if len(seams) != 2 or not -half < seams[0] < seams[1] < half:
            raise AdditionalParametersError(
                f"The parameters 42–73 of BLUH need two ascending seams across {axis} inside the image, "
                f"±{1e3 * half:.3f} mm, and have {[round(1e3 * seam, 3) for seam in seams]} mm.",
                _GIVE_SEAMS,
            )
    return tiles


def _check_default_layout(half_x: float, half_y: float) -> None:
    for half, ccd in ((half_x, _CCD_X), (half_y, _CCD_Y)):
        if not ccd < 2.0 * half <= 3.0 * ccd:
            raise AdditionalParametersError(
                f"Nine CCDs of 24 mm × 36 mm, the layout that the parameters 42–73 of BLUH take by default, "
                f"do not make up an image of {2e3 * half_x:.3f} mm along × {2e3 * half_y:.3f} mm across.",
                _GIVE_SEAMS,
            )


class _Along:
    """The three tiles along one axis.

    Attributes
    ----------
    weights : (3, n) of each tile at each point; their sum is 1.
    from_middle : (3, n) coordinate from the middle of each tile, normalised millimetres.
    """

    def __init__(
        self, metres: Floats, half: float, seams: tuple[float, ...], blend: float, unit: float
    ) -> None:
        below = np.stack([_share_below(metres, seam, blend) for seam in seams])
        self.weights = np.stack([below[0], below[1] - below[0], 1.0 - below[1]])
        edges = np.array([-half, *seams, half])
        self.from_middle = (metres - 0.5 * (edges[:-1] + edges[1:])[:, None]) / unit


def _share_below(coordinate: Floats, seam: float, blend: float) -> Floats:
    """Share (n,) of the tile below a seam: 1 … 0 over the width of the blend, or at once where it is 0.

    A point on a hard seam belongs to the tile nearer the centre of the image.
    """
    if blend > 0.0:
        return np.asarray(np.clip(0.5 - (coordinate - seam) / blend, 0.0, 1.0))
    return np.where(coordinate < seam if seam < 0.0 else coordinate <= seam, 1.0, 0.0)


class _Tile:
    """Points as one tile sees them.

    Attributes
    ----------
    u, v : (n,) from the middle of the tile, normalised millimetres.
    weight : (n,) inside the tile −1 normalised millimetre, in metres; 0 outside, between them where
        neighbours are blended.
    """

    def __init__(self, along_x: _Along, along_y: _Along, place: tuple[int, int], unit: float) -> None:
        row, column = place[0] + 1, place[1] + 1
        self.weight = -unit * along_x.weights[row] * along_y.weights[column]
        self.u, self.v = along_x.from_middle[row], along_y.from_middle[column]

    @cached_property
    def nothing(self) -> Floats:
        return np.zeros_like(self.weight)

    @cached_property
    def weighted_u(self) -> Floats:
        return np.asarray(self.u * self.weight)

    @cached_property
    def weighted_v(self) -> Floats:
        return np.asarray(self.v * self.weight)

    @cached_property
    def weighted_uv(self) -> Floats:
        return np.asarray(self.weighted_u * self.v)


# Δ for P = 1, metres.
_TileFunction = Callable[[_Tile], Column]
_OF_EVERY_TILE: tuple[_TileFunction, ...] = (
    lambda t: (t.weighted_u, t.weighted_v),
    lambda t: (t.weight, t.nothing),
    lambda t: (t.nothing, t.weight),
)
_PERSPECTIVE_OF_OUTER: dict[Perspective, _TileFunction] = {
    "outer8": lambda t: (t.weighted_uv, t.weighted_uv),
    "rotation8": lambda t: (-t.weighted_v, t.weighted_u),
}
_PERSPECTIVE_OF_MASTER: tuple[_TileFunction, ...] = (
    lambda t: (t.weighted_u * t.u, t.weighted_uv),
    lambda t: (t.weighted_uv, t.weighted_v * t.v),
)


def _function_of(number: int, perspective: Perspective) -> tuple[tuple[int, int], _TileFunction]:
    """Place of the tile, and the function, of a term."""
    if number < 66:
        kind, tile = divmod(number - 42, 8)
        return _OUTER[tile], _OF_EVERY_TILE[kind]
    if perspective == "master4":
        tile, axis = divmod(number - 66, 2)
        return _MASTER_CONE[tile], _PERSPECTIVE_OF_MASTER[axis]
    return _OUTER[number - 66], _PERSPECTIVE_OF_OUTER[perspective]


def columns(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> list[Column]:
    """Correction Δx (n,), Δy (n,) of each term for a value of 1, metres, see ``base.ParameterSet``."""
    layout = tiles_of(image_format)
    unit = normalised_millimetre(image_format)
    x, y = np.ascontiguousarray(xy.T)
    along_x = _Along(x, image_format.half_x, layout.seams_x, layout.blend, unit)
    along_y = _Along(y, image_format.half_y, layout.seams_y, layout.blend, unit)
    tiles = {place: _Tile(along_x, along_y, place, unit) for place in _OUTER}
    result: list[Column] = []
    for name in names:
        place, function = _function_of(int(name), layout.perspective)
        result.append(function(tiles[place]))
    return result
