"""Rigs and frames of COLMAP 3.12 and later: ``rigs`` and ``frames`` of a model, text or binary.

A rig has sensors: the first is its origin, the others have a pose sensor from rig, or none. A frame is an event with the images
of its sensors. Sensors that are no cameras have no images. Text has a line for each rig and frame; binary files are
little-endian with a count of 8 bytes.
"""  # noqa: E501

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from tasks.errors import InputError, Location
from tasks.formats.plain_records import number_of
from tasks.formats.quaternions import rotations_of_quaternions
from tasks.formats.rigs import GivenEvent, GivenHead
from tasks.formats.text_table import read_bytes

_CAMERA = "CAMERA"
_TYPES = {0: _CAMERA, 1: "IMU"}


def colmap_rig_files(images: Path) -> tuple[Path, Path] | None:
    """The files ``rigs`` and ``frames`` beside a file ``images``; None: they are not there."""
    rigs, frames = (images.with_name(f"{name}{images.suffix}") for name in ("rigs", "frames"))
    return (rigs, frames) if rigs.is_file() and frames.is_file() else None


def colmap_heads(path: Path) -> list[GivenHead]:
    """The cameras of the rigs of a file ``rigs.txt`` or ``rigs.bin``, by their numbers.

    Raises
    ------
    InputError
        If the file is damaged, or a quaternion is none.
    """
    found = []
    for entry in _entries(path):
        rig, count = str(entry.whole("I")), entry.whole("I")
        for place in range(count):
            kind, number = entry.kind(), str(entry.whole("I"))
            pose = np.array([1.0, *6 * [0.0]]) if place == 0 else None
            if place > 0 and entry.whole("B"):
                pose = np.array(entry.reals(7))
            if kind != _CAMERA:
                continue
            if pose is None:
                found.append(GivenHead(number, rig, None))
                continue
            back = rotations_of_quaternions(path, pose[None, :4], [f"camera {number}"], [entry.line])[0].T
            found.append(GivenHead(number, rig, (back, -back @ pose[4:]), place == 0))
    return found


def colmap_events(path: Path, images: Mapping[int, str], cameras: Mapping[str, str]) -> list[GivenEvent]:
    """The frames of a file ``frames.txt`` or ``frames.bin``.

    Parameters
    ----------
    images : number → name.
    cameras : name of an image → number of its camera.

    Raises
    ------
    InputError
        If the file is damaged, or has an image of another camera than its sensor.
    """
    found = []
    for entry in _entries(path):
        name, rig = f"frame {entry.whole('I')}", str(entry.whole("I"))
        entry.reals(7)
        taken = []
        for _ in range(entry.whole("I")):
            kind, sensor, number = entry.kind(), str(entry.whole("I")), entry.whole("Q")
            if kind != _CAMERA:
                continue
            # An image that is not there is refused under its number.
            image = images.get(number, f"{number}")
            if cameras.get(image, sensor) != sensor:
                raise Location(path, entry.line, name).error(
                    f"The image '{image}' is of camera {cameras[image]}, but of sensor {sensor} here.",
                    "Deliver rigs, frames, images and cameras of one model.",
                )
            taken.append((image, sensor))
        found.append(GivenEvent(name, rig, tuple(taken)))
    return found


class _Line:
    """The values of a line of text."""

    def __init__(self, path: Path, line: int, words: list[str]) -> None:
        self.line, self._path, self._words = line, path, iter(words)

    def kind(self) -> str:
        """The type of a sensor."""
        return next(self._words, "")

    def whole(self, _: str) -> int:
        """A whole number."""
        value = number_of(self._path, next(self._words, ""), self.line, "a whole number")
        if not value.is_integer() or value < 0.0:
            raise _damaged(self._path, self.line)
        return int(value)

    def reals(self, count: int) -> list[float]:
        """Numbers."""
        what = "a number of a pose"
        return [number_of(self._path, next(self._words, ""), self.line, what) for _ in range(count)]


class _Bytes:
    """The values of an entry of a binary file, from a place on."""

    def __init__(self, path: Path, content: bytes, at: int) -> None:
        self.line, self.at, self._path, self._content = 0, at, path, content

    def _taken(self, layout: str) -> tuple[float, ...]:
        try:
            values = struct.unpack_from(f"<{layout}", self._content, self.at)
        except struct.error as error:
            raise _damaged(self._path, self.line) from error
        self.at += struct.calcsize(f"<{layout}")
        return values

    def kind(self) -> str:
        """The type of a sensor."""
        return _TYPES.get(int(self._taken("i")[0]), "")

    def whole(self, code: str) -> int:
        """A whole number of a size."""
        return int(self._taken(code)[0])

    def reals(self, count: int) -> list[float]:
        """Numbers."""
        values = list(self._taken(f"{count}d"))
        if not np.isfinite(values).all():
            raise _damaged(self._path, self.line)
        return values


def _entries(path: Path) -> Iterator[_Line | _Bytes]:
    """The entries of a file, each to be read to its end before the next one."""
    content = read_bytes(path, "document")
    if b"\0" not in content[:8]:
        for line, text in enumerate(content.decode("utf-8", errors="replace").splitlines(), start=1):
            if text.strip() and not text.lstrip().startswith("#"):
                yield _Line(path, line, text.split())
        return
    fields = _Bytes(path, content, 0)
    for _ in range(fields.whole("Q")):
        fields.line += 1
        yield fields


def _damaged(path: Path, line: int) -> InputError:
    return Location(path, line).error(
        "The file ends in the middle of an entry, or is not a file of rigs or frames of COLMAP.",
        "Deliver it again.",
    )
