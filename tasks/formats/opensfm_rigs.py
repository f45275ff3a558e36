"""Rigs of OpenSfM's ``reconstruction.json``: ``rig_cameras`` and ``rig_instances``.

A rig camera has the pose camera from rig (rotation as axis and angle, X_camera = R X + t); which rig camera took a shot, an
instance says. Rig cameras that share a camera model are heads of their own, called as the rig camera; others
go by their camera model. Source: OpenSfM's documentation, "Rig Models".
"""  # noqa: E501

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from adjust.geometry.rotation import exp
from tasks.formats.json_value import JsonValue
from tasks.formats.rigs import GivenEvent, GivenHead, Rigs, rigs_by_events, rigs_of


@dataclass(frozen=True, eq=False)
class OpenSfmRigs:
    """Rigs of a reconstruction.

    Attributes
    ----------
    rigs : heads and events.
    camera : name of the camera of each shot of a rig.
    models : name of a camera that a rig has → its camera model.
    """

    rigs: Rigs = field(default_factory=Rigs)
    camera: Mapping[str, str] = field(default_factory=dict)
    models: Mapping[str, str] = field(default_factory=dict)


def opensfm_rigs(whole: JsonValue, models: Mapping[str, str | None]) -> OpenSfmRigs:
    """The rigs of a reconstruction, where any instance has several shots.

    Parameters
    ----------
    whole : the reconstruction.
    models : shot → its camera model.

    Raises
    ------
    InputError
        If what it says of rigs is damaged; as of `tasks.formats.rigs`.
    """
    if not whole.has("rig_instances"):
        return OpenSfmRigs()
    instances = {
        name: {shot: head.text() for shot, head in one["rig_camera_ids"].entries()}
        for name, one in whole["rig_instances"].entries()
    }
    if all(len(shots) < 2 for shots in instances.values()):
        return OpenSfmRigs()
    rig = rigs_by_events([set(shots.values()) for shots in instances.values()])
    names = _names(instances, models)
    heads = [
        _head(names.get(head, head), rig[head], one)
        for head, one in whole["rig_cameras"].entries()
        if head in rig
    ]
    events = [
        GivenEvent(
            f"instance {name}",
            rig[next(iter(shots.values()))],
            tuple((shot, names.get(head, head)) for shot, head in shots.items()),
        )
        for name, shots in instances.items()
        if shots
    ]
    found = rigs_of(whole.file, heads, events, models)
    camera = {
        shot: names[head] for shots in instances.values() for shot, head in shots.items() if head in names
    }
    return OpenSfmRigs(found, camera, {name: str(models[shot]) for shot, name in camera.items()})


def _head(name: str, rig: str, one: JsonValue) -> GivenHead:
    vector, shift = np.array(one["rotation"].numbers(3)), np.array(one["translation"].numbers(3))
    back = exp(vector).T
    return GivenHead(name, rig, (back, -back @ shift), not np.any([vector, shift]))


def _names(instances: Mapping[str, Mapping[str, str]], models: Mapping[str, str | None]) -> dict[str, str]:
    """Rig camera → name of the camera: of its camera model, if no other one has it."""
    pairs = {
        (head, models[shot])
        for shots in instances.values()
        for shot, head in shots.items()
        if models.get(shot) is not None
    }
    heads, taken = Counter(head for head, _ in pairs), Counter(model for _, model in pairs)
    return {head: str(model) if heads[head] == taken[model] == 1 else head for head, model in pairs}
