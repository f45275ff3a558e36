"""What a format itself defines about its numbers, for every file.

A project file declares the same; what is not in these tables has to be asked of whoever delivered the file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class ImagePointMeaning:
    """Coordinates of image points.

    Attributes
    ----------
    unit : as `unit` of the project file.
    origin : which point of the first pixel has the coordinates (0, 0), as `pixel_origin`; None: no pixels are
        counted.
    """

    unit: Literal["px", "mm", "centred-px", "longer-side"]
    origin: Literal["corner", "centre"] | None = None


_CORNER, _CENTRE = ImagePointMeaning("px", "corner"), ImagePointMeaning("px", "centre")
#: Formats of image points whose unit is known. Lists of photos (PATB, BINGO, Pix4D) may have any.
IMAGE_POINT_MEANINGS: Mapping[str, ImagePointMeaning] = {
    "inpho": _CENTRE,
    "metashape-markers": _CORNER,
    "blocks-exchange": _CENTRE,
    "colmap": _CORNER,
    "opensfm": ImagePointMeaning("longer-side"),
    "odm-gcp": _CENTRE,
    "opensfm-gcp": ImagePointMeaning("longer-side"),
    "bundler": ImagePointMeaning("centred-px"),
    "opf": _CORNER,
    "openmvg": _CORNER,
    "micmac": _CORNER,
    "bal": ImagePointMeaning("centred-px"),
    "colmap-database": _CORNER,
}
#: Formats of exposures that are the result of an adjustment: of projection centres, and no observations.
ADJUSTED = frozenset(
    {
        "patb", "bingo", "inpho", "isat", "metashape-opk", "metashape", "pix4d", "blocks-exchange", "colmap",
        "opensfm", "bundler", "realityscan", "opf", "openmvg", "micmac", "bal",
    }
)  # fmt: skip
#: Those of them whose programs mostly take map coordinates as Cartesian.
IN_A_MAP = frozenset({"patb", "bingo", "inpho", "isat"})
#: Formats of programs whose model has no refraction: their cameras have it in focal length and distortion.
WITHOUT_REFRACTION = frozenset(
    {
        "metashape", "pix4d", "pix4d-cam", "blocks-exchange", "colmap", "opensfm", "opf", "openmvg", "micmac",
    }
)  # fmt: skip
#: Formats in which only the order of the fields says what they are: believed where no other reads it.
WITHOUT_MARK = ("odm-geo", "ign-mes", "ign-opk", "ign-app", "patb", "bingo", "pix4d")
