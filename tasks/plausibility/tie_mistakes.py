"""Everything that the rays of tie points show of a delivery: wrong readings, strips and images mixed up.

A run asks this before it refuses orientations that no common mistake explains; the doctor asks always. Strips
are mixed up whose images are numbered otherwise in the exposures than in the image points.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from adjust.arrays import Floats, Ints
from tasks.plausibility.declared_accuracy import TieLimits
from tasks.plausibility.diagnosis import TieDiagnosis, TieMisses, diagnosed, exchanged_images
from tasks.plausibility.hypotheses import with_orientations_of
from tasks.plausibility.mistake import Mistake
from tasks.plausibility.orientation_slips import Delivered, Slip

# An order is taken when it brings the misses of the strip this many times down.
_MARGIN = 3.0
# In shorter strips it cannot be told from exchanged images.
_SHORTEST = 4
_MOST_STRIPS = 4


def tie_mistakes(
    delivered: Delivered, misses: TieMisses, hypotheses: Sequence[Slip], limits: TieLimits
) -> TieDiagnosis:
    """Mistakes of the whole delivery, then those of single strips, then exchanged images.

    Parameters
    ----------
    delivered : as declared.
    limits : above which an explanation is looked for.

    Returns
    -------
    diagnosis : with the exposures of each strip in the order in which they fit, and exchanged images as
    delivered.
    """
    whole = diagnosed(delivered, misses, hypotheses, limits)
    strips, ordered = _disordered_strips(whole.delivered, misses, limits)
    mistakes = [*whole.mistakes, *strips]
    if whole.left_px <= limits.wrong_px or strips:
        mistakes += exchanged_images(ordered, misses, limits)
    return replace(whole, delivered=ordered, mistakes=tuple(mistakes))


def _disordered_strips(
    delivered: Delivered, misses: TieMisses, limits: TieLimits
) -> tuple[list[Mistake], Delivered]:
    """Strips that fit the others with their exposures shifted by one image or in the opposite order.

    Returns
    -------
    mistakes : one for each strip, the worst first.
    delivered : with the order in which they fit.
    """
    found: list[Mistake] = []
    while len(found) < _MOST_STRIPS:
        medians = misses.of_images(delivered)
        strips = {strip: _of_strip(medians, rows) for strip, rows in _strips(delivered)}
        worst = max(strips, key=strips.__getitem__, default=None)
        if worst is None or strips[worst] <= limits.wrong_px:
            break
        rows = dict(_strips(delivered))[worst]
        trials = []
        for words, order in _orders(rows):
            source = np.arange(len(medians))
            source[rows] = order
            other = replace(delivered, given=with_orientations_of(delivered.given, source))
            trials.append((_of_strip(misses.of_images(other), rows), words, other))
        left, words, other = min(trials, key=lambda trial: trial[0])
        if left * _MARGIN > strips[worst] or left > limits.wrong_px:
            break
        name = delivered.given.strips[worst]
        found.append(
            Mistake(
                f"The exposures of strip {name} look {words}.",
                (f"{left:.1f} px: in that order", f"{strips[worst]:.1f} px: as delivered"),
                f"Correct the names of the images of strip {name} in the file of the exposures.",
            )
        )
        delivered = other
    return found, delivered


def _strips(delivered: Delivered) -> Iterator[tuple[int, Ints]]:
    """Number of every named strip that is long enough, and its images (k,) in their order."""
    strip = delivered.given.strip_of_image
    for number in np.unique(strip):
        rows = np.flatnonzero(strip == number)
        if delivered.given.strips[number] and len(rows) >= _SHORTEST:
            yield int(number), rows


def _orders(rows: Ints) -> Iterator[tuple[str, Ints]]:
    yield "shifted by one image: each has what belongs to its next one", np.roll(rows, 1)
    yield "shifted by one image: each has what belongs to its previous one", np.roll(rows, -1)
    yield "numbered in the opposite order", rows[::-1]


def _of_strip(medians: Floats, rows: Ints) -> float:
    """Median of the images of a strip, px; very large where most rays do not intersect."""
    return float(np.median(np.minimum(medians[rows], 1e9)))
