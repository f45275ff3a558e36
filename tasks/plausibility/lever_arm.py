"""Whether the signs of a given lever arm are right, judged by the estimated one.

Each of its components may have been given with the opposite sign: the vector from the antenna to the camera
in place of the one from the camera to the antenna, or right for left, up for down. A mistake is named if it
explains what was found three times better than the lever arm as given and than any other slip. Components
that were not determined well enough to tell their sign are not used.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from adjust.adjustment import adjust_block
from adjust.arrays import Bools, Floats
from adjust.block import Block
from adjust.calibration.indicated_lever_arm import indicated_lever_arms
from adjust.errors import AdjustmentError
from adjust.options import AdjustmentOptions
from adjust.parameters import GNSS_SHIFT
from adjust.result import AdjustmentResult
from adjust.solve.system import Observations

_MARGIN = 3.0
# Differences below this, metres, or this many standard deviations, need no explanation.
_NOTABLE_M = 0.10
_NOTABLE_SIGMAS = 5.0
_AXES = ("forward", "right", "down")


def lever_arm_suspicions(
    cameras: tuple[str, ...], given: Floats, block: Block, result: AdjustmentResult
) -> tuple[str, ...]:
    """Sentences about the given lever arms of an adjusted block, held or not, whose signs look wrong.

    Parameters
    ----------
    cameras : their names.
    given : (c, 3) metres, body axes.
    """
    if not (np.abs(given) >= 0.5 * _NOTABLE_M).any():
        return ()
    found = indicated_lever_arms(block, result)
    with_small_shift = indicated_lever_arms(block, result, shift_is_small=True)
    if found is None or with_small_shift is None:
        return ()
    sentences = []
    for k, name in enumerate(cameras):
        sentence = lever_arm_suspicion(given[k], found.value[k], found.sigma[k], name)
        other = lever_arm_suspicion(given[k], with_small_shift.value[k], with_small_shift.sigma[k], name)
        if other is not None and _more_is_told(found.sigma[k], with_small_shift.sigma[k], given[k]):
            sentence = f"{other} Otherwise the GNSS has the estimated shift: {_shift(result)} m."
        if sentence is not None:
            sentences.append(sentence)
    return tuple(sentences)


def _more_is_told(sigma: Floats, with_small_shift: Floats, given: Floats) -> bool:
    """Whether more components can be judged if the shift is small."""
    return bool((_told(given, with_small_shift) & ~_told(given, sigma)).any())


def _told(given: Floats, sigma: Floats) -> Bools:
    """(3,) which components are determined well enough to tell their sign."""
    return np.asarray(_NOTABLE_SIGMAS * sigma <= np.maximum(2.0 * np.abs(given), _NOTABLE_M))


def _shift(result: AdjustmentResult) -> str:
    """The largest shift of a flight, along the axes of the local frame."""
    shifts = result.state.system[GNSS_SHIFT]
    largest = shifts[np.argmax(np.linalg.norm(shifts, axis=1))]
    return f"({_metres(largest)})"


def suspicions_without_rejection(
    cameras: tuple[str, ...],
    given: Floats,
    block: Block,
    observations: Observations,
    options: AdjustmentOptions,
) -> tuple[str, ...]:
    """The same for a block that could not be adjusted while gross errors were rejected.

    Positions that contradict a wrong lever arm are rejected one after the other until none is left, and the
    parameters that they determine with them.

    Parameters
    ----------
    options : of the adjustment that failed.
    """
    if options.critical_value is None or not (np.abs(given) >= 0.5 * _NOTABLE_M).any():
        return ()
    plain = replace(options, critical_value=None, robust=None, variance_components=False)
    try:
        result = adjust_block(block, observations, replace(plain, correlation_times=False))
    except AdjustmentError:
        return ()
    return lever_arm_suspicions(cameras, given, block, result)


def lever_arm_suspicion(given: Floats, found: Floats, sigma: Floats, camera: str) -> str | None:
    """A sentence about signs of the given lever arm that look wrong; None if there is nothing to say.

    Parameters
    ----------
    given, found, sigma : (3,) metres, body axes; the standard deviations are those of ``found``.
    """
    told = _told(given, sigma)
    notable = np.abs(found - given) > np.maximum(_NOTABLE_M, _NOTABLE_SIGMAS * sigma)
    signs = _other_signs(told & (np.abs(given) >= 0.5 * _NOTABLE_M))
    if not signs or not (told & notable).any():
        return None

    def misfit(trial: Floats) -> float:
        """Distance of what was found, counted in what it may be off by."""
        return float(np.linalg.norm(((found - trial) / np.maximum(sigma, 0.5 * _NOTABLE_M))[told]))

    trials = sorted((misfit(sign * given), k) for k, sign in enumerate(signs))
    best, chosen = trials[0]
    others = [misfit(given), *(distance for distance, _ in trials[1:])]
    if _MARGIN * best >= min(others):
        return None
    open_ = "" if told.all() else " (? cannot be separated from a GNSS shift in this block)"
    turned = [axis for axis, sign in zip(_AXES, signs[chosen], strict=True) if sign < 0.0]
    return (
        f"The given lever arm of camera {camera} looks as if it had the wrong sign {_words(turned)}: "
        f"({_metres(given)}) m was given and ({_metres(found, told)}) m found{open_}. It is the vector "
        "from the camera to the antenna (forward, right, down): correct lever_arm_m."
    )


def _other_signs(signed: Bools) -> list[Floats]:
    """Combinations (3,) of ±1 with a −1, which only components that are not zero can have."""
    choices = [(1.0, -1.0) if has_sign else (1.0,) for has_sign in signed]
    return [np.array(signs) for signs in product(*choices) if -1.0 in signs]


def _words(axes: list[str]) -> str:
    return "in all three components" if len(axes) == 3 else "along " + " and ".join(axes)


def _metres(vector: Floats, told: Bools | None = None) -> str:
    """Components in metres, a question mark for those that cannot be determined."""
    known = np.ones(3, dtype=bool) if told is None else told
    return ", ".join(f"{value:+z.2f}" if k else "?" for value, k in zip(vector, known, strict=True))
