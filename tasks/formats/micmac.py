"""MicMac (version 1): orientations, calibrations, measurements and ground points.

| what | delivered as | read |
|---|---|---|
| ``Ori-*/Orientation-IMAGE.xml`` | the folder as one zip file | centre and ``CodageMatr`` (ground from camera, x right, y down, z forward); local |
| ``AutoCal*.xml`` | the folder, or the one file | focal length, principal point, radial distortion with decentring (``ModRad``, ``ModPhgrStd``) |
| ``Homol*/Pastis*/*.txt`` | the folder as one zip file | homologous points, joined to tie points; see ``homologous_points`` |
| ``SetOfMesureAppuisFlottants`` | the one file | measurements of ground points, px |
| ``DicoAppuisFlottant`` | the one file | ground points; an uncertainty that is not positive means an unknown coordinate |

Where pixels count from is not published; they are taken from the corner (pixel_origin = "corner"). Distortion leads from the ideal
to the measured point, although the convention is named ``DistM2C``: so do the checks ``Verif`` that the program writes into orientations
(seven published files, ``ModRad`` and ``ModPhgrStd`` with all its terms, to 1e-9 px). It is refitted as ``brown-forward``; a fit that
misses it by more than 0.1 px is refused.
"""  # noqa: E501

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path, PurePosixPath

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.conversion import fitted
from adjust.camera.additional.register import additional_parameters
from adjust.errors import AdditionalParametersError
from tasks.errors import InputError, Location
from tasks.formats.homologous_points import homologous_points
from tasks.formats.long_columns import LongRows
from tasks.formats.named_entries import take_camera
from tasks.formats.packed_folder import PackedFolder, is_packed, packed_folder
from tasks.formats.plain_records import (
    CV_AXES,
    LOCAL,
    image_points_of,
    numbers_of,
)
from tasks.formats.records import (
    AngleOrder,
    ControlRecords,
    ExposureRecords,
    ImagePointRecords,
    PixelCamera,
)
from tasks.formats.text_table import read_bytes
from tasks.formats.xml_text import parsed_xml_content

_HEAD, _TAIL = "Orientation-", ".xml"
_CALIBRATION = "CalibrationInternConique"
_WANTED = ("k1", "k2", "k3", "k4", "p1", "p2", "b1", "b2")
_POINTS_ACROSS = 31
# Metres for a pixel: coefficients have no unit, but the fit looks for lengths of a camera.
_PIXEL = 5e-6
_MOST_MISSED_PX = 0.1
# Steps from a measured to its ideal point: each leaves some per cent of what is missing.
_STEPS = 50


def read_micmac_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read the orientations of a packed folder ``Ori-*``.

    Raises
    ------
    InputError
        If there are none, or one is not complete.
    """
    folder = packed_folder(path)
    images = LongRows("position", "rotation")
    for name in folder.members:
        file = PurePosixPath(name).name
        if not (file.startswith(_HEAD) and file.endswith(_TAIL)):
            continue
        outside = _element(path, _parsed(folder, name), "Externe", name)
        matrix = _element(path, outside, "CodageMatr", name)
        centre = _numbers(path, outside, "Centre", 3, name)
        rotation = [value for row in ("L1", "L2", "L3") for value in _numbers(path, matrix, row, 3, name)]
        images.append(file[len(_HEAD) : -len(_TAIL)], centre, rotation)
    return images.exposures(path, LOCAL, rotation=images["rotation"] @ CV_AXES)


def read_micmac_cameras(path: Path) -> Mapping[str, PixelCamera]:
    """Read calibrations by the names of their files, without the ending.

    Raises
    ------
    InputError
        If there is none, or its distortion is of another model.
    """
    content = read_bytes(path, "document")
    if is_packed(content):
        folder = packed_folder(path, content)
        roots = [
            (PurePosixPath(name).stem, _parsed(folder, name))
            for name in folder.members
            if name.endswith(_TAIL) and not PurePosixPath(name).name.startswith(_HEAD)
        ]
    else:
        roots = [(path.stem, parsed_xml_content(path, content))]
    found: dict[str, PixelCamera] = {}
    for name, root in roots:
        element = root if root.tag == _CALIBRATION else root.find(f".//{_CALIBRATION}")
        if element is not None:
            take_camera(path, found, name, _camera(path, element, name))
    if not found:
        raise Location(path).error(f"There is no <{_CALIBRATION}>.", "Deliver the calibration, AutoCal….xml.")
    return found


def read_micmac_image_points(path: Path) -> ImagePointRecords:
    """Read homologous points of a packed folder, or measurements of ground points of a file.

    Raises
    ------
    InputError
        If there are none, or a line is not complete.
    """
    content = read_bytes(path)
    if is_packed(content):
        folder = packed_folder(path, content)
        # It has the content, and lets it go when all is read.
        del content
        return homologous_points(folder)
    image, point, xy = [], [], []
    for one in parsed_xml_content(path, content).iter("MesureAppuiFlottant1Im"):
        for measured in one.iter("OneMesureAF1I"):
            image.append((one.findtext("NameIm") or "").strip())
            point.append((measured.findtext("NamePt") or "").strip())
            xy.append(_numbers(path, measured, "PtIm", 2, image[-1]))
    return image_points_of(path, image, point, xy, range(1, len(image) + 1))


def read_micmac_control(path: Path) -> ControlRecords:
    """Read ground points.

    Raises
    ------
    InputError
        If there are none, or one is not complete.
    """
    points = LongRows("position", "sigma")
    for one in parsed_xml_content(path, read_bytes(path, "document")).iter("OneAppuisDAF"):
        name = (one.findtext("NamePt") or "").strip()
        place = np.array(_numbers(path, one, "Pt", 3, name))
        given = np.ones(3)
        if one.find("Incertitude") is not None:
            given = np.array(_numbers(path, one, "Incertitude", 3, name))
        # Their 1 1 1 is what the program writes where nothing was said.
        unsaid = bool((given == 1.0).all()) | (given <= 0.0)
        points.append(name, np.where(given > 0.0, place, np.nan), np.where(unsaid, np.nan, given))
    return points.control(path)


def _camera(path: Path, element: ElementTree.Element, name: str) -> PixelCamera:
    if (element.findtext("KnownConv") or "").strip() not in ("eConvApero_DistM2C", ""):
        raise Location(path).error(
            "The calibration is not of the convention eConvApero_DistM2C.", "Leave it out."
        )
    if element.find("OrIntGlob") is not None:
        raise Location(path, entity=name).error(
            "The calibration is not in pixels (<OrIntGlob>).", "Convert it in MicMac (ConvertCalib)."
        )
    columns, rows = (int(value) for value in _numbers(path, element, "SzIm", 2, name))
    (c,) = _numbers(path, element, "F", 1, name)
    column, row = _numbers(path, element, "PP", 2, name)
    if not (0 < columns < 10**6 and 0 < rows < 10**6 and 0.0 < c < 1e9):
        raise Location(path, entity=name).error("A focal length or size is not positive.", "Correct it.")
    steps = [np.linspace(0.0, size, _POINTS_ACROSS) for size in (columns, rows)]
    measured = np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 2)
    ideal = _ideal(path, element, measured, name)
    down = np.array([1.0, -1.0])
    known = _as_brown(path, (measured - [column, row]) * down, (ideal - [column, row]) * down, c, name)
    return PixelCamera(columns, rows, c, (column - 0.5 * columns, 0.5 * rows - row), known)


def _ideal(path: Path, element: ElementTree.Element, measured: Floats, name: str) -> Floats:
    """Ideal points (n, 2) of measured ones, pixels, y down; NaN where the distortion has none."""
    distortions = element.findall("CalibDistortion")
    if len(distortions) > 1:
        raise Location(path, entity=name).error(
            f"The calibration has {len(distortions)} distortions, one after the other.",
            "Convert it in MicMac (ConvertCalib), or declare the camera in the project file.",
        )
    ideal = measured
    for distortion in distortions:
        bent = _distortion(path, distortion, name)
        with np.errstate(over="ignore", invalid="ignore"):
            for _ in range(_STEPS):
                ideal = measured - bent(ideal)
            missed = np.abs(ideal + bent(ideal) - measured).max(axis=1)
        ideal = np.where(missed[:, None] < 0.1 * _MOST_MISSED_PX, ideal, np.nan)
    return ideal


def _distortion(path: Path, distortion: ElementTree.Element, name: str) -> Callable[[Floats], Floats]:
    """Measured − ideal (n, 2) of ideal points, pixels, y down."""
    models = {child.tag: child for child in distortion if child.tag.startswith("Mod")}
    if list(models) == ["ModNoDist"]:
        return np.zeros_like
    whole = models.get("ModPhgrStd")
    radial = models.get("ModRad") if whole is None else whole.find("RadialePart")
    if len(models) != 1 or radial is None:
        raise Location(path, entity=name).error(
            f"The distortion is {', '.join(models) or 'missing'}; ModRad and ModPhgrStd are read.",
            "Convert the calibration in MicMac (ConvertCalib), or declare the camera in the project file.",
        )
    centre = _numbers(path, radial, "CDist", 2, name)
    words = [(item.text or "").strip() for item in radial.findall("CoeffDist")]
    factors = numbers_of(path, words, len(words), 1, "CoeffDist")
    p1, p2, b1, b2 = (
        0.0 if whole is None or whole.find(key) is None else _numbers(path, whole, key, 1, name)[0]
        for key in ("P1", "P2", "b1", "b2")
    )

    def bent(ideal: Floats) -> Floats:
        x, y = (ideal - centre).T
        square = x * x + y * y
        factor = sum((one * square**power for power, one in enumerate(factors, start=1)), np.zeros_like(x))
        across = p1 * (square + 2.0 * x * x) + p2 * 2.0 * x * y + b1 * x + b2 * y
        along = p2 * (square + 2.0 * y * y) + p1 * 2.0 * x * y
        return np.column_stack([x * factor + across, y * factor + along])

    return bent


def _as_brown(path: Path, measured: Floats, ideal: Floats, c: float, name: str) -> dict[str, float]:
    """Values of ``brown-forward`` of the same image; points in pixels from the principal point, y up."""
    if np.array_equal(measured, ideal):
        return {}
    half = np.abs(measured).max(axis=0) * _PIXEL
    image_format = ImageFormat(float(half[0]), float(half[1]), focal_length=c * _PIXEL)
    wanted = additional_parameters("+".join(f"brown-forward:{term}" for term in _WANTED), image_format)
    missed = np.inf
    if np.isfinite(ideal).all() and np.abs(ideal - measured).max() < 0.5 * np.abs(measured).max():
        try:
            found = fitted(wanted, measured * _PIXEL, ideal * _PIXEL)
            missed = found.largest / _PIXEL
        except (AdditionalParametersError, np.linalg.LinAlgError):
            pass
    if not missed <= _MOST_MISSED_PX:
        raise Location(path, entity=name).error(
            "The distortion cannot be expressed by Brown's model within a tenth of a pixel.",
            "Check the calibration, or give corrected images.",
        )
    return dict(zip(wanted.names, found.values.tolist(), strict=True))


def _parsed(folder: PackedFolder, name: str) -> ElementTree.Element:
    return parsed_xml_content(folder.file, folder.read(name), name)


def _element(path: Path, root: ElementTree.Element, tag: str, entity: str) -> ElementTree.Element:
    found = next(_all(root, tag), None)
    if found is None:
        raise Location(path, entity=entity).error(
            f"There is no <{tag}>.", "Export the orientation with matrices."
        )
    return found


def _all(root: ElementTree.Element, tag: str) -> Iterator[ElementTree.Element]:
    yield from root.iter(tag)


def _numbers(path: Path, parent: ElementTree.Element, tag: str, count: int, entity: str) -> list[float]:
    words = (parent.findtext(tag) or "").split()
    try:
        return numbers_of(path, words, count, 1, f"<{tag}>")
    except InputError as error:
        raise Location(path, entity=entity).error(error.what, error.remedy) from error
