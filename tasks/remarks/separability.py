"""Which system parameters a block cannot separate, in words, and what would separate them.

What separates which parameters is one table behind warnings, verdicts and proposals. It is first-order theory
of vertical photographs over flat ground. A change dc of the focal length moves the height by dc · h/c, the
principal point the plan by x0 · h/c in body axes; a shift is fixed in map axes, a lever arm in body axes, a
time offset lies along the velocity.
"""

from __future__ import annotations

from collections.abc import Collection

from tasks.quantities import kind_of, named
from tasks.results.figures import WeakParameters

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


def weak_parameter_sentences(
    found: tuple[WeakParameters, ...], determined: Collection[tuple[str, str]] = ()
) -> list[str]:
    """Sentences about groups and combinations of parameters that the block hardly separates.

    Parameters
    ----------
    determined : names and entities of those that a calibration calls determined. Groups of them are named by
        its verdict, with the certified covariances: `correlation_sentence`.
    """
    sentences = []
    for item in found:
        if not set(zip(item.parameters, item.entities, strict=True)) <= set(determined):
            sentences.append(_not_separated(item))
        elif item.correlation is None:
            together = _although_determined(len(item.parameters))
            sentences.append(f"{_members(item)} are correlated in combination, {together}")
    return sentences


def correlation_sentence(members: Collection[str], correlation: float) -> str:
    """That members of a group are correlated by up to this, although a calibration calls them determined."""
    how_much = _how_much(len(members), correlation)
    return f"{listed(members)} are {how_much} correlated, {_although_determined(len(members))}"


def _although_determined(members: int) -> str:
    """What follows for values of which each is determined, but with the errors of others."""
    return f"although {'both' if members == 2 else 'all'} are determined: use their values together only."


def _not_separated(weak: WeakParameters) -> str:
    how = "hardly determined individually, only in combination"
    if weak.correlation is not None:
        how = f"{_how_much(len(weak.parameters), weak.correlation)} correlated"
    return (
        f"{_members(weak)} are {how}: {_remedy(weak.parameters)}; their values must not be used separately."
    )


def _members(weak: WeakParameters) -> str:
    return listed([*map(named, weak.parameters, weak.entities)])


def _how_much(members: int, correlation: float) -> str:
    return percent(correlation) if members == 2 else f"up to {percent(correlation)}"


def _remedy(names: tuple[str, ...]) -> str:
    """What would separate the parameters of these names."""
    if len(set(names)) == 1 and kind_of(names[0]) == "relative_rotation":
        return "what the heads have in common is determined less well than their rotations against each other"
    found = separating(names)
    if not found:
        return "this block can hardly separate them; hold one of them fixed or give it a prior"
    remedies = listed(found)
    verb = "separate" if len(found) > 1 or remedies[-1] == "s" or remedies.endswith("alone") else "separates"
    hold = "all but one" if len(names) > 2 else "one"
    return f"{remedies} {verb} them, otherwise hold {hold} of them fixed"
