"""Plausible magnitudes of numbers in settings and deliveries.

Far wider than anything that is measured: what lies outside is a mistake of unit or typing, and would come out
of the computation as an overflow, or as a matrix that has no inverse.
"""

from __future__ import annotations

import math

#: Positive quantities, σ among them, in whatever unit they are given: a millionth of a millimetre to 1000 km.
SMALLEST, LARGEST = 1e-9, 1e9
#: Columns or rows of an image.
MOST_PIXELS = 1_000_000
#: Any number at all; between zero and the tiny one there is none.
_TINY, HUGE = 1e-60, 1e15
#: Whole numbers as TOML has them.
_MOST_BITS = 63


def trouble_in_number(value: float) -> str | None:
    """What is wrong with a number, as a sentence; None: nothing."""
    if isinstance(value, int):
        return None if value.bit_length() <= _MOST_BITS else "The whole number has more than 64 bits."
    if not math.isfinite(value):
        return f"The number {value} is not finite."
    if value != 0.0 and not _TINY <= abs(value) <= HUGE:
        return (
            f"The number {value:g} is not possible for a quantity: too "
            f"{'large' if abs(value) > HUGE else 'small'}."
        )
    return None
