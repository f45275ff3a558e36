"""Self-describing blocks of other programs, and a project file that reads them.

| given | recognised by |
|---|---|
| BlocksExchange XML | its root |
| ``sfm_data.json`` of OpenMVG | its version |
| OPF project, packed into a zip file | ``project.opf`` in it |
| folder of COLMAP | ``images`` and ``cameras``, text or binary |
| folder of OpenSfM | ``reconstruction.json`` and ``tracks.csv`` |

What is geographic there gets the UTM zone of its middle.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tasks.errors import Location
from tasks.files.toml_text import TomlValue, toml_text
from tasks.formats.colmap_rigs import colmap_rig_files
from tasks.formats.crs_definition import without_heights
from tasks.formats.plain_records import NothingInFileError
from tasks.formats.records import ExposureRecords, HeadRecord, PixelCamera
from tasks.formats.register import CAMERA_FORMATS, CONTROL_FORMATS, read_exposures
from tasks.formats.rigs import declared_head
from tasks.formats.table_layout import TableLayout
from tasks.settings.coordinates import LOCAL

# Of a file, where its kind shows.
_HEAD = 4_096


@dataclass(frozen=True)
class RecognisedBlock:
    """The files of the parts of a block, and what the format states about them.

    Attributes
    ----------
    format : of the readers.
    exposures, cameras, image_points : files.
    unit, pixel_origin : of its image points.
    image_names : table of names that the format has cut; None: there is none.
    rigs : files of the rigs and frames of COLMAP; None: there are none.
    """

    format: str
    exposures: Path
    cameras: Path
    image_points: Path
    unit: str = "px"
    pixel_origin: str = "corner"
    image_names: Path | None = None
    rigs: tuple[Path, Path] | None = None


def recognised(given: Path) -> RecognisedBlock | None:
    """The block of another program in a file or folder; None: it is not recognised.

    Raises
    ------
    InputError
        If it is a folder of no program that is recognised.
    """
    if given.is_dir():
        found = _folder(given)
        if found is None:
            raise Location(given).error(
                "The folder is not a block of COLMAP or OpenSfM.",
                "Name a project file, or pack a project of OPF into one zip file.",
            )
        return found
    if not given.is_file():
        return None
    if zipfile.is_zipfile(given):
        with zipfile.ZipFile(given) as packed:
            is_opf = any(name.endswith("project.opf") for name in packed.namelist())
        return RecognisedBlock("opf", given, given, given) if is_opf else None
    with given.open("rb") as stream:
        head = stream.read(_HEAD)
    if b"<BlocksExchange" in head:
        return RecognisedBlock("blocks-exchange", given, given, given, pixel_origin="centre")
    if b'"sfm_data_version"' in head:
        return RecognisedBlock("openmvg", given, given, given)
    return None


def _folder(folder: Path) -> RecognisedBlock | None:
    for ending in ("txt", "bin"):
        images, cameras = (folder / f"{name}.{ending}" for name in ("images", "cameras"))
        if images.is_file() and cameras.is_file():
            names = folder / "images.csv"
            return RecognisedBlock(
                "colmap",
                images,
                cameras,
                images,
                image_names=names if names.is_file() else None,
                rigs=colmap_rig_files(images),
            )
    found, tracks = folder / "reconstruction.json", folder / "tracks.csv"
    if found.is_file() and tracks.is_file():
        return RecognisedBlock("opensfm", found, found, tracks, unit="longer-side")
    return None


def project_text(block: RecognisedBlock, name: str, pixel_um: float | None) -> str:
    """The project file that reads a recognised block.

    Parameters
    ----------
    name : of the project.
    pixel_um : side of a pixel; needed where the block knows pixels only.

    Raises
    ------
    InputError
        If a file of it cannot be read, or the size of a pixel is missing.
    """
    exposures = read_exposures(block.format, block.exposures, "omega-phi-kappa", TableLayout(), block.rigs)
    crs = _horizontal(exposures.states.crs) or LOCAL
    place: dict[str, TomlValue] = {"crs": crs} if crs == LOCAL else {"crs": crs, "heights": "ellipsoidal"}
    content: dict[str, TomlValue] = {
        "version": 1,
        "project": {**place, "name": name, "crs": _crs_of_results(exposures, crs)},
        "cameras": _cameras(block, pixel_um, exposures.heads),
        "inputs": {
            "image_points": {
                "file": str(block.image_points.absolute()),
                "format": block.format,
                "unit": block.unit,
                **_names(block),
            },
            "exposures": {
                "file": str(block.exposures.absolute()),
                "format": block.format,
                **place,
                "position": "projection_centre",
                "angles": {
                    "order": exposures.states.order or "omega-phi-kappa",
                    "unit": "deg",
                    "reference": exposures.states.reference or "grid",
                },
                **_names(block),
                **_rigs(block, exposures.heads),
            },
            **_control(block, place),
        },
    }
    return toml_text(content)


def _names(block: RecognisedBlock) -> Mapping[str, TomlValue]:
    return {} if block.image_names is None else {"image_names": str(block.image_names.absolute())}


def _rigs(block: RecognisedBlock, heads: Mapping[str, HeadRecord]) -> Mapping[str, TomlValue]:
    used = block.rigs if block.rigs is not None and heads else ()
    return {"rigs": [str(file.absolute()) for file in used]} if used else {}


def _horizontal(stated: str | None) -> str | None:
    """A stated CRS as a project file may have it; that its heights are others than declared is a remark."""
    return stated if stated in (None, LOCAL) else without_heights(str(stated))


def _crs_of_results(exposures: ExposureRecords, crs: str) -> str:
    """The CRS of the file; of a geographic one the UTM zone of its middle."""
    if not crs.startswith("+proj=longlat"):
        return crs
    longitude, latitude, _ = np.nanmean(exposures.position, axis=0)
    zone = min(int((longitude + 180.0) // 6.0) + 1, 60)
    return f"EPSG:{(32600 if latitude >= 0.0 else 32700) + zone}"


def _cameras(
    block: RecognisedBlock, pixel_um: float | None, heads: Mapping[str, HeadRecord]
) -> dict[str, TomlValue]:
    found: dict[str, TomlValue] = {}
    for name, camera in CAMERA_FORMATS[block.format](block.cameras).items():
        in_pixels = isinstance(camera, PixelCamera)
        if in_pixels and pixel_um is None:
            raise Location(block.cameras, entity=f"camera {name}").error(
                "The block is in pixels, but does not contain the pixel size.",
                "Give the pixel size in micrometres, e.g. --pixel-um 4.",
            )
        found[name] = {
            "file": str(block.cameras.absolute()),
            "format": block.format,
            "name_in_file": name,
            "pixel_origin": block.pixel_origin,
            "mount_deg": 0,
            **({"pixel_um": float(pixel_um)} if in_pixels and pixel_um is not None else {}),
            **({"head": {**declared_head(heads[name])}} if name in heads else {}),
        }
    return found


def _control(block: RecognisedBlock, place: Mapping[str, TomlValue]) -> dict[str, TomlValue]:
    """The surveyed points, where the format and the file have any."""
    reader = CONTROL_FORMATS.get(block.format)
    if reader is None:
        return {}
    try:
        found = reader(block.exposures)
    except NothingInFileError:
        return {}
    stated = _horizontal(found.states.crs)
    own = place if stated is None or stated == place["crs"] else {"crs": stated, "heights": "ellipsoidal"}
    return {"control": {"file": str(block.exposures.absolute()), "format": block.format, **own}}
