"""The project file of a folder of deliveries: what the files say, and what a person has to declare."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import cast

import numpy as np
import pyarrow as pa

from tasks.formats.meanings import ADJUSTED, IMAGE_POINT_MEANINGS, WITHOUT_REFRACTION
from tasks.formats.records import ControlRecords, ExposureRecords, FileStatement, ImagePointRecords
from tasks.formats.register import TABLE
from tasks.inventory.cameras import CameraSection, camera_sections
from tasks.inventory.foreign_tables import layout_keys
from tasks.inventory.recognition import Content, FoundFile
from tasks.inventory.toml_lines import comment, key_line, table_line
from tasks.plain_text import quoted
from tasks.settings.coordinates import LOCAL
from tasks.settings.declare import open_value

_CRS = "of x and y, e.g. 'EPSG:25832' (or 'local'); x is east and y is north"
_HEIGHTS = "'ellipsoidal', or { geoid = 'FILE.tif' }"
_UNIT = "px, mm, um, centred-px or longer-side"
_POSITION = "projection_centre, antenna or imu"
_ORDER = "omega-phi-kappa or phi-omega-kappa"
_ANGLE_UNIT = "deg, gon or rad"
_REFERENCE = "grid (axes of the map), true-north or local"
_STRIP = "'time-gaps', or { pattern = '{strip}_*' } after the names of the images"
_DISTANCE_UNIT = "m or mm"
_INTRODUCTION = (
    "Written by aerocal init: what the files in this folder are, and what they say themselves.",
    "Values that begin with DECLARE are not in the files. Nothing of this is guessed: ask whoever delivered",
    "them, and replace each. aerocal run refuses the project until then. docs/project-file.md has all keys.",
)


def project_text(name: str, files: Sequence[FoundFile], folder: Path) -> str:
    """The text of project.toml.

    Parameters
    ----------
    name : of the project.
    files : what was found in the folder.
    """
    inputs = [(file, content) for file in files for content in file.contents]
    cameras = camera_sections(files, folder)
    lines = [*map(comment, _INTRODUCTION), "", "version = 1", "", *_project(name, inputs)]
    for camera in cameras:
        lines += ["", *_camera(camera)]
    lines += _inputs(inputs, folder, cameras)
    lines += _adjustment(inputs)
    return "\n".join(lines) + "\n"


def _project(name: str, inputs: Sequence[tuple[FoundFile, Content]]) -> Iterator[str]:
    stated = {_states(content).crs for _, content in inputs if content.kind in ("exposures", "control")}
    yield "[project]"
    yield key_line("name", name)
    if stated == {LOCAL}:
        yield key_line("crs", LOCAL, "the files state local coordinates")
        return
    yield key_line("crs", open_value("of the results, a map projection in metres, e.g. 'EPSG:25832'"))
    yield key_line("heights", open_value(f"of the results, {_HEIGHTS}"))


def _camera(camera: CameraSection) -> Iterator[str]:
    yield table_line("cameras", camera.name)
    for text in camera.remarks:
        yield comment(text)
    for key, value in camera.values.items():
        yield key_line(key, value)


def _inputs(
    inputs: Sequence[tuple[FoundFile, Content]], folder: Path, cameras: Sequence[CameraSection]
) -> Iterator[str]:
    images: set[str] = set()
    for kind in ("image_points", "exposures", "control", "distances"):
        of_kind = [(file, content) for file, content in inputs if content.kind == kind]
        for file, content in of_kind:
            lines = list(_input(file, content, folder, cameras))
            if kind == "exposures":
                own = _images(cast(ExposureRecords, content.records))
                if own & images:
                    # Two orientations of one image are refused; which is meant, a person knows.
                    lines = [
                        comment("The images of this file are in the one above, too: keep one of the two."),
                        *map(comment, lines),
                    ]
                images |= own
            yield ""
            yield from lines


def _input(
    file: FoundFile, content: Content, folder: Path, cameras: Sequence[CameraSection]
) -> Iterator[str]:
    yield f"[[inputs.{content.kind}]]"
    yield key_line("file", file.path.relative_to(folder).as_posix())
    yield key_line("format", content.format)
    for key, value in layout_keys(content.layout).items():
        yield key_line(key, value)
    records = content.records
    if isinstance(records, ImagePointRecords):
        yield from _image_points(content, records)
    elif isinstance(records, ExposureRecords):
        yield from _exposures(content, records, cameras)
    elif isinstance(records, ControlRecords):
        yield from _place(records.states, records.position, f"{len(records.line)} points")
    else:
        yield key_line("unit", open_value(_DISTANCE_UNIT))
        yield key_line("sigma", 0.01, "in the unit above; the files do not always say it")


def _image_points(content: Content, records: ImagePointRecords) -> Iterator[str]:
    counts = f"{len(records.line):,} image points in {len(records.image.dictionary):,} images"
    yield comment(f"{counts}: x {_range(records.xy[:, 0])}, y {_range(records.xy[:, 1])}")
    meaning = IMAGE_POINT_MEANINGS.get(content.format)
    if meaning is None:
        yield key_line("unit", open_value(_UNIT))
    else:
        yield key_line("unit", meaning.unit, "as the format has it")


def _exposures(content: Content, records: ExposureRecords, cameras: Sequence[CameraSection]) -> Iterator[str]:
    states = records.states
    yield from _place(states, records.position, f"{len(records.line):,} exposures")
    adjusted = content.format in ADJUSTED
    if states.position is not None or adjusted:
        yield key_line("position", "projection_centre", "as the file has it")
    else:
        yield key_line("position", open_value(_POSITION))
    yield from _angles(content, records)
    table = content.format == TABLE
    if records.camera.null_count == len(records.line) and (len(cameras) > 1 or table):
        value = cameras[0].name if len(cameras) == 1 else open_value("name of the camera of this file")
        yield key_line("camera", value)
    if table and "strip" in content.layout.elsewhere:
        yield key_line("strip", open_value(_STRIP))


def _angles(content: Content, records: ExposureRecords) -> Iterator[str]:
    states = records.states
    if np.isfinite(records.angles).any():
        ranges = ", ".join(_range(column) for column in records.angles.T)
        yield comment(f"angles {ranges}")
        heading = content.order if content.order == "heading-pitch-roll" else None
        order: str = heading or states.order or open_value(_ORDER)
        unit = records.declared_angle_unit or open_value(_ANGLE_UNIT)
        reference = states.reference or ("local" if states.crs == LOCAL else open_value(_REFERENCE))
    else:
        yield comment("no angles are given, and none of these keys matters")
        order, unit, reference = "omega-phi-kappa", "deg", "local"
    yield key_line("angles", {"order": order, "unit": unit, "reference": reference})


def _place(states: FileStatement, position: np.ndarray, counts: str) -> Iterator[str]:
    yield comment(
        f"{counts}: {', '.join(f'{n} {_range(p)}' for n, p in zip('xyz', position.T, strict=True))}"
    )
    if states.crs is not None and "+ellps" not in states.crs:
        yield key_line("crs", states.crs, "as the file states it")
    elif states.crs is not None:
        # An ellipsoid is no datum: between such systems nothing can be transformed.
        datum = f", datum {states.datum}" if states.datum else ""
        yield key_line("crs", open_value(f"its EPSG code; the file states {states.crs}{datum}"))
    else:
        datum = f"; the file states the datum {quoted(states.datum)}" if states.datum else ""
        yield key_line("crs", open_value(_CRS + datum))
    if states.crs == LOCAL:
        return
    if states.heights is not None:
        yield key_line("heights", states.heights, "as the file states it")
    else:
        yield key_line("heights", open_value(_HEIGHTS))


def _adjustment(inputs: Sequence[tuple[FoundFile, Content]]) -> Iterator[str]:
    """What the results of another adjustment are not: observations of the next one, and free of its model."""
    exposures = [content for _, content in inputs if content.kind == "exposures"]
    cameras = [content for _, content in inputs if content.kind == "camera"]
    adjusted = bool(exposures) and all(content.format in ADJUSTED for content in exposures)
    without = bool(cameras) and all(content.format in WITHOUT_REFRACTION for content in cameras)
    if not adjusted and not without:
        return
    yield ""
    yield "[adjustment]"
    if without:
        yield comment("That program knows no refraction: it is in the focal length and distortion it found.")
        yield key_line("refraction", "none")
    if not adjusted:
        return
    control = any(content.kind == "control" for _, content in inputs)
    yield comment("The orientations are the result of an adjustment: approximate values, no observations.")
    yield key_line("observe", ["control"] if control else [])
    if not control:
        yield key_line("datum", "free_network", "nothing else fixes it: there is no control")


def _states(content: Content) -> FileStatement:
    records = content.records
    return records.states if isinstance(records, ExposureRecords | ControlRecords) else FileStatement()


def _images(records: ExposureRecords) -> set[str]:
    return {str(name) for name in cast(pa.Array, records.image).to_pylist()}


def _range(values: np.ndarray) -> str:
    known = values[np.isfinite(values)]
    return f"{known.min():.10g} to {known.max():.10g}" if len(known) else "not given"
