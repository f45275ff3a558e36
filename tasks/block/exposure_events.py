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
    # An event has the name of the image of its reference head, where there is one, and the readings of that
    # image, where it has them.
    other = given.camera != reference
    first = first_of_events(event, other)
    place = first_of_events(event, ~given.position_observed, other)
    attitude = first_of_events(event, ~given.attitude_observed, other)
    _refuse_different_times(given, event, first)
    _refuse_different_readings(given, place[event], attitude[event])
    # `only` keeps the order of the images; events are numbered in it.
    order = np.argsort(first)
    event = np.argsort(order)[event]
    first = first[order]
    events = _of_events(given, first, place[order], attitude[order])
    rig = Rig(
        tuple(given.image[row] for row in first),
        event,
        given.camera,
        mountings.reference,
        mountings.body_from_camera,
        _motion(events),
    )
    return ExposureEvents(rig, events)


def first_of_events(event: Ints, *after: Bools) -> Ints:
    """(e,) the first image of each event: of those for which the conditions (n,) do not hold, if any.

    Conditions that are named first decide first.
    """
    order = np.lexsort((*after[::-1], event))
    return order[np.searchsorted(event[order], np.arange(event.max() + 1))]


def _of_events(given: GivenOrientations, first: Ints, place: Ints, attitude: Ints) -> GivenOrientations:
    """The events with these images (e,) as they are called, with the positions and attitudes of those."""
    chosen = np.zeros(len(given.image), dtype=bool)
    chosen[first] = True
    camera = given.mountings.reference[given.camera[first]]
    return replace(
        given.only(chosen),
        camera=camera,
        x_in_map=given.x_in_map[place],
        observed=given.observed[place],
        position_sigma=given.position_sigma[place],
        local_from_grid=given.local_from_grid[place],
        local_from_enu=given.local_from_enu[place],
        velocity=given.velocity[place],
        position_observed=given.position_observed[place],
        angles=given.angles_of(attitude, camera),
        angle_sigma=given.angle_sigma[attitude],
        is_heading=given.is_heading[attitude],
        rates=given.rates[attitude],
        attitude_observed=given.attitude_observed[attitude],
    )


def joined_to_events(rig: Rig) -> SharedMoments | None:
    """Images of heads that were joined to events, even if there are none; None where one head took all."""
    images = np.bincount(rig.event_of_image)
    joined = images[images > 1]
    heads = len(np.unique(rig.camera_of_image))
    if heads == 1:
        return None
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


def _refuse_different_readings(given: GivenOrientations, place: Ints, attitude: Ints) -> None:
    """All images must have the position and attitude of their event, which are those of images (n,)."""
    apart = np.linalg.norm(given.observed - given.observed[place], axis=1)
    body = given.local_from_body()
    turned = np.linalg.norm(rotation.log(np.swapaxes(body[attitude], 1, 2) @ body), axis=1)
    elsewhere = given.position_observed & given.position_observed[place] & (apart > _SAME_PLACE_M)
    otherwise = given.attitude_observed & given.attitude_observed[attitude] & (turned > _SAME_ATTITUDE)
    wrong = elsewhere | otherwise
    if not wrong.any():
        return
    row = int(np.argmax(wrong))
    own = (place if elsewhere[row] else attitude)[row]
    raise InputError(
        f"Simultaneous images have different GNSS and INS observations: '{given.image[row]}' and "
        f"'{given.image[own]}' differ by {apart[row]:.3f} m and {np.rad2deg(turned[row]):.4f}° of the "
        "body. Heads of one body share one observation.",
        "Deliver positions of the antenna and angles of the body; or correct position_m and rotation_deg of "
        "the heads, from which positions and angles of the cameras follow.",
        entity=f"image {given.image[row]}",
    )
