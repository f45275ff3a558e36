"""Rigs of other programs: which images belong to one event, and how the heads sit beside each other.

A file describes its heads against a frame of the rig, whatever that is, and its events. A head without others
beside it is a camera alone.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pyarrow as pa

from adjust.arrays import Floats
from adjust.geometry.rotation import log
from tasks.errors import Location
from tasks.formats.records import ExposureRecords, HeadRecord
from tasks.plain_text import some_of

# Images that are further from where their event and head place them are not of a rigid rig: metres, radians.
_RIGID_M, _RIGID = 0.01, 1e-4
_MOST_LISTED = 10
# Decimals that are declared of a head: some 1e-13 of a rotation, and a nanometre.
_DEGREES, _METRES = 11, 9
# Cosine of a pitch that is a right angle.
_UPRIGHT = 1e-10
_AGAIN = "Export the rig again, with all its heads and images."


@dataclass(frozen=True, eq=False)
class GivenHead:
    """A head as a file declares it.

    Attributes
    ----------
    name : of the camera.
    rig : name of its rig.
    mounting : rotation R (3, 3) and place t (3,), X_rig = R X_head + t, axes x right, y down, z forward,
        metres; None: the file does not say.
    is_reference : whether the file makes it the reference head.
    """

    name: str
    rig: str
    mounting: tuple[Floats, Floats] | None
    is_reference: bool = False


@dataclass(frozen=True)
class GivenEvent:
    """An event as a file declares it: its name, that of its rig, and its images with their heads."""

    name: str
    rig: str
    images: tuple[tuple[str, str], ...]


@dataclass(frozen=True, eq=False)
class Rigs:
    """Rigs of several heads.

    Attributes
    ----------
    heads : by name, those that are not the reference head of their rig.
    event : image → its event.
    remarks : sentences about rigs that are not used.
    """

    heads: Mapping[str, HeadRecord] = field(default_factory=dict)
    event: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


def rigs_of(
    path: Path, heads: Sequence[GivenHead], events: Sequence[GivenEvent], images: Collection[str]
) -> Rigs:
    """The rigs of a file.

    Parameters
    ----------
    images : names of all images that the file has.

    Raises
    ------
    InputError
        If a head is declared twice, or not at all; if an image of an event is missing or in two events; if a
        head took two images of one event.
    """
    _refuse_twice(path, [one.name for one in heads], "The head is declared twice.")
    rigs: dict[str, list[GivenHead]] = {}
    for one in heads:
        rigs.setdefault(one.rig, []).append(one)
    known = {rig: {one.name for one in own} for rig, own in rigs.items()}
    for event in events:
        _check(path, event, known.get(event.rig, set()), images)
    _refuse_twice(path, [image for one in events for image, _ in one.images], "The image is in two events.")
    related: dict[str, HeadRecord] = {}
    remarks, used = [], set()
    for rig, own in rigs.items():
        mounted = {one.name: one.mounting for one in own if one.mounting is not None}
        if len(mounted) < len(own):
            remarks.append(_not_used([one.name for one in own], "their mounting is not in the file"))
        elif len(own) > 1:
            used.add(rig)
            reference = next((one.name for one in own if one.is_reference), own[0].name)
            related |= _related(reference, mounted)
    joined = {image: one.name for one in events if one.rig in used for image, _ in one.images}
    return Rigs(related, joined, tuple(remarks))


def rigs_by_events(groups: Iterable[Collection[str]]) -> dict[str, str]:
    """Head → name of its rig: heads that took images together, at any event, are of one rig."""
    # Loaded for rigs of other programs only, as a run that finds everything stored reads none.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    number: dict[str, int] = {}
    pairs = []
    for group in groups:
        met = [number.setdefault(head, len(number)) for head in group]
        pairs += [(met[0], other) for other in met]
    first, other = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    links = coo_array((np.ones(len(first)), (first, other)), shape=(len(number), len(number)))
    label = connected_components(links, directed=False)[1]
    return {head: f"{label[at]}" for head, at in number.items()}


def with_rigs(records: ExposureRecords, rigs: Rigs, centre: Floats, turn: Floats) -> ExposureRecords:
    """Exposures with their events and heads; with a remark instead where a rig is not rigid.

    Parameters
    ----------
    centre : (n, 3) projection centres, metres.
    turn : (n, 3, 3) rotations to their axes from those of the images, x right, y down, z forward.
    """
    event = [rigs.event.get(image) for image in records.image.to_pylist()]
    camera = [str(name) for name in records.camera.to_pylist()]
    at = {pair: row for row, pair in enumerate(zip(event, camera, strict=True)) if pair[0] is not None}
    of_head: dict[str, list[int]] = {}
    for (_, name), row in at.items():
        of_head.setdefault(name, []).append(row)
    moving: dict[str, str] = {}
    for head, one in rigs.heads.items():
        rows = [row for row in of_head.get(head, ()) if (event[row], one.reference) in at]
        beside = [at[event[row], one.reference] for row in rows]
        back = np.swapaxes(turn[beside], 1, 2)
        turned = np.linalg.norm(log(one.rotation.T @ back @ turn[rows]), axis=1).max(initial=0.0)
        apart = np.einsum("nij,nj->ni", back, centre[rows] - centre[beside]) - one.position
        moved = np.linalg.norm(apart, axis=1).max(initial=0.0)
        # Nor is what is no number, of a mounting that is no rotation.
        if not (moved <= _RIGID_M and turned <= _RIGID):
            why = f"images of {head} are up to {moved:.3g} m and {np.rad2deg(turned):.3g}° off its mounting"
            moving[one.reference] = why
    kept = {head: one for head, one in rigs.heads.items() if one.reference not in moving}
    beside_it: dict[str, list[str]] = {}
    for head, one in rigs.heads.items():
        beside_it.setdefault(one.reference, [one.reference]).append(head)
    remarks = [_not_used(beside_it[reference], why) for reference, why in moving.items()]
    in_rig = np.isin(camera, [*kept, *(one.reference for one in kept.values())])
    joined = [name if own else None for name, own in zip(event, in_rig, strict=True)]
    return replace(
        records,
        event=pa.array(joined, pa.string()) if kept else None,
        heads=kept,
        remarks=(*records.remarks, *rigs.remarks, *remarks),
    )


def declared_head(head: HeadRecord) -> dict[str, str | list[float]]:
    """The table [cameras.NAME.head] of a project file, with mount_deg = 0 of both cameras.

    Their body axes forward, right, down are x right, y down, z forward of the image then.
    """
    angles = np.rad2deg(_roll_pitch_yaw(head.rotation)).round(_DEGREES)
    return {
        "reference": head.reference,
        "rotation_deg": [float(value) + 0.0 for value in angles],
        "position_m": [float(value) + 0.0 for value in head.position.round(_METRES)],
    }


def _roll_pitch_yaw(turn: Floats) -> list[float]:
    """Radians; of a head at right angles ahead or back, where only yaw ∓ roll shows, yaw is zero."""
    level = float(np.hypot(turn[0, 0], turn[1, 0]))
    pitch = np.arctan2(-turn[2, 0], level)
    if level < _UPRIGHT:
        return [np.arctan2(-turn[1, 2], turn[1, 1]), pitch, 0.0]
    return [np.arctan2(turn[2, 1], turn[2, 2]), pitch, np.arctan2(turn[1, 0], turn[0, 0])]


def _check(path: Path, event: GivenEvent, heads: Collection[str], images: Collection[str]) -> None:
    taken: dict[str, str] = {}
    for image, head in event.images:
        if image not in images:
            raise Location(path, entity=event.name).error(
                f"The event has the image '{image}', which is missing.", _AGAIN
            )
        if head not in heads:
            raise Location(path, entity=event.name).error(
                f"The image '{image}' is of the head '{head}', which its rig does not have.", _AGAIN
            )
        if head in taken:
            raise Location(path, entity=event.name).error(
                f"The head '{head}' has two images of one event: '{taken[head]}' and '{image}'.",
                "Correct the events: a head takes one image of each.",
            )
        taken[head] = image


def _refuse_twice(path: Path, names: Sequence[str], what: str) -> None:
    known: set[str] = set()
    for name in names:
        if name in known:
            raise Location(path, entity=name).error(what, "Keep one of the two.")
        known.add(name)


def _related(reference: str, mounted: Mapping[str, tuple[Floats, Floats]]) -> dict[str, HeadRecord]:
    """The other heads of a rig against its reference head."""
    turn, place = mounted[reference]
    return {
        name: HeadRecord(reference, turn.T @ own, turn.T @ (there - place))
        for name, (own, there) in mounted.items()
        if name != reference
    }


def _not_used(heads: Sequence[str], why: str) -> str:
    return f"The heads {some_of(heads, _MOST_LISTED)} are read as single cameras: {why}."
