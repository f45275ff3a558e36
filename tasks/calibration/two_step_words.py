"""The results of a two-step calibration in words."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from adjust.arrays import Floats
from adjust.calibration.indicated_lever_arm import UNSTATED_SHIFT
from adjust.calibration.orientation_differences import COMPONENTS
from adjust.calibration.two_step import GroupMean, TwoStep
from tasks.calibration.offset_words import offset_sentence, test_words
from tasks.calibration.orientation_pairs import CameraDifferences
from tasks.calibration.two_step_tables import strip_names
from tasks.plausibility.lever_arm import lever_arm_suspicion

# A drift is mentioned if it is larger than this and this many times its standard deviation.
_NOTABLE_DRIFT_DEG = 0.01
_NOTABLE_T = 5.0
# Names of strips in a sentence.
_MOST_NAMES = 12


def camera_remarks(item: CameraDifferences, result: TwoStep, error_probability: float) -> tuple[str, ...]:
    """What contradicts a single boresight and offset for all, and the meaning of the offset."""
    found = result.main.mean
    sigma = np.nan_to_num(result.main.widened[3:6])
    # In height a shift looks like a lever arm in every strip.
    sigma[2] = np.hypot(sigma[2], UNSTATED_SHIFT)
    slip = lever_arm_suspicion(item.given_lever_arm, found.robust[3:6], sigma, item.camera)
    # Only an offset that is fixed in the aircraft says something about the lever arm.
    remarks = [slip] if slip is not None and result.offset.verdict == "body" else []
    remarks += [_of_mounting(item, result, group, error_probability) for group in result.others]
    if not result.mountings.tested:
        number = len(result.strips.strip)
        are = "strip is" if number == 1 else "strips are"
        remarks.append(
            f"Camera {item.camera}: {number} {are} too few to identify one with another mounting from their "
            "scatter."
        )
    elif not result.mountings.lever_arms_comparable:
        remarks.append(
            f"Camera {item.camera}: the lever arms of its flights cannot be compared: in a flight in one "
            "direction, the lever arm cannot be separated from the GNSS shift."
        )
    if result.offset.verdict != "neither":
        remarks.append(offset_sentence(item.camera, result))
    by_flight = result.offset.tests["shift_by_flight"]
    if by_flight.probability < error_probability:
        remarks.append(
            f"The GNSS shift of camera {item.camera} differs from flight to flight ({test_words(by_flight)})."
        )
    return (*remarks, *_drifts(item, result))


def _of_mounting(item: CameraDifferences, result: TwoStep, group: GroupMean, error_probability: float) -> str:
    """Which strips have another mounting, how it differs, and what to do."""
    names = strip_names(item, result, group.number)
    shown = ", ".join(names[:_MOST_NAMES])
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    difference, sigma = _differences(result, group)
    turned = np.rad2deg([difference[:3], sigma[:3]]).T
    angles = ", ".join(f"{value:+z.4f}° ± {s:.4f}°" for value, s in turned)
    moved, main = "", result.main.mean.robust[3:5]
    if result.offset.tests["lever_arm_by_mounting"].probability < error_probability:
        moved = f"lever arm {_plan(main + difference[3:])} m forward, right, against {_plan(main)} m; "
    return (
        f"Strips {shown}{more} ({group.images:,} images) were flown with another mounting of camera "
        f"{item.camera}: {moved}boresight roll, pitch, yaw differ by {angles}. They are excluded from the "
        f"result (probability of finding another mounting by chance {100 * error_probability:g} %): give "
        "them a camera of their own."
    )


def _differences(result: TwoStep, group: GroupMean) -> tuple[Floats, Floats]:
    """Roll, pitch, yaw, forward, right (5,) of a mounting less those of the main one, and their σ."""
    joint, main = result.mountings.joint, result.main
    if joint is None:
        difference = group.mean.robust[:5] - main.mean.robust[:5]
        return difference, np.hypot(group.sigma[:5], np.nan_to_num(main.sigma[:5]))
    # Both means have the errors of the block in common.
    difference, covariance = joint.differences(group.number, main.number)
    return difference, np.sqrt(np.diagonal(covariance))


def _plan(lever_arm: Floats) -> str:
    forward, right = lever_arm
    return f"({forward:+z.2f}, {right:+z.2f})"


def _drifts(item: CameraDifferences, result: TwoStep) -> Iterator[str]:
    strips = result.strips
    drift, sigma = np.rad2deg(strips.drift[:, :3]), np.rad2deg(strips.drift_sigma[:, :3])
    notable = (np.abs(drift) > _NOTABLE_DRIFT_DEG) & (np.abs(drift) > _NOTABLE_T * sigma)
    for k, j in np.argwhere(notable):
        yield (
            f"Strip {item.strip_names[strips.strip[k]]}: the {COMPONENTS[j]} of the INS drifts by "
            f"{drift[k, j]:+z.4f}° ± {sigma[k, j]:.4f}° against the adjusted orientations."
        )
