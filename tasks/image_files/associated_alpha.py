"""Whether the grey values of a TIFF are already multiplied by its alpha, which GDAL does not tell readers.

TIFF 6.0, section 18: the tag ExtraSamples is 1 for associated and 2 for unassociated alpha.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, BinaryIO

_EXTRA_SAMPLES, _ASSOCIATED = 338, 1
#: Bands that are looked at, more than any image has besides its colours.
_MOST = 64
#: By the beginning of a file: byte order, place and form of the first offset, forms of a directory.
_FORMS = {
    b"II*\0": ("<", 4, "I", "H", "HHI4s"),
    b"MM\0*": (">", 4, "I", "H", "HHI4s"),
    b"II+\0": ("<", 8, "Q", "Q", "HHQ8s"),
    b"MM\0+": (">", 8, "Q", "Q", "HHQ8s"),
}


def has_associated_alpha(path: Path) -> bool:
    """Whether the first image of a file is a TIFF with associated alpha; False for every other file."""
    with path.open("rb") as stream:
        form = _FORMS.get(stream.read(4))
        try:
            return form is not None and _ASSOCIATED in _extra_samples(stream, *form)
        except struct.error:
            # What is wrong with the file is said by whoever reads its pixels.
            return False


def _extra_samples(
    stream: BinaryIO, order: str, place: int, offset: str, number: str, entry: str
) -> tuple[int, ...]:
    def read(words: str, at: int) -> tuple[Any, ...]:
        stream.seek(at)
        return struct.unpack(order + words, stream.read(struct.calcsize(order + words)))

    (directory,) = read(offset, place)
    (entries,) = read(number, directory)
    first, size = directory + struct.calcsize(number), struct.calcsize(order + entry)
    for at in range(first, first + size * entries, size):
        tag, _, count, value = read(entry, at)
        if tag == _EXTRA_SAMPLES:
            words = f"{min(count, _MOST)}H"
            is_here = 2 * count <= len(value)
            return read(words, at + size - len(value) if is_here else struct.unpack(order + offset, value)[0])
    return ()
