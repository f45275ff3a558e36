"""What a two-step calibration has found, in words."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from adjust.calibration.indicated_lever_arm import UNSTATED_SHIFT
from adjust.calibration.offset_separation import OffsetSeparation
from adjust.calibration.orientation_differences import COMPONENTS
from adjust.calibration.strip_offsets import NestedTest
from adjust.calibration.two_step import GroupMean, TwoStep
from tasks.block.orientation_pairs import CameraDifferences
from tasks.block.two_step_tables import strip_names
from tasks.plausibility.lever_arm import lever_arm_suspicion

# A drift is mentioned if it is larger than this and this many times its standard deviation.
_NOTABLE_DRIFT_DEG = 0.01
_NOTABLE_T = 5.0
# Names of strips in a sentence.
_MOST_NAMES = 12


def camera_remarks(item: CameraDifferences, result: TwoStep, error_probability: float) -> tuple[str, ...]:
    """What contradicts one boresight and one offset for all, and what the offset is."""
    found = result.main.mean
    sigma = np.nan_to_num(found.robust_sigma[3:6])
    # In height a shift looks like a lever arm in every strip.
    sigma[2] = np.hypot(sigma[2], UNSTATED_SHIFT)
    slip = lever_arm_suspicion(item.given_lever_arm, found.robust[3:6], sigma, item.camera)
    # Only an offset that is fixed in the aircraft says something about the lever arm.
    remarks = [slip] if slip is not None and result.offset.verdict == "body" else []
    remarks += [_of_mounting(item, result, group, error_probability) for group in result.others]
    if not result.mountings.tested:
        remarks.append(
            f"Camera {item.camera}: {len(result.strips.strip)} strips are too few to tell one of another "
            "mounting from their scatter."
        )
    elif not result.mountings.lever_arms_comparable:
        remarks.append(
            f"Camera {item.camera}: the lever arms of its flights cannot be compared: a flight in one "
            "direction does not tell a lever arm from its GNSS shift."
        )
    remarks.append(offset_sentence(item.camera, result))
    by_flight = result.offset.tests["shift_by_flight"]
    if by_flight.probability < error_probability:
        remarks.append(
            f"The GNSS shift of camera {item.camera} differs from flight to flight ({_words(by_flight)})."
        )
    return (*remarks, *_drifts(item, result))


def _of_mounting(item: CameraDifferences, result: TwoStep, group: GroupMean, error_probability: float) -> str:
    """Which strips have another mounting, how it differs, and what to do."""
    names = strip_names(item, result, group.number)
    shown = ", ".join(names[:_MOST_NAMES])
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    main = result.main.mean
    difference = np.rad2deg(group.mean.robust[:3] - main.robust[:3])
    sigma = np.rad2deg(np.hypot(group.mean.robust_sigma[:3], np.nan_to_num(main.robust_sigma[:3])))
    angles = ", ".join(f"{value:+.4f}° ± {s:.4f}°" for value, s in zip(difference, sigma, strict=True))
    return (
        f"Strips {shown}{more} ({group.images:,} images) have another mounting of camera {item.camera}: "
        f"lever arm {_plan(group)} m forward, right, against {_plan(result.main)} m; boresight roll, pitch, "
        f"yaw differ by {angles}. They are left out of the result (probability of finding any other mounting "
        f"by chance {100 * error_probability:g} %): give them a camera of their own."
    )


def _plan(group: GroupMean) -> str:
    forward, right = group.mean.robust[3:5]
    return f"({forward:+.2f}, {right:+.2f})"


def offset_sentence(camera: str, result: TwoStep) -> str:
    """Whether the strips call for a lever arm, a shift or both, with the tests that say so."""
    offset = result.offset
    lever_arm, shift = (_words(offset.tests[name]) for name in ("lever_arm", "shift"))
    rms = f"RMS in plan {result.rms_body:.3f} m in body axes, {result.rms_map:.3f} m in the map"
    if offset.verdict == "body":
        return (
            f"The offset of camera {camera} is fixed in the aircraft: the strips call for a lever arm "
            f"({_of_lever_arm(offset)} m forward, right, more than given; {lever_arm}), not for a GNSS shift "
            f"beside it ({shift}); {rms}."
        )
    if offset.verdict == "map":
        return (
            f"The offset of camera {camera} is fixed in the map, not in the aircraft: the strips call for a "
            f"GNSS shift or a datum ({shift}), not for another lever arm beside it ({lever_arm}); {rms}."
        )
    if offset.verdict == "both":
        return (
            f"The strips of camera {camera} call for both a lever arm ({_of_lever_arm(offset)} m forward, "
            f"right, more than given; {lever_arm}) and a GNSS shift "
            f"({_with_sigma(offset.shift, offset.shift_sigma)} m east, north; {shift}): a mean of the "
            "offsets is neither of them."
        )
    if offset.verdict == "neither":
        return (
            f"Camera {camera}: the given lever arm leaves no offset in plan "
            f"({_words(offset.tests['offset'])}): neither another lever arm nor a GNSS shift is called for."
        )
    return (
        f"Camera {camera}: lever arm and GNSS shift cannot be told apart with {result.directions} "
        f"direction(s) of flight and these strips (lever arm {lever_arm}; shift {shift}): fly lines in "
        "opposite or crossing directions."
    )


def _of_lever_arm(offset: OffsetSeparation) -> str:
    return _with_sigma(offset.lever_arm, offset.lever_arm_sigma)


def _with_sigma(values: np.ndarray, sigmas: np.ndarray) -> str:
    return ", ".join(f"{value:+.3f} ± {sigma:.3f}" for value, sigma in zip(values, sigmas, strict=True))


def _words(test: NestedTest) -> str:
    """χ², degrees of freedom and probability."""
    if not test.testable:
        return "not testable"
    chance = "below 0.0001" if test.probability < 1e-4 else f"{test.probability:.2g}"
    return f"χ² {test.chi_squared:.1f} of {test.freedom}, probability {chance}"


def _drifts(item: CameraDifferences, result: TwoStep) -> Iterator[str]:
    strips = result.strips
    drift, sigma = np.rad2deg(strips.drift[:, :3]), np.rad2deg(strips.drift_sigma[:, :3])
    notable = (np.abs(drift) > _NOTABLE_DRIFT_DEG) & (np.abs(drift) > _NOTABLE_T * sigma)
    for k, j in np.argwhere(notable):
        yield (
            f"Strip {item.strip_names[strips.strip[k]]}: the {COMPONENTS[j]} of the INS drifts by "
            f"{drift[k, j]:+.4f}° ± {sigma[k, j]:.4f}° against the adjusted orientations."
        )
