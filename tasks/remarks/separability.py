"""What separates which system parameters: the one table behind warnings, verdicts and proposals.

First-order theory of vertical photographs over flat ground. A change dc of the focal length moves the height
by dc · h/c, the principal point the plan by x0 · h/c in body axes; a shift is fixed in map axes, a lever arm
in body axes, a time offset lies along the velocity.
"""

from __future__ import annotations

from collections.abc import Collection

HEADINGS = "strips flown in opposite or crossing directions"
HEIGHTS = "a second flying height or strong relief"
SPEEDS = "delivered rates of the body or varying ground speeds"
TILTS = "strong tilts alone"
CONTROL = "observed GNSS positions or well distributed control points"
SURVEYED = "well distributed control points"
ATTITUDES = "observed attitudes together with GNSS positions or control points"
PRIOR = "a prior for the one that varies from strip to strip"
#: Of these it is observations that are missing, not a way to fly.
OBSERVATIONS = (CONTROL, SURVEYED, ATTITUDES)

_PRINCIPAL_POINT = ("principal_point_x", "principal_point_y")
_SHIFT_IN_PLAN = ("gnss_shift_x", "gnss_shift_y")
_LEVER_ARM_IN_PLAN = ("lever_arm_x", "lever_arm_y")
# (some, others, remedy): what tells one of `some` from one of `others`.
_PAIRS: tuple[tuple[tuple[str, ...], tuple[str, ...], str], ...] = (
    (_PRINCIPAL_POINT, _SHIFT_IN_PLAN, HEADINGS),
    (_PRINCIPAL_POINT, _LEVER_ARM_IN_PLAN, HEIGHTS),
    (("focal_length",), ("gnss_shift_z", "lever_arm_z"), HEIGHTS),
    (_SHIFT_IN_PLAN, _LEVER_ARM_IN_PLAN, HEADINGS),
    (("gnss_shift_z",), ("lever_arm_z",), TILTS),
    (("lever_arm_x", *_SHIFT_IN_PLAN), ("time_offset",), SPEEDS),
    (_PRINCIPAL_POINT, ("boresight_pitch", "boresight_roll"), CONTROL),
    (("gnss_shift_x",), ("gnss_strip_bias_x", "gnss_drift_x"), PRIOR),
    (("gnss_shift_y",), ("gnss_strip_bias_y", "gnss_drift_y"), PRIOR),
    (("gnss_shift_z",), ("gnss_strip_bias_z", "gnss_drift_z"), PRIOR),
    (("boresight_roll",), ("ins_strip_bias_roll",), PRIOR),
    (("boresight_pitch",), ("ins_strip_bias_pitch",), PRIOR),
    (("boresight_yaw",), ("ins_strip_bias_yaw",), PRIOR),
)
# What a parameter needs whatever else is free.
_ALONE: tuple[tuple[tuple[str, ...], str], ...] = (
    ((*_SHIFT_IN_PLAN, "gnss_shift_z"), SURVEYED),
    (("boresight_roll", "boresight_pitch", "boresight_yaw"), ATTITUDES),
    (_PRINCIPAL_POINT, HEADINGS),
    (("focal_length",), HEIGHTS),
    (_LEVER_ARM_IN_PLAN, HEADINGS),
    (("lever_arm_z",), TILTS),
    (("time_offset",), SPEEDS),
)


def separating(names: Collection[str]) -> tuple[str, ...]:
    """What would separate the parameters of these names; empty if nothing is known that would."""
    found = [
        remedy
        for some, others, remedy in _PAIRS
        if any(name in some for name in names) and any(name in others for name in names)
    ]
    return tuple(dict.fromkeys(found))


def determining(name: str) -> tuple[str, ...]:
    """What a parameter of this name needs to be determined at all."""
    return tuple(dict.fromkeys(remedy for some, remedy in _ALONE if name in some))


def listed(items: Collection[str]) -> str:
    """Items of a sentence: "a", "a and b", "a, b and c"."""
    words = list(items)
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def percent(correlation: float) -> str:
    """Size of a correlation in per cent, never rounded up to a hundred."""
    value = 100.0 * abs(correlation)
    digits = 0 if value < 99.0 else 1 if value < 99.9 else 2
    return f"{min(value, 99.99):.{digits}f} %"
