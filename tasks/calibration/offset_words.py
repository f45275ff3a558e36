"""The offset between adjusted and observed positions in words."""

from __future__ import annotations

from adjust.arrays import Floats
from adjust.calibration.offset_separation import OffsetSeparation
from adjust.calibration.strip_offsets import NestedTest
from adjust.calibration.two_step import TwoStep


def offset_sentence(camera: str, result: TwoStep) -> str:
    """Whether the strips require a lever arm, a shift or both, with the tests that show it."""
    offset = result.offset
    lever_arm, shift = (test_words(offset.tests[name]) for name in ("lever_arm", "shift"))
    rms = f"RMS in plan {result.rms_body:.3f} m in body axes, {result.rms_map:.3f} m in the map"
    if offset.verdict == "body":
        return (
            f"The offset of camera {camera} is fixed in the aircraft: the strips indicate a lever-arm error "
            f"({_of_lever_arm(offset)} m forward, right, to be added to the given one; {lever_arm}), and no "
            f"additional GNSS shift ({shift}); {rms}."
        )
    if offset.verdict == "map":
        return (
            f"The offset of camera {camera} is fixed in the map, not in the aircraft: the strips indicate a "
            f"GNSS shift or a datum error ({shift}), and no additional lever-arm error ({lever_arm}); {rms}."
        )
    if offset.verdict == "both":
        return (
            f"The strips of camera {camera} call for both a lever arm ({_of_lever_arm(offset)} m forward, "
            f"right, to be added to the given one; {lever_arm}) and a GNSS shift "
            f"({_with_sigma(offset.shift, offset.shift_sigma)} m east, north; {shift}). The mean of the "
            "offsets is neither of the two."
        )
    if offset.verdict == "neither":
        return (
            f"The given lever arm of camera {camera} leaves no significant horizontal offset "
            f"({test_words(offset.tests['offset'])}): neither another lever arm nor a GNSS shift is needed."
        )
    return (
        f"Camera {camera}: lever arm and GNSS shift cannot be separated with {result.directions} flight "
        f"direction(s) and these strips (lever arm {lever_arm}; shift {shift}). Fly lines in opposite or "
        "crossing directions."
    )


def _of_lever_arm(offset: OffsetSeparation) -> str:
    return _with_sigma(offset.lever_arm, offset.lever_arm_sigma)


def _with_sigma(values: Floats, sigmas: Floats) -> str:
    return ", ".join(f"{value:+z.3f} ± {sigma:.3f}" for value, sigma in zip(values, sigmas, strict=True))


def test_words(test: NestedTest) -> str:
    """χ², degrees of freedom and probability."""
    if not test.testable:
        return "not testable"
    chance = "below 0.0001" if test.probability < 1e-4 else f"{test.probability:.2g}"
    return f"χ² {test.chi_squared:.1f} of {test.freedom}, probability {chance}"
