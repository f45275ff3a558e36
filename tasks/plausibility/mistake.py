"""A mistake in a delivery: its description, the evidence, and its correction."""

from __future__ import annotations

from dataclasses import dataclass

#: The remedy where no mistake explains how far the rays of tie points miss each other.
NO_USUAL_SLIP = (
    "None of the common mistakes (unit, order or reference of the angles, a turned camera, mirrored image "
    "coordinates) explains it: check the focal length and the principal point (from the centre of the image, "
    "mm), the positions, and whether the image points belong to these exposures. If the camera was never "
    "calibrated in this mounting, free the boresight (adjustment.free). If GNSS and INS are not as accurate "
    "as stated, state their σ."
)


@dataclass(frozen=True)
class Mistake:
    """One mistake.

    Attributes
    ----------
    what : what it looks like, a sentence.
    evidence : what was measured under each hypothesis, the best first.
    remedy : what to do, a sentence.
    declare : the line of the project file, ``a.b.c = value`` from its top; empty: the files must be
    corrected.
    """

    what: str
    evidence: tuple[str, ...]
    remedy: str
    declare: str = ""
