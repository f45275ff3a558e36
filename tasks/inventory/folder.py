"""Examine a folder of deliveries and draft its project file: what files state, and what must be declared."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias, cast

import numpy as np
import pyarrow as pa

from tasks.errors import Location
from tasks.files.installation import writing_into
from tasks.formats.colmap_rigs import colmap_rig_files
from tasks.formats.meanings import ADJUSTED, IMAGE_POINT_MEANINGS, IN_A_MAP, WITHOUT_REFRACTION
from tasks.formats.records import ControlRecords, ExposureRecords, FileStatement, ImagePointRecords
from tasks.formats.register import TABLE
from tasks.formats.trajectory_records import TrajectoryRecords
from tasks.inventory.cameras import CameraSection, camera_sections
from tasks.inventory.foreign_tables import layout_keys
from tasks.inventory.project_lines import (
    HEIGHTS,
    POSITION,
    STRIP,
    camera_lines,
    comment,
    key_line,
    place_lines,
    table_line,
    value_range,
)
from tasks.inventory.recognition import Content, FoundFile, recognised
from tasks.inventory.trajectory_lines import trajectory_sections, unused_parts
from tasks.results.manifest import MANIFEST, read_manifest
from tasks.settings.coordinates import LOCAL
from tasks.settings.declare import open_value

PROJECT_FILE = "project.toml"
_MOST_FILES = 2_000
_RESULTS = "results of a run, with its exports: no delivery"


@dataclass(frozen=True)
class Inventory:
    """What was found and written.

    Attributes
    ----------
    project_file : the file that was written.
    files : everything in the folder, in the order of the names.
    open_values : number of values that are still to be declared.
    """

    project_file: Path
    files: tuple[FoundFile, ...]
    open_values: int


def begin_project(folder: Path) -> Inventory:
    """Recognise the files of a folder and write its project.toml.

    Raises
    ------
    InputError
        If the folder is none, has a project file already (it is never overwritten), or holds no image points.
    """
    root = folder.resolve()
    if not root.is_dir():
        raise Location(folder).error("This is not a folder.", "Give the folder of the delivered files.")
    target = root / PROJECT_FILE
    if target.exists() or target.is_symlink():
        raise Location(target).error(
            "There is already a project file, and it is never overwritten.",
            "Rename it, or continue with `aerocal doctor`.",
        )
    results = [manifest.parent for manifest in root.rglob(MANIFEST) if read_manifest(manifest.parent)]
    read = map(recognised, _files(root, [folder for folder in results if folder != root]))
    files = (*read, *(FoundFile(folder, (), _RESULTS) for folder in sorted(results) if folder != root))
    _refuse_nothing(files, root)
    _refuse_names(file.path for file in files if file.contents)
    text = project_text(root.name, files, root)
    # Whole or not at all: half of one would be a project file that is never overwritten.
    part = target.with_name(f".{PROJECT_FILE}.part")
    with writing_into(root, None):
        try:
            part.write_text(text, encoding="utf-8")
            part.rename(target)
        except OSError:
            with suppress(OSError):
                part.unlink()
            raise
    declared = [line for line in text.splitlines() if not line.startswith("#")]
    return Inventory(target, files, sum(line.count('"DECLARE: ') for line in declared))


def _files(root: Path, without: Sequence[Path]) -> list[Path]:
    """Ordinary files below the folder, none of which is hidden or in one of the folders `without`."""
    found = [
        path
        for path in sorted(root.rglob("*"))
        if path.is_file()
        and not path.is_symlink()
        and not any(part.startswith(".") for part in path.relative_to(root).parts)
        and not any(path.is_relative_to(folder) for folder in without)
    ]
    if len(found) > _MOST_FILES:
        raise Location(root).error(
            f"The folder contains {len(found):,} files, more than {_MOST_FILES:,}.",
            "Give a folder with the files of one block only, and keep the images elsewhere.",
        )
    return found


def _refuse_nothing(files: Sequence[FoundFile], root: Path) -> None:
    kinds = {content.kind for file in files for content in file.contents}
    if kinds & {"image_points", "exposures", "trajectory"}:
        return
    seen = ", ".join(f"{file.path.name}: {file.remark or 'other'}" for file in files[:8])
    shown = f" ({seen})" if seen else ""
    raise Location(root).error(
        f"None of the {len(files)} files has image points, exposures or a trajectory{shown}.",
        "Put the files of the delivery there; docs/import.md lists the formats that are read.",
    )


def _refuse_names(paths: Iterable[Path]) -> None:
    for path in paths:
        try:
            str(path).encode()
        except UnicodeEncodeError as error:
            raise Location(path).error("The name is not UTF-8.", "Rename the file.") from error


_UNIT = "px, mm, um, centred-px or longer-side"
_ORDER = "omega-phi-kappa or phi-omega-kappa"
_ANGLE_UNIT = "deg, gon or rad"
_REFERENCE = "grid (axes of the map), true-north or local"
_RATE_AXES = "forward-right-down or forward-left-up"
_DISTANCE_UNIT = "m or mm"
_INTRODUCTION = (
    "Written by aerocal init: the files in this folder, and what they state.",
    "Values that begin with DECLARE are not in the files and are never guessed: ask whoever delivered",
    "them, and replace each. aerocal run refuses the project until then. docs/project-file.md lists all "
    "keys.",
)
_PLACED = (ExposureRecords, ControlRecords, TrajectoryRecords)
# Lines of an input, and whose exposures it has.
_Section: TypeAlias = tuple[list[str], frozenset[str]]


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
    lines += _inputs(files, inputs, folder, cameras)
    lines += _adjustment(inputs)
    return "\n".join(lines) + "\n"


def _project(name: str, inputs: Sequence[tuple[FoundFile, Content]]) -> Iterator[str]:
    stated = {_states(content).crs for _, content in inputs if isinstance(content.records, _PLACED)}
    yield "[project]"
    yield key_line("name", name)
    if stated == {LOCAL}:
        yield key_line("crs", LOCAL, "the files state local coordinates")
        return
    yield key_line("crs", open_value("of the results, a map projection in metres, e.g. 'EPSG:25832'"))
    yield key_line("heights", open_value(f"of the results, {HEIGHTS}"))


def _camera(camera: CameraSection) -> Iterator[str]:
    yield table_line("cameras", camera.name)
    for text in camera.remarks:
        yield comment(text)
    for key, value in camera.values.items():
        yield key_line(key, value)


def _inputs(
    files: Sequence[FoundFile],
    inputs: Sequence[tuple[FoundFile, Content]],
    folder: Path,
    cameras: Sequence[CameraSection],
) -> Iterator[str]:
    for kind in ("image_points", "exposures", "control", "distances"):
        of_kind = [
            (list(_input(file, content, folder, cameras, _crs_beside(file, files))), _images(content))
            for file, content in inputs
            if content.kind == kind
        ]
        if kind == "exposures":
            taken = trajectory_sections(files, folder, cameras)
            of_kind = _one_of_each([*((list(one.lines), one.images) for one in taken), *of_kind])
        for lines, _ in of_kind:
            yield ""
            yield from lines
    unused = list(unused_parts(files, folder))
    yield from ("", *unused) if unused else ()


def _one_of_each(sections: Iterable[_Section]) -> list[_Section]:
    """Sections of exposures, commented out if they repeat images of an earlier one."""
    images: frozenset[str] = frozenset()
    result = []
    for lines, own in sections:
        if own & images:
            # Two orientations of one image are refused; which is meant, a person knows.
            again = comment("The images of this file are also in the one above: keep one of the two.")
            result.append(([again, *(comment(line) if line else line for line in lines)], own))
        else:
            result.append((lines, own))
        images |= own
    return result


def _input(
    file: FoundFile, content: Content, folder: Path, cameras: Sequence[CameraSection], beside: str | None
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
        yield from _exposures(file, content, folder, cameras, beside)
    elif isinstance(records, ControlRecords):
        points = f"{len(records.line):,} point{'s' if len(records.line) != 1 else ''}"
        yield from place_lines(records.states, records.position, points, beside=beside)
    else:
        yield key_line("unit", open_value(_DISTANCE_UNIT))
        yield key_line("sigma", 0.01, "in the unit above; the files do not always state it")


def _image_points(content: Content, records: ImagePointRecords) -> Iterator[str]:
    counts = f"{len(records.line):,} image points in {len(records.image.dictionary):,} images"
    yield comment(f"{counts}: x {value_range(records.xy[:, 0])}, y {value_range(records.xy[:, 1])}")
    meaning = IMAGE_POINT_MEANINGS.get(content.format)
    if meaning is None:
        yield key_line("unit", open_value(_UNIT))
    else:
        yield key_line("unit", meaning.unit, "as defined by the format")


def _exposures(
    file: FoundFile, content: Content, folder: Path, cameras: Sequence[CameraSection], beside: str | None
) -> Iterator[str]:
    records = cast(ExposureRecords, content.records)
    states = records.states
    yield from place_lines(states, records.position, f"{len(records.line):,} exposures", beside=beside)
    adjusted = content.format in ADJUSTED
    if states.position is not None or adjusted:
        yield key_line("position", "projection_centre", "as in the file")
    else:
        yield key_line("position", open_value(POSITION))
    yield from _angles(content, records)
    if content.format in IN_A_MAP:
        yield comment(
            "If that program treated map coordinates as Cartesian, these are not true camera positions. "
            "In this case declare:"
        )
        yield comment(
            'adjusted_in = { world = "map-cartesian", ground_m = 0.0 }, with the height of the ground.'
        )
    table = content.format == TABLE
    rigs = colmap_rig_files(file.path) if content.format == "colmap" and records.heads else None
    if rigs is not None:
        yield key_line("rigs", [one.relative_to(folder).as_posix() for one in rigs])
    if len(cameras) > 1 or table:
        yield from camera_lines(records.camera, cameras)
    if table and "strip" in content.layout.elsewhere:
        yield key_line("strip", open_value(STRIP))


def _angles(content: Content, records: ExposureRecords) -> Iterator[str]:
    states = records.states
    if np.isfinite(records.angles).any():
        ranges = ", ".join(value_range(column) for column in records.angles.T)
        yield comment(f"angles {ranges}")
        heading = content.order if content.order == "heading-pitch-roll" else None
        order: str = heading or states.order or open_value(_ORDER)
        unit = records.declared_angle_unit or open_value(_ANGLE_UNIT)
        reference = states.reference or ("local" if states.crs == LOCAL else open_value(_REFERENCE))
    else:
        yield comment("no angles are given, so none of these keys matters")
        order, unit, reference = "omega-phi-kappa", "deg", "local"
    angles = {"order": order, "unit": unit, "reference": reference}
    if records.rates is not None and np.isfinite(records.rates).any():
        angles["rate_axes"] = open_value(_RATE_AXES)
    yield key_line("angles", angles)


def _adjustment(inputs: Sequence[tuple[FoundFile, Content]]) -> Iterator[str]:
    """A comment on results of another adjustment: they are not observations, and depend on its model."""
    exposures = [content for _, content in inputs if content.kind == "exposures"]
    cameras = [content for _, content in inputs if content.kind == "camera"]
    adjusted = bool(exposures) and all(content.format in ADJUSTED for content in exposures)
    without = bool(cameras) and all(content.format in WITHOUT_REFRACTION for content in cameras)
    if not adjusted and not without:
        return
    yield ""
    yield "[adjustment]"
    if without:
        yield comment("That program does not correct refraction: its focal length and distortion contain it.")
        yield key_line("refraction", "none")
    if not adjusted:
        return
    control = any(content.kind == "control" for _, content in inputs)
    yield comment("The orientations are the result of an adjustment: approximate values, not observations.")
    yield key_line("observe", ["control"] if control else [])
    if not control:
        yield key_line("datum", "free_network", "nothing else fixes the datum: there is no control")


def _crs_beside(file: FoundFile, files: Sequence[FoundFile]) -> str | None:
    """The CRS from a file with the same name and another extension."""
    stem = file.path.with_suffix("")
    return next((one.crs for one in files if one.crs and one.path.with_suffix("") == stem), None)


def _states(content: Content) -> FileStatement:
    records = content.records
    return records.states if isinstance(records, _PLACED) else FileStatement()


def _images(content: Content) -> frozenset[str]:
    """The camera of the exposures in a file."""
    if not isinstance(content.records, ExposureRecords):
        return frozenset()
    return frozenset(str(name) for name in cast(pa.Array, content.records.image).to_pylist())
