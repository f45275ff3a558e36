"""Files that no reader reads: parts of a delivery, results that are recomputed, and notes.

A file with the mark of a format that is read, which its reader refuses, has the reader's reason.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from tasks.errors import InputError
from tasks.files.json_text import from_json
from tasks.formats.colmap_rigs import colmap_rig_files
from tasks.formats.crs_definition import known_crs
from tasks.formats.register import CAMERA_FORMATS, read_exposures
from tasks.formats.table_layout import TableLayout
from tasks.formats.text_table import read_bytes
from tasks.plain_text import quoted, some_of

_OPF = re.compile(r"application/opf-([a-z-]+)\+json")
_PACK = "give the folder of the project as one zip file"
_OPF_PARTS = {
    "translation", "rotation", "rotation_angles_deg", "definition", "geoid_height", "crs", "coordinates",
    "sigmas",
}  # fmt: skip
# Above this, a document of others is not looked into.
_LARGEST_JSON = 5_000_000
#: Marks of formats at the beginning of a file, and the reader whose reason to refuse it is said.
_MARKS: tuple[tuple[re.Pattern[bytes], Callable[[Path], object]], ...] = (
    (re.compile(rb"SQLite format 3\0"), CAMERA_FORMATS["colmap-database"]),
    (re.compile(rb"\s*# (?:Camera|Sensor) list with one line of data per camera"), CAMERA_FORMATS["colmap"]),
    (re.compile(rb"\s*sensor\s*:(?=[\s\S]*focal_length\s*:)"), CAMERA_FORMATS["ossim"]),
    (
        re.compile(rb"\s*# Image list with two lines of data per image"),
        lambda path: read_exposures("colmap", path, "omega-phi-kappa", TableLayout(), colmap_rig_files(path)),
    ),
)
_INSTANCES = "instances of OpenSfM's rigs: they are read with reconstruction.json"
_RIGS = "rigs or frames of COLMAP: they are read with its images"
#: Words at the beginning of a text, and what it is.
_TEXTS: tuple[tuple[re.Pattern[bytes], str], ...] = (
    (
        re.compile(rb"\s*# 3D point list with one line of data per point"),
        "object points of COLMAP: they are computed again from the image points",
    ),
    (re.compile(rb"\s*# (?:Rig calib|Frame) list with one line"), _RIGS),
    (re.compile(rb"(?:\w+: .*\n)*LINE_OFF: "), "rational polynomials of an image: not read"),
    (re.compile(rb"(?:#.*\n)*\s*\w+: .*(?:\n.*)*bundle_\w+:"), "settings of OpenSfM: not a delivery"),
)
_CRS = re.compile(r"\s*(?:\+proj=|(?:PROJ|GEOG|GEOD|BOUND|COMPOUND|COMPD)(?:CRS|CS)\[)", re.IGNORECASE)
_FOCAL, _PIXEL = re.compile(r"focal", re.IGNORECASE), re.compile(r"pixel|pitch|px", re.IGNORECASE)
_TITLES = re.compile(r"[\w\s\"'#%()./-]+(?:[,;\t|][\w\s\"'#%()./-]*)+")
_NOTES = {"readme", "license", "licence", "copying", "notice", "changelog", "handover"}
_LONGEST_LINE, _MOST_HEADINGS = 2_000, 12
_POINTS, _RIG_FILES = "points3d.bin", ("rigs.bin", "frames.bin")


def crs_of_file(beginning: bytes) -> str | None:
    """The CRS of a file ``.prj`` as a project file takes it: its EPSG code, or the text itself."""
    text = beginning.decode("utf-8-sig", errors="replace").strip()
    if not _CRS.match(text):
        return None
    try:
        crs = known_crs(text)
    except InputError:
        return None
    code = crs.to_epsg()
    return text if code is None else f"EPSG:{code}"


def known_as(path: Path, beginning: bytes) -> str | None:
    """The kind of a file that no reader reads; None if unknown."""
    for mark, reader in _MARKS:
        if mark.match(beginning):
            return _reason(path, reader)
    if beginning.startswith(b"PAR1"):
        return _parquet(path)
    if beginning.lstrip()[:1] in (b"{", b"["):
        return _json(path)
    if path.name.lower() in _RIG_FILES:
        return _RIGS
    if path.name.lower() == _POINTS:
        return "object points of COLMAP: they are computed again from the image points"
    if b"\0" in beginning:
        return _buffer(path)
    known = next((said for words, said in _TEXTS if words.match(beginning)), None)
    if known is None and path.name.lower().partition(".")[0] in _NOTES:
        return "a note"
    return known or _table(beginning)


def _reason(path: Path, reader: Callable[[Path], object]) -> str | None:
    try:
        reader(path)
    except InputError as error:
        entity = f"{error.entity}: " if error.entity else ""
        line = f"line {error.line}: " if error.line else ""
        return f"{line}{entity}{error.what} {error.remedy}"
    return None


def _parquet(path: Path) -> str | None:
    try:
        with pq.ParquetFile(path) as file:
            rows, metadata = file.metadata.num_rows, file.schema_arrow.metadata or {}
        geo = from_json(metadata.get(b"geo", b"{}"))
    except (pa.ArrowException, OSError, ValueError):
        return None
    columns = geo.get("columns", {}) if isinstance(geo, dict) else {}
    kinds = [one.get("geometry_types", []) for one in columns.values() if isinstance(one, dict)]
    named = ", ".join(str(kind) for some in kinds for kind in some)
    geometry = f"GeoParquet with {named}" if columns else "Parquet"
    return (
        f"{geometry}, {rows:,} rows: a map layer; orientations, points, cameras are read from tables of text"
    )


def _json(path: Path) -> str | None:
    try:
        content = read_bytes(path, "document")
        value = from_json(content) if len(content) <= _LARGEST_JSON else None
    except (InputError, ValueError):
        return None
    if isinstance(value, list):
        return _list(value)
    return _object(value) if isinstance(value, dict) else None


def _list(value: list[object]) -> str | None:
    first = value[0] if value else None
    if isinstance(first, dict) and "ref_camera_id" in first:
        return "rigs of COLMAP's rig_configurator, of an early kind: it names no relative orientations"
    return _INSTANCES if _is_instance(first) else None


def _is_instance(value: object) -> bool:
    """Whether it is a list of images with their rig cameras."""
    return isinstance(value, list) and bool(value) and all(isinstance(one, list) for one in value)


def _object(value: Mapping[str, object]) -> str | None:
    """An object by its keys, the most telling first."""
    opf = _OPF.fullmatch(str(value.get("format", "")))
    if opf:
        return f"a part of an OPF project ({opf[1].replace('-', ' ')}): {_PACK}"
    if "asset" in value and "meshes" in value:
        tracks = "OPF_mesh_primitive_matches" in json.dumps(value.get("extensionsUsed", []))
        return f"tie points of an OPF project (glTF): {_PACK}" if tracks else "a glTF model: not a delivery"
    if "$schema" in value and "definitions" in value:
        return "a JSON schema: not a delivery"
    if "geo" in value:
        return "the description of a GeoParquet file: not a delivery"
    if {"type", "resources"} <= value.keys() or value.keys() <= _OPF_PARTS:
        return f"a fragment of an OPF project: {_PACK}"
    if value and all(map(_is_instance, value.values())):
        return _INSTANCES
    rigs = value and all(
        isinstance(one, dict) and {"rotation", "translation"} <= one.keys() for one in value.values()
    )
    return "cameras of OpenSfM's rigs: they are read with reconstruction.json" if rigs else None


def _buffer(path: Path) -> str | None:
    """The buffer of a glTF file next to it."""
    for other in sorted(path.parent.glob("*.gltf")):
        try:
            named = path.name.encode() in read_bytes(other, "document")
        except InputError:
            continue
        if named:
            return f"values of {quoted(other.name)} (glTF of an OPF project): {_PACK}"
    return None


def _table(beginning: bytes) -> str | None:
    """A table with unknown headings only, which are listed."""
    line = beginning.split(b"\n", 1)[0].decode("utf-8-sig", errors="replace").strip()
    if len(line) > _LONGEST_LINE or not _TITLES.fullmatch(line):
        return None
    fields = [field.strip(" \"'#") for field in re.split(r"[,;\t|]", line)]
    if len(fields) < 3 or any(re.fullmatch(r"[-+.\d]*", field) for field in fields):
        return None
    shown = some_of(fields, _MOST_HEADINGS)
    if any(map(_FOCAL.search, fields)) and any(map(_PIXEL.search, fields)):
        return (
            f'a table of cameras ({shown}): [cameras.NAME] reads it with format = "csv" and table = {{ '
            "columns = { … } }, which says what columns and rows of the image are called"
        )
    return f"a table, of whose columns too few are known ({shown})"
