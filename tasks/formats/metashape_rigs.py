"""Rigs of Metashape's XML: slave sensors and slave cameras, both with ``master_id``.

``rotation`` and ``location`` of a slave sensor lead from its axes (x right, y down, z forward) to those of its master, in units of
the chunk: transform of a slave camera = transform of its master camera · [rotation, location]. Slave cameras have no transform of their
own. Sources: Metashape Expert Manual, "The slave-sensor transform"; Meta's converter of its rigs of 9 and 22 cameras.
"""  # noqa: E501

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from adjust.arrays import Floats
from tasks.errors import InputError, Location
from tasks.formats.plain_records import numbers_of
from tasks.formats.rigs import GivenEvent, GivenHead, Rigs, rigs_of

_AGAIN = "Export the cameras of the whole chunk again."


@dataclass(frozen=True, eq=False)
class MetashapeRigs:
    """What a file says of its rigs.

    Attributes
    ----------
    path : the file.
    sensors : id of a sensor → its name.
    master : id of a slave sensor → id of its master.
    mounting : id of a slave sensor → rotation (3, 3) and location (3,); none where they are not given.
    cameras : id of a camera → its element, where the file has slave cameras.
    """

    path: Path
    sensors: Mapping[str, str]
    master: Mapping[str, str] = field(default_factory=dict)
    mounting: Mapping[str, tuple[Floats, Floats]] = field(default_factory=dict)
    cameras: Mapping[str, ElementTree.Element] = field(default_factory=dict)

    @classmethod
    def of(cls, path: Path, root: ElementTree.Element, sensors: Mapping[str, str]) -> MetashapeRigs:
        """Of a document.

        Raises
        ------
        InputError
            If a sensor or camera has a master that is not in the file, or a sensor is declared twice.
        """
        master: dict[str, str] = {}
        mounting: dict[str, tuple[Floats, Floats]] = {}
        known: set[str] = set()
        for item in root.iter("sensor"):
            number = item.get("id", "")
            if number in known:
                raise Location(path, entity=sensors.get(number, number)).error(
                    "The sensor is declared twice.", _AGAIN
                )
            known.add(number)
            if _master(item) is not None:
                master[number] = str(_master(item))
                own = _mounting(path, item, len(known))
                mounting |= {} if own is None else {number: own}
        slaves = any(_master(item) is not None for item in root.iter("camera"))
        cameras = {item.get("id", ""): item for item in root.iter("camera")} if slaves else {}
        for number, master_sensor in master.items():
            if master_sensor not in sensors:
                raise _no_master(path, f"sensor {sensors[number]}", f"sensor {master_sensor}")
        for item in cameras.values():
            of = _master(item) or item.get("id", "")
            if of not in cameras:
                raise _no_master(path, f"camera {item.get('label')}", f"camera {of}")
        return cls(path, sensors, master, mounting, cameras)

    def placed(self, item: ElementTree.Element, number: int) -> Floats | None:
        """Transform (4, 4) of a slave camera to the chunk; None: its master is not aligned, or it is none.

        Raises
        ------
        InputError
            If the mounting of its sensor is not given.
        """
        of = _master(item)
        if of is None:
            return None
        text = self.cameras[of].findtext("transform")
        if text is None:
            return None
        sensor = item.get("sensor_id", "")
        if sensor not in self.mounting:
            raise Location(self.path, entity=item.get("label")).error(
                "The slave camera has no transform, and its sensor no master, rotation and location.", _AGAIN
            )
        found = np.eye(4)
        found[:3, :3], found[:3, 3] = self.mounting[sensor]
        return np.asarray(transform_of(self.path, text, number) @ found)

    def rigs(self, images: Sequence[str], scales: set[float]) -> Rigs:
        """The rigs of the images that are read.

        Parameters
        ----------
        scales : metres of a unit of the chunk; of several ones, the mountings have none.
        """
        heads = list(self._heads(next(iter(scales)) if len(scales) == 1 else None))
        known = set(images)
        events: dict[str, tuple[ElementTree.Element, list[tuple[str, ElementTree.Element]]]] = {}
        for item in self.cameras.values():
            label = item.get("label", "")
            if label in known:
                number = _master(item) or item.get("id") or ""
                events.setdefault(number, (self.cameras[number], []))[1].append((label, item))
        return rigs_of(
            self.path,
            heads,
            [
                GivenEvent(
                    of.get("label", ""),
                    self.master.get(of.get("sensor_id", ""), of.get("sensor_id", "")),
                    tuple((label, self._name(item)) for label, item in own),
                )
                for of, own in events.values()
            ],
            known,
        )

    def _heads(self, scale: float | None) -> Iterator[GivenHead]:
        for number, name in self.sensors.items():
            of, own = self.master.get(number, number), self.mounting.get(number)
            if of == number:
                yield GivenHead(name, number, (np.eye(3), np.zeros(3)), is_reference=True)
            else:
                mounting = None if own is None or scale is None else (own[0], scale * own[1])
                yield GivenHead(name, of, mounting)

    def _name(self, item: ElementTree.Element) -> str:
        number = item.get("sensor_id", "")
        return self.sensors.get(number, number)


def transform_of(path: Path, text: str, number: int) -> Floats:
    """A transform (4, 4)."""
    return np.array(numbers_of(path, text.split(), 16, number, "a 4 × 4 transform")).reshape(4, 4)


def _master(item: ElementTree.Element) -> str | None:
    """The id of the master of a sensor or camera; None: it is none's slave."""
    of = item.get("master_id")
    return None if of == item.get("id") else of


def _mounting(path: Path, item: ElementTree.Element, number: int) -> tuple[Floats, Floats] | None:
    texts = [item.findtext("rotation"), item.findtext("location")]
    if not all(text and text.strip() for text in texts):
        return None
    turn, place = (
        numbers_of(path, (text or "").split(), count, number, "the mounting of a slave sensor")
        for text, count in zip(texts, (9, 3), strict=True)
    )
    return np.array(turn).reshape(3, 3), np.array(place)


def _no_master(path: Path, slave: str, master: str) -> InputError:
    return Location(path, entity=slave).error(f"Its master, the {master}, is not in the file.", _AGAIN)
