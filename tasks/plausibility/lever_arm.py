"""Whether a given lever arm has its signs the right way round, judged by the one that was found.

Each of its components may have been given with the opposite sign: the vector from the antenna to the camera
in place of the one from the camera to the antenna, or right for left, up for down. A slip is named if it
explains what was found three times better than the lever arm as given and than any other slip.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from adjust.arrays import Floats

_MARGIN = 3.0
# Differences below this, metres, or this many standard deviations, need no explanation.
_NOTABLE_M = 0.10
_NOTABLE_SIGMAS = 5.0
_AXES = ("forward", "right", "down")


def lever_arm_suspicion(given: Floats, found: Floats, sigma: Floats, camera: str) -> str | None:
    """A sentence about signs of the given lever arm that look wrong; None if there is nothing to say.

    Parameters
    ----------
    given, found, sigma : (3,) metres, body axes; the standard deviations are those of ``found``.
    """
    as_given = float(np.linalg.norm(found - given))
    noise = max(_NOTABLE_M, _NOTABLE_SIGMAS * float(np.linalg.norm(sigma)))
    # A component of zero has no sign.
    signs = [
        np.array(s)
        for s in product((1.0, -1.0), repeat=3)
        if -1.0 in s and not np.any((np.array(s) < 0.0) & (np.abs(given) < 0.5 * _NOTABLE_M))
    ]
    if not signs or not as_given > noise:
        return None
    trials = sorted((float(np.linalg.norm(found - sign * given)), k) for k, sign in enumerate(signs))
    best, chosen = trials[0]
    others = [as_given, *(distance for distance, _ in trials[1:])]
    if _MARGIN * best >= min(others):
        return None
    turned = [axis for axis, sign in zip(_AXES, signs[chosen], strict=True) if sign < 0.0]
    return (
        f"The given lever arm of camera {camera} looks as if it had the wrong sign {_words(turned)}: "
        f"({_metres(given)}) m was given and ({_metres(found)}) m found. It leads from the camera to the "
        "antenna along forward, right, down: correct lever_arm_m."
    )


def _words(axes: list[str]) -> str:
    return "in all three components" if len(axes) == 3 else "along " + " and ".join(axes)


def _metres(vector: Floats) -> str:
    return ", ".join(f"{value:+.2f}" for value in vector)
