"""Events: exposures of all heads of a rig at one moment, each with one reading of GNSS and INS."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adjust.arrays import Bools, Floats, Ints
from adjust.geometry import rotation
from adjust.rig import EventMotion, Rig
from tasks.block.given_orientations import GivenOrientations
from tasks.block.strip_motion import strip_motion
from tasks.deliveries.declared_exposures import ONE_MOMENT_S
from tasks.errors import InputError
from tasks.results.figures import SharedMoments

# Readings of one event that differ by more are not the same: metres, radians.
_SAME_PLACE_M, _SAME_ATTITUDE = 0.01, np.deg2rad(0.001)


@dataclass(frozen=True, eq=False)
class ExposureEvents:
    """The events of a block with rigs.

    Attributes
    ----------
    rig : which head took every image of which event.
    given : positions and attitudes of the events, with the reference head in place of the camera.
    """

    rig: Rig
    given: GivenOrientations


def exposure_events(given: GivenOrientations) -> ExposureEvents | None:
    """Join images to events: the same rig, flight and event; None without rigs.

    Where no event was delivered, times within a millisecond make one. Images of a camera alone are events of
    their own. The names of images decide nothing.

    Raises
    ------
    InputError
        If an image of a head has neither event nor time, a head took two images of one event, or the times or
        readings of one event differ.
    """
    mountings = given.mountings
    if not mountings.has_heads:
        return None
    reference = mountings.reference[given.camera]
    in_rig = (np.bincount(mountings.reference) > 1)[reference]
    named = in_rig & (np.array(given.event) != "")
    untimed = np.flatnonzero(in_rig & ~named & ~np.isfinite(given.time_s))
    if len(untimed):
        raise InputError(
            f"{len(untimed):,} images of heads have no time of exposure, which is needed to combine them "
            "into events.",
            "Deliver the times of all images of a rig, or a column `event` with the name of their event.",
            entity=f"image {given.image[untimed[0]]}",
        )
    event = joined_images(given.time_s, given.flight_of_image, np.array(given.event), reference, in_rig)
    _refuse_repeated_heads(given, event)
    # The reading of an event is that of the image of its reference head, where there is one.
    order = np.lexsort((given.camera != reference, event))
    first = order[np.searchsorted(event[order], np.arange(event.max() + 1))]
    _refuse_different_times(given, event, first)
    _refuse_different_readings(given, event, first)
    chosen = np.zeros(len(event), dtype=bool)
    chosen[first] = True
    # `only` keeps the order of the images; events are numbered in it.
    number = np.argsort(np.argsort(first))
    event = number[event]
    first = np.sort(first)
    events = replace(given.only(chosen), camera=reference[first])
    rig = Rig(
        tuple(given.image[row] for row in first),
        event,
        given.camera,
        mountings.reference,
        mountings.body_from_camera,
        _motion(events),
    )
    return ExposureEvents(rig, events)


def joined_to_events(rig: Rig) -> SharedMoments | None:
    """Images of heads that were joined to events; None where every image is one."""
    images = np.bincount(rig.event_of_image)
    joined = images[images > 1]
    if not len(joined):
        return None
    heads = len(np.unique(rig.camera_of_image))
    return SharedMoments(images=int(joined.sum()), moments=len(joined), heads=heads)


def _motion(events: GivenOrientations) -> EventMotion:
    """Velocities and rates of the body in its axes, from the readings of the events."""
    velocity = np.einsum("nji,nj->ni", events.local_from_body(), strip_motion(events).velocity)
    return EventMotion(velocity, np.nan_to_num(events.rates))


def joined_images(
    time_s: Floats, flight: Ints, name: NDArray[np.str_], reference: Ints, in_rig: Bools
) -> Ints:
    """Number (n,) of the event of each image.

    Parameters
    ----------
    time_s, flight, reference : (n,) moment, number of the flight, reference head of the rig.
    name : (n,) of the event as delivered; empty: its time decides.
    in_rig : (n,) whether the camera has others beside it.
    """
    named = in_rig & (name != "")
    time = np.where(in_rig & ~named, time_s, 0.0)
    names = len(time) + np.unique(name, return_inverse=True)[1]
    alone = np.where(named, names, np.where(in_rig, -1, np.arange(len(time))))
    order = np.lexsort((time, flight, reference, alone))
    same = (np.diff(flight[order]) == 0) & (np.diff(reference[order]) == 0)
    same &= (np.diff(alone[order]) == 0) & (np.diff(time[order]) < ONE_MOMENT_S)
    event = np.empty(len(order), dtype=np.int64)
    event[order] = np.concatenate([[0], np.cumsum(~same)])
    return event


def _refuse_repeated_heads(given: GivenOrientations, event: Ints) -> None:
    key = event * len(given.mountings.cameras) + given.camera
    order = np.argsort(key, kind="stable")
    again = np.flatnonzero(np.diff(key[order]) == 0)
    if len(again):
        one, other = (given.image[row] for row in order[again[0] : again[0] + 2])
        camera = given.mountings.names[given.camera[order[again[0]]]]
        raise InputError(
            f"The head {camera} took two images at the same time: '{one}' and '{other}' have one event, or "
            f"are less than {ONE_MOMENT_S * 1e3:g} ms apart.",
            "Correct the events or times, or declare the flights of two aircraft.",
            entity=f"image {one}",
        )


def _refuse_different_times(given: GivenOrientations, event: Ints, first: Ints) -> None:
    """Images of an event of a delivered name have its time, or none."""
    apart = np.abs(given.time_s - given.time_s[first[event]])
    wrong = apart >= ONE_MOMENT_S
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            f"Images of the event '{given.event[row]}' have different times: '{given.image[row]}' and "
            f"'{given.image[first[event[row]]]}' are {apart[row] * 1e3:.4g} ms apart.",
            "Correct the events. If a head is exposed later than the others, deliver the time of the event "
            "and state synchronisation_offset_s of the head.",
            entity=f"image {given.image[row]}",
        )


def _refuse_different_readings(given: GivenOrientations, event: Ints, first: Ints) -> None:
    """All images of an event must have the position and attitude of one body."""
    own = first[event]
    apart = np.linalg.norm(given.observed - given.observed[own], axis=1)
    body = given.local_from_body()
    turned = np.linalg.norm(rotation.log(np.swapaxes(body[own], 1, 2) @ body), axis=1)
    both = given.position_observed & given.position_observed[own]
    wrong = (both & (apart > _SAME_PLACE_M)) | (
        given.attitude_observed & given.attitude_observed[own] & (turned > _SAME_ATTITUDE)
    )
    if not wrong.any():
        return
    row = int(np.argmax(wrong))
    raise InputError(
        f"Simultaneous images have different GNSS and INS observations: '{given.image[row]}' and "
        f"'{given.image[own[row]]}' differ by {apart[row]:.3f} m and {np.rad2deg(turned[row]):.4f}° of the "
        "body. Heads of one body share one observation.",
        "Deliver positions of the antenna and angles of the body; or correct position_m and rotation_deg of "
        "the heads, from which positions and angles of the cameras follow.",
        entity=f"image {given.image[row]}",
    )
