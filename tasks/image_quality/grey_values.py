"""Grey values of a band: pixels that are clipped or without data, and values that were scaled from 8 bits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from adjust.arrays import Bools, Ints
from tasks.errors import Location
from tasks.image_files.image_reader import ImageDescription, Pixels

#: Part of the pixels at the largest value above which a band is called overexposed.
OVEREXPOSED = 0.01
#: Of so many rows one is looked at.
_EVERY = 4
_EIGHT_BITS, _SIXTEEN_BITS = 256, 65_536
#: Different grey values at least, and median distance between them, of an image that was scaled.
_FEWEST, _APART = 16, 8
#: Fewest bits of a sensor whose values stand in 16 bits, and pixels that must have the largest value of them.
_SENSOR_BITS, _CLIPPED = 10, 16


def clipping_value(about: ImageDescription, pixels: Pixels) -> float:
    """Grey value at which some pixels of a band are clipped: the largest of its type or of a sensor's bits.

    Files seldom say that a sensor has 10 to 15 bits of 16. It is seen where the largest value among these
    pixels is that of such a sensor, and many of them have it.
    """
    greatest = int(pixels.max(initial=0)) if about.dtype == "uint16" else 0
    return _largest_of_sensor(about, greatest, int(np.count_nonzero(pixels == greatest)))


def _largest_of_sensor(about: ImageDescription, greatest: int, count: int) -> float:
    """The same, from the greatest value there is and how many pixels have it."""
    is_full = greatest >= 2**_SENSOR_BITS - 1 and greatest & (greatest + 1) == 0
    of_sensor = about.dtype == "uint16" and about.bits == 16 and is_full and count >= _CLIPPED
    return float(greatest) if of_sensor else about.largest


@dataclass(eq=False)
class GreyValues:
    """Statistics of the grey values of a band so far.

    Attributes
    ----------
    about : of its image.
    pixels, known : number of pixels, and of those that take part.
    """

    about: ImageDescription
    pixels: int = 0
    known: int = 0
    _clipped: int = 0
    _count: Ints = field(default_factory=lambda: np.zeros(_SIXTEEN_BITS, dtype=np.int64))
    _seen: Bools = field(default_factory=lambda: np.zeros(_SIXTEEN_BITS, dtype=bool))

    def take(self, pixels: Pixels, known: Bools) -> None:
        """Add some rows (rows, columns), with a mask of the pixels that take part."""
        rows, known = pixels[::_EVERY], known[::_EVERY]
        self.pixels += rows.size
        self.known += int(np.count_nonzero(known))
        if self.about.dtype == "uint16":
            self._count += np.bincount(rows.ravel(), minlength=_SIXTEEN_BITS)
            self._seen[rows[known]] = True
        elif not self.about.dtype.startswith("float"):
            self._clipped += int(np.count_nonzero(rows >= self.about.largest))

    @property
    def largest(self) -> float:
        """Largest value of the type; of a sensor of fewer bits where no pixel of the band exceeds it."""
        greatest = int(np.flatnonzero(self._count)[-1]) if self._count.any() else 0
        return _largest_of_sensor(self.about, greatest, int(self._count[greatest]))

    @property
    def clipped(self) -> int:
        """Number of pixels at the largest value."""
        return self._clipped + int(self._count[int(min(self.largest, _SIXTEEN_BITS)) :].sum())

    @property
    def scaled(self) -> int | None:
        """Number of different grey values, if they lie so far apart that they come from 8 bits; else None."""
        values = np.flatnonzero(self._seen)
        enough = _FEWEST <= len(values) <= _EIGHT_BITS
        # Not by the range alone: a dark image has few values, and hot pixels far beyond them.
        return len(values) if enough and np.median(np.diff(values)) >= _APART else None

    @property
    def overexposed(self) -> float | None:
        """Share of the pixels at the largest value, if it is too large; otherwise None."""
        part = self.clipped / max(self.pixels, 1)
        return part if part > OVEREXPOSED else None

    def sentences(self, band: int) -> Iterator[str]:
        """Remarks on a band that can be examined at least in part."""
        name = f"{self.about.path.name}, band {band}"
        if self.overexposed is not None:
            yield (
                f"{name}: {100.0 * self.overexposed:.0f} % of the pixels have the largest value "
                f"{self.largest:.0f}: it is overexposed. These pixels are not used."
            )
        if self.scaled is not None:
            yield (
                f"{name}: {self.scaled} different grey values of 16 bits: it was scaled from 8 bits. Its "
                "noise includes that of the previous rounding."
            )

    def require_raw(self, band: int) -> None:
        """Refuse a flat image that is overexposed, or was scaled from 8 bits.

        Raises
        ------
        InputError
            Saying which of them.
        """
        if self.overexposed is not None:
            raise Location(self.about.path).error(
                f"Band {band} is overexposed: {100.0 * self.overexposed:.0f} % of the pixels have the "
                f"largest value {self.largest:.0f}.",
                "Expose flat images to about half the range.",
            )
        if self.scaled is not None:
            raise Location(self.about.path).error(
                f"Band {band} has {self.scaled} different grey values of 16 bits: it was scaled from 8 bits.",
                "Give the images as the sensor delivers them.",
            )

    def require_something(self, band: int) -> None:
        """Refuse a band without a usable pixel.

        Raises
        ------
        InputError
            Saying why.
        """
        if self.known:
            return
        why = "are without data or 0"
        if self.clipped:
            why = f"have the largest value {self.largest:.0f}, or no data"
        raise Location(self.about.path).error(
            f"Band {band} has no pixel that can be examined: all {why}.",
            "Give another image, or the bands in image_quality.bands.",
        )
