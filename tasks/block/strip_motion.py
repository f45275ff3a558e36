"""Time and velocity of exposures along their strips, and errors that are correlated over that time."""

from __future__ import annotations

from collections.abc import Collection
from typing import Literal

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.observations.base import StochasticModel
from adjust.observations.gauss_markov import GaussMarkov
from adjust.observations.gnss_position import StripMotion
from tasks.block.given_orientations import GivenOrientations
from tasks.deliveries.declared_exposures import ONE_MOMENT_S
from tasks.errors import InputError
from tasks.settings.adjustment import AdjustmentSettings

# No strip takes half a day: seconds of day or week start from zero again, or several days share a name.
_LONGEST_STRIP_S = 43_200.0
# What has velocities needs neither strips nor times for a time offset.
_OR_TRAJECTORY = {
    "gnss_strip_bias": "",
    "gnss_drift": "",
    "ins_strip_bias": "",
    "ins_drift": "",
    "time_offset": ", or deliver a trajectory",
    "synchronisation_offset": ", or deliver a trajectory",
}


def strip_motion(given: GivenOrientations) -> StripMotion:
    """Strip, time since its middle and velocity of every exposure.

    The velocity is the delivered one (that of a trajectory), else the derivative of the observed positions
    by time (central differences, one-sided at the ends of a strip; heads that exposed within a millisecond
    share theirs). Without strips or times there are no times since the middle, and no derivatives: they are
    zero.
    """
    since, velocity = np.zeros(len(given.image)), np.zeros_like(given.observed)
    strip = given.strip_of_image
    for index in strips_in_time(strip, given.time_s):
        if not given.strips[strip[index[0]]]:
            continue
        time = given.time_s[index]
        since[index] = time - 0.5 * (time[0] + time[-1])
        place = np.cumsum(np.diff(time, prepend=time[0]) >= ONE_MOMENT_S)
        count = np.bincount(place)
        if len(count) > 1:
            mean = np.zeros((len(count), 3))
            np.add.at(mean, place, given.observed[index] / count[place, None])
            velocity[index] = np.gradient(mean, np.bincount(place, time) / count, axis=0)[place]
    return StripMotion(strip, since, np.where(_moves(given)[:, None], given.velocity, velocity))


def _moves(given: GivenOrientations) -> Bools:
    """Images (n,) whose velocity was delivered."""
    return np.asarray(np.isfinite(given.velocity).all(axis=1))


def strips_in_time(strip: Ints, time: Floats) -> list[Ints]:
    """Indices of the exposures of each strip in the order of time; those without time are left out."""
    order = np.lexsort((time, strip))
    order = order[np.isfinite(time[order])]
    parts = np.split(order, np.flatnonzero(np.diff(strip[order])) + 1)
    return [part for part in parts if len(part)]


def over_time(
    model: StochasticModel, given: GivenOrientations, rows: Ints, correlation_s: float | None
) -> StochasticModel:
    """Weights of some images (k,) with errors correlated along their strips; None: as they are."""
    if correlation_s is None:
        return model
    return model.correlated(GaussMarkov(given.strip_of_image[rows], given.time_s[rows], correlation_s))


def require_motion(given: GivenOrientations, settings: AdjustmentSettings) -> None:
    """Refuse parameters of strips and times where the delivery has neither.

    Raises
    ------
    InputError
        If a strip bias, drift, time offset or synchronisation offset is free without strips, or one of the
        others without times; if a correlation time is given without either, or with two exposures of a
        strip at the same time; if a strip that they need lasts half a day. Offsets in time need neither
        where velocities were delivered.
    """
    require_successive_times(given, settings, settings.observe)
    given = given.only(given.position_observed) if given.position_observed.any() else given
    still = given.only(~_moves(given))
    in_time = tuple((parameter, still) for parameter in ("time_offset", "synchronisation_offset"))
    drifts = tuple((parameter, given) for parameter in ("gnss_drift", "ins_drift"))
    biases = tuple((parameter, given) for parameter in ("gnss_strip_bias", "ins_strip_bias"))
    for parameter, needs in (*biases, *drifts, *in_time):
        if parameter in settings.free and not all(needs.strip):
            raise InputError(
                f"{_without(given, 'strip')}.",
                f"Add a strip column to the exposures{_OR_TRAJECTORY[parameter]}, or remove it from "
                "adjustment.free.",
                entity=f"adjustment.free = {parameter}",
            )
    for parameter, needs in (*drifts, *in_time):
        if parameter in settings.free and not np.isfinite(needs.time_s).all():
            raise InputError(
                f"{_without(needs, 'time')}.",
                f"Add a time column (seconds) to the exposures{_OR_TRAJECTORY[parameter]}, or remove it "
                "from adjustment.free.",
                entity=f"adjustment.free = {parameter}",
            )
    for parameter, needs in (*biases, *drifts, *in_time):
        if parameter in settings.free:
            _require_one_day(needs, f"adjustment.free = {parameter}")


def _without(given: GivenOrientations, what: Literal["time", "strip"]) -> str:
    """That there are no times or strips, or which exposures have none."""
    there = np.isfinite(given.time_s) if what == "time" else np.array([bool(name) for name in given.strip])
    if not there.any():
        return "The exposures have no times" if what == "time" else "The exposures contain no strips"
    lacking = np.flatnonzero(~there)
    first = given.image[lacking[0]]
    return f"{len(lacking):,} of {len(there):,} exposures have no {what} (the first is {first})"


def _require_one_day(given: GivenOrientations, entity: str) -> None:
    """Refuse a strip with exposures half a day or more apart."""
    for index in strips_in_time(given.strip_of_image, given.time_s):
        first, last = index[0], index[-1]
        apart = given.time_s[last] - given.time_s[first]
        if apart >= _LONGEST_STRIP_S:
            raise InputError(
                f"The times of images {given.image[first]} and {given.image[last]} of strip "
                f"{given.strip[first]} are {apart:,.0f} s apart: seconds of the day or week start from zero "
                "again, or several flights use the name of the strip.",
                "Add 86400 or 604800 to the times after that, or add a flight column to the exposures.",
                entity=entity,
            )


def require_successive_times(
    given: GivenOrientations, settings: AdjustmentSettings, observe: Collection[str] = ("gnss", "ins")
) -> None:
    """Refuse errors correlated over time where strips or times are missing, or times are the same.

    Parameters
    ----------
    observe : what is observed; correlation times of other observations have no effect.

    Raises
    ------
    InputError
        If a correlation time is given and the exposures do not allow it.
    """
    stated = (
        ("gnss", "gnss_correlation_s", given.position_observed),
        ("ins", "ins_correlation_s", given.attitude_observed),
    )
    used = {
        key: given.only(own)
        for group, key, own in stated
        if getattr(settings, key) is not None and group in observe and own.any()
    }
    remedy = f"or remove {' and '.join(used)} from the adjustment."
    for key, own in used.items():
        _require_successive(own, f"adjustment.{key}", remedy)


def _require_successive(given: GivenOrientations, entity: str, remedy: str) -> None:
    if not all(given.strip):
        raise InputError(
            f"{_without(given, 'strip')}, along which errors could be correlated.",
            f"Add a strip column to the exposures, {remedy}",
            entity=entity,
        )
    if not np.isfinite(given.time_s).all():
        raise InputError(
            f"{_without(given, 'time')}, over which errors could be correlated.",
            f"Add a time column (seconds) to the exposures, {remedy}",
            entity=entity,
        )
    _require_one_day(given, entity)
    for index in strips_in_time(given.strip_of_image, given.time_s):
        again = np.flatnonzero(np.diff(given.time_s[index]) < ONE_MOMENT_S)
        if len(again):
            first = index[again[0]]
            raise InputError(
                f"Images {given.image[first]} and {given.image[index[again[0] + 1]]} of strip "
                f"{given.strip[first]} have the same time; errors that are correlated over time would be the "
                "same for both.",
                f"Correct the times or the strips, {remedy}",
                entity=entity,
            )
