"""Everything that the rays of tie points show of a delivery: wrong readings, strips and images mixed up.

A run asks this before it refuses orientations that no common mistake explains; the doctor asks always.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from tasks.plausibility.declared_accuracy import TieLimits
from tasks.plausibility.diagnosis import TieDiagnosis, TieMisses, diagnosed, exchanged_images
from tasks.plausibility.disordered_strips import disordered_strips
from tasks.plausibility.orientation_slips import Delivered, Slip


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
    strips, ordered = disordered_strips(whole.delivered, misses, limits)
    mistakes = [*whole.mistakes, *strips]
    if whole.left_px <= limits.wrong_px or strips:
        mistakes += exchanged_images(ordered, misses, limits)
    return replace(whole, delivered=ordered, mistakes=tuple(mistakes))
