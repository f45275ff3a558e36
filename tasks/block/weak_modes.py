"""Which system parameters a block does not tell apart, in words, and what would."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats

# Two parameters correlated by more than this are hardly separated; it is also 1 − λ of the weakest direction.
CORRELATED = 0.98
# Part of a direction (unit length) from which a parameter is named.
_INVOLVED = 0.3
_MOST_PAIRS, _MOST_MODES = 5, 3

_HEADINGS = "strips flown in opposite or crossing directions"
_HEIGHTS = "a second flying height or strong relief"
_SPEEDS = "varying ground speeds"
_TILTS = "strong tilts alone"
_CONTROL = "observed GNSS positions or well distributed control points"
_PRIOR = "a prior of the one that varies from strip to strip"
# What separates which: first-order theory of vertical photographs over flat ground. A change dc of c moves
# the height by dc · h/c, x0 the plan by x0 · h/c in body axes; a shift is fixed in map axes, a lever arm
# in body axes, a time offset lies along the velocity.
_REMEDIES: tuple[tuple[tuple[str, ...], tuple[str, ...], str], ...] = (
    (("principal_point_x", "principal_point_y"), ("gnss_shift_x", "gnss_shift_y"), _HEADINGS),
    (("principal_point_x", "principal_point_y"), ("lever_arm_x", "lever_arm_y"), _HEIGHTS),
    (("focal_length",), ("gnss_shift_z", "lever_arm_z"), _HEIGHTS),
    (("gnss_shift_x", "gnss_shift_y"), ("lever_arm_x", "lever_arm_y"), _HEADINGS),
    (("gnss_shift_z",), ("lever_arm_z",), _TILTS),
    (("lever_arm_x", "gnss_shift_x", "gnss_shift_y"), ("time_offset",), _SPEEDS),
    (("principal_point_x", "principal_point_y"), ("boresight_pitch", "boresight_roll"), _CONTROL),
    (("gnss_shift_x",), ("gnss_strip_bias_x", "gnss_drift_x"), _PRIOR),
    (("gnss_shift_y",), ("gnss_strip_bias_y", "gnss_drift_y"), _PRIOR),
    (("gnss_shift_z",), ("gnss_strip_bias_z", "gnss_drift_z"), _PRIOR),
)


@dataclass(frozen=True)
class Parameter:
    """A free system parameter and what it belongs to."""

    name: str
    entity: str

    def __str__(self) -> str:
        return f"{self.name} of {self.entity}"


def weak_mode_sentences(parameters: tuple[Parameter, ...], correlation: Floats) -> list[str]:
    """Sentences about pairs and about combinations of parameters that the block hardly separates.

    Parameters
    ----------
    correlation : (g, g) of the parameters.
    """
    if len(parameters) < 2:
        return []
    pairs = _pairs(correlation)
    sentences = [
        f"{parameters[a]} and {parameters[b]} are {_percent(correlation[a, b])} correlated: "
        f"{_remedy((parameters[a].name, parameters[b].name), plural=False)}; "
        "their values must not be used apart."
        for a, b in pairs
    ]
    explained = {frozenset(pair) for pair in pairs}
    for members in _modes(correlation):
        if any(pair <= set(members) for pair in explained):
            continue
        named = [str(parameters[k]) for k in members]
        names = tuple(parameters[k].name for k in members)
        sentences.append(
            f"{', '.join(named[:-1])} and {named[-1]} together are hardly determined, each only through the "
            f"others: {_remedy(names, plural=True)}; their values must not be used apart."
        )
    return sentences


def _pairs(correlation: Floats) -> list[tuple[int, int]]:
    """The pairs that are correlated most, strongest first."""
    first, second = np.triu_indices(len(correlation), 1)
    size = np.abs(correlation[first, second])
    order = np.argsort(-size, kind="stable")[:_MOST_PAIRS]
    return [(int(first[k]), int(second[k])) for k in order if size[k] > CORRELATED]


def _modes(correlation: Floats) -> list[tuple[int, ...]]:
    """Parameters of the weakest directions of the correlation matrix, weakest direction first."""
    values, vectors = np.linalg.eigh(correlation)
    weak = [k for k in range(len(values)) if values[k] < 1.0 - CORRELATED][:_MOST_MODES]
    return [tuple(int(i) for i in np.flatnonzero(np.abs(vectors[:, k]) >= _INVOLVED)) for k in weak]


def _percent(correlation: float) -> str:
    """Per cent, never rounded up to a hundred."""
    percent = 100.0 * abs(correlation)
    digits = 0 if percent < 99.0 else 1 if percent < 99.9 else 2
    return f"{min(percent, 99.99):.{digits}f} %"


def _remedy(names: tuple[str, ...], plural: bool) -> str:
    """What would separate the parameters of these names."""
    found = [
        remedy
        for some, others, remedy in _REMEDIES
        if any(name in some for name in names) and any(name in others for name in names)
    ]
    if not found:
        return "this block hardly separates them; hold one of them or give it a prior"
    unique = list(dict.fromkeys(found))
    listed = unique[0] if len(unique) == 1 else f"{', '.join(unique[:-1])} and {unique[-1]}"
    verb = "separate" if len(unique) > 1 or listed[-1] == "s" or listed.endswith("alone") else "separates"
    hold = ", otherwise hold all but one of them" if plural else ", otherwise hold one of them"
    return f"{listed} {verb} them{hold}"
