"""Records of values that were read one by one: names that can be read, numbers that are numbers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from adjust.arrays import Bools, Floats
from adjust.geometry.rotation import to_omega_phi_kappa
from tasks.errors import InputError, Location
from tasks.files.delivered_file import file_limits
from tasks.formats.records import (
    ControlRecords,
    DistanceRecords,
    ExposureRecords,
    FileStatement,
    ImagePointRecords,
)
from tasks.formats.text_table import first_trouble
from tasks.magnitude import HUGE
from tasks.plain_text import quoted, trouble_in

# Elements of a rotation that were printed with four decimals and more.
_ROTATION_TOLERANCE = 1e-3
_TOGETHER = 20_000
_REMEDY = "Give a name of ordinary characters, 255 at most."
#: From camera axes x right, y down, z forward of computer vision to ours, x right, y up, z back, and back.
CV_AXES = np.diag([1.0, -1.0, -1.0])
LOCAL = FileStatement(crs="local", order="omega-phi-kappa")


def exposures_of(
    path: Path,
    image: Sequence[str],
    position: Sequence[Sequence[float]] | Floats,
    angles: Sequence[Sequence[float]] | Floats | None,
    line: Sequence[int],
    *,
    camera: Sequence[str | None] | None = None,
    strip: Sequence[str | None] | None = None,
    time_s: Sequence[float] | None = None,
    sigma_position: Sequence[Sequence[float]] | Floats | None = None,
    sigma_angles: Sequence[Sequence[float]] | Floats | None = None,
    unit: Literal["deg", "gon", "rad"] | None = None,
    states: FileStatement | None = None,
    remarks: tuple[str, ...] = (),
    solution: Sequence[str | None] | None = None,
) -> ExposureRecords:
    """Exposures; positions and angles (n, 3), NaN where an image has none; angles None: no image has any.

    Raises
    ------
    InputError
        If there are none, or a name or number cannot be.
    """
    count = len(image)
    _refuse_none(path, count, "exposure")
    names = _names(path, image, line)
    nothing = np.full((count, 3), np.nan)
    return ExposureRecords(
        file=path,
        image=names,
        camera=_names(path, [None] * count if camera is None else camera, line),
        strip=_names(path, [None] * count if strip is None else strip, line),
        flight=pa.nulls(count, pa.string()),
        time_s=nothing[:, 0] if time_s is None else _numbers(path, time_s, image, line),
        position=_numbers(path, position, image, line),
        angles=nothing if angles is None else _numbers(path, angles, image, line),
        sigma_position=nothing if sigma_position is None else _numbers(path, sigma_position, image, line),
        sigma_angles=nothing if sigma_angles is None else _numbers(path, sigma_angles, image, line),
        line=np.asarray(line, dtype=np.int64),
        declared_angle_unit=unit,
        states=states or FileStatement(),
        remarks=remarks,
        solution=None if solution is None else pa.array(solution, pa.string()),
    )


def image_points_of(
    path: Path,
    image: Sequence[str] | pa.DictionaryArray,
    point: Sequence[str] | pa.DictionaryArray,
    xy: Sequence[Sequence[float]] | Floats,
    line: Sequence[int] | NDArray[np.int64],
    sigma: Floats | None = None,
) -> ImagePointRecords:
    """Image points (n,) with coordinates (n, 2); names as they are, or each kept once.

    Raises
    ------
    InputError
        If there are none, or a name or number cannot be.
    """
    _refuse_none(path, len(image), "image point")
    file_limits().require_rows(path, len(image))
    return ImagePointRecords(
        file=path,
        image=_kept_once(path, image, line),
        point=_kept_once(path, point, line),
        xy=_numbers(path, xy, point, line),
        sigma=np.broadcast_to(np.nan, (len(image), 2)) if sigma is None else sigma,
        line=np.asarray(line, dtype=np.int64),
    )


def names_of_numbers(numbers: NDArray[np.integer[Any]]) -> pa.DictionaryArray:
    """Numbers (n,) as names, each kept once."""
    encoded = pa.array(numbers).dictionary_encode()
    return pa.DictionaryArray.from_arrays(encoded.indices, encoded.dictionary.cast(pa.string()))


class NothingInFileError(InputError):
    """A file that can hold several kinds of data has none of this kind."""


def control_of(
    path: Path,
    point: Sequence[str],
    position: Sequence[Sequence[float]] | Floats,
    line: Sequence[int],
    *,
    role: Sequence[str | None] | None = None,
    sigma: Sequence[Sequence[float]] | Floats | None = None,
    states: FileStatement | None = None,
    remarks: tuple[str, ...] = (),
) -> ControlRecords:
    """Control points with coordinates (n, 3), NaN where one is not known.

    Raises
    ------
    InputError
        If there are none, or a name or number cannot be.
    """
    count = len(point)
    _refuse_none(path, count, "control point")
    return ControlRecords(
        file=path,
        point=_names(path, point, line),
        position=_numbers(path, position, point, line),
        sigma=np.full((count, 3), np.nan) if sigma is None else _numbers(path, sigma, point, line),
        role=pa.array([None] * count if role is None else role, pa.string()),
        line=np.asarray(line, dtype=np.int64),
        states=states or FileStatement(),
        remarks=remarks,
    )


def distances_of(
    path: Path, point: Sequence[str], other_point: Sequence[str], distance: Floats, sigma: Floats
) -> DistanceRecords:
    """Distances (n,) between object points, in the order of the file.

    Raises
    ------
    InputError
        If there are none, or a name or number cannot be.
    """
    count = len(point)
    _refuse_none(path, count, "distance")
    line = np.arange(1, count + 1)
    return DistanceRecords(
        file=path,
        point=_names(path, point, line),
        other_point=_names(path, other_point, line),
        distance=_numbers(path, distance, point, line),
        sigma=_numbers(path, sigma, point, line),
        role=pa.nulls(count, pa.string()),
        line=line,
    )


def degrees_of_rotations(path: Path, rotation: Floats, image: Sequence[str], line: Sequence[int]) -> Floats:
    """ω, φ, κ (n, 3) in degrees of rotations ground from camera (n, 3, 3); NaN where one is not given.

    Raises
    ------
    InputError
        If one is not a rotation.
    """
    rotation = np.asarray(rotation, dtype=np.float64).reshape(-1, 3, 3)
    result = np.empty((len(rotation), 3))
    for piece in pieces_of(len(rotation)):
        result[piece] = _degrees(path, rotation[piece], image[piece], line[piece])
    return result


def pieces_of(count: int) -> list[slice]:
    """Rows that are computed together, so that intermediate results take little memory."""
    return [slice(begin, begin + _TOGETHER) for begin in range(0, count, _TOGETHER)]


def _degrees(path: Path, rotation: Floats, image: Sequence[str], line: Sequence[int]) -> Floats:
    given: Bools = np.asarray(np.isfinite(rotation).all(axis=(1, 2)))
    bounded = np.where(given[:, None, None] & (np.abs(rotation) < 2.0), rotation, 0.0)
    away = np.abs(bounded @ np.swapaxes(bounded, 1, 2) - np.eye(3)).max(axis=(1, 2))
    bad = given & ((away > _ROTATION_TOLERANCE) | (np.linalg.det(bounded) < 0.0))
    if bad.any():
        row = int(np.argmax(bad))
        raise Location(path, int(line[row]), str(image[row])).error(
            "The nine numbers are not a rotation: rows are not perpendicular, not of length 1, or mirrored.",
            "Deliver the file again; a digit may be missing.",
        )
    result = np.full((len(rotation), 3), np.nan)
    # The nearest rotation: the digits of a file leave it perpendicular to their rounding only.
    u, _, vt = np.linalg.svd(bounded[given])
    result[given] = np.degrees(to_omega_phi_kappa(u @ vt))
    return result


def number_of(path: Path, text: str, line: int, what: str) -> float:
    """A number of a file.

    Raises
    ------
    InputError
        If the text is none.
    """
    try:
        # Python takes 1_000 for a number, no other program does.
        value = np.nan if "_" in text else float(text)
    except ValueError:
        value = np.nan
    if not abs(value) <= HUGE:
        remedy = "Correct it." if "," not in text else "Write it with a decimal point."
        raise Location(path, line).error(f"{quoted(text)} is not a number, but should be {what}.", remedy)
    return float(value)


def numbers_of(path: Path, texts: Sequence[str], count: int, line: int, what: str) -> list[float]:
    """The first numbers of a line.

    Raises
    ------
    InputError
        If there are fewer, or one is not a number.
    """
    if len(texts) < count:
        raise Location(path, line).error(
            f"There are {len(texts)} fields here, but {count} are required: {what}.",
            "The file may have been cut off: deliver it again.",
        )
    wanted = texts[:count]
    try:
        found = list(map(float, wanted))
    except ValueError:
        found = []
    # All at once, as nearly all are numbers; one by one to say which is none.
    if sum(map(abs, found)) <= HUGE and len(found) == count and "_" not in "".join(wanted):
        return found
    return [number_of(path, text, line, what) for text in wanted]


def _refuse_none(path: Path, count: int, what: str) -> None:
    if count == 0:
        raise NothingInFileError(
            f"There is no {what} in the file.", "Check that it is the intended file and format.", path
        )


def _kept_once(
    path: Path, names: Sequence[str] | pa.DictionaryArray, line: Sequence[int] | NDArray[np.int64]
) -> pa.DictionaryArray:
    if not isinstance(names, pa.DictionaryArray):
        return _names(path, names, line).dictionary_encode()
    import pyarrow.compute as pc

    empty = pc.index(names.dictionary, "").as_py()
    found = first_trouble(names.dictionary) if empty < 0 else (empty, _trouble(""))
    if found is not None:
        row = pc.index(names.indices, found[0]).as_py()
        raise Location(path, int(line[row])).error(found[1] or "", _REMEDY)
    return names


def _trouble(name: str) -> str | None:
    return trouble_in(name) if name else "A name is empty."


def _names(path: Path, names: Sequence[str | None], line: Sequence[int] | NDArray[np.int64]) -> pa.Array:
    known: set[str] = set()
    for row, name in enumerate(names):
        if name is None or name in known:
            continue
        known.add(name)
        trouble = _trouble(name)
        if trouble is not None:
            raise Location(path, int(line[row])).error(trouble, _REMEDY)
    return pa.array(names, pa.string())


def _numbers(
    path: Path,
    values: Sequence[object] | Floats,
    names: Sequence[str] | pa.DictionaryArray,
    line: Sequence[int] | NDArray[np.int64],
) -> Floats:
    found = np.asarray(values, dtype=np.float64)
    bad: Bools = np.asarray(np.abs(found.reshape(len(found), -1)) > HUGE)
    if bad.any():
        row = int(np.argmax(bad.any(axis=1)))
        raise Location(path, int(line[row]), str(names[row])).error(
            "A number here is too large for any quantity.", "Correct it."
        )
    return found
