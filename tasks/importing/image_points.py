"""Image points of all input files in millimetres of the image system.

Fast for millions of rows: names become numbers once, everything after that is arithmetic on arrays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray

from adjust.arrays import Floats
from adjust.camera.interior import FrameCamera
from tasks.errors import InputError
from tasks.formats.records import ImagePointRecords
from tasks.formats.register import IMAGE_POINT_FORMATS
from tasks.importing.cameras import frame_cameras
from tasks.importing.extra_columns import about_extra, joined
from tasks.importing.image_point_units import in_millimetres, refuse_wrong_unit
from tasks.importing.source_rows import Places, refuse_sigmas
from tasks.nearest_name import did_you_mean
from tasks.settings.inputs import IMAGE_POINT_SIGMA_PX, ImagePointsInput
from tasks.storage.notes import Notes

Codes = NDArray[np.int64]
_EXAMPLES = 3


@dataclass(frozen=True, slots=True, eq=False)
class _Converted:
    """One input in millimetres, with the number of the exposure of each row."""

    records: ImagePointRecords
    exposure: Codes
    xy_mm: Floats
    sigma_mm: Floats
    problems: tuple[str, ...]


def usable_image_points(
    sources: Sequence[ImagePointsInput],
    exposures: pd.DataFrame,
    cameras: pd.DataFrame,
    surveyed: Sequence[str] | None = None,
    orient_without_exposure: bool = False,
) -> tuple[Mapping[str, Any], Mapping[str, pa.Array], Notes]:
    """Columns of ``image_points.parquet``, further columns of the files, and notes.

    Points seen in one image only are dropped, counted and said, except those in `surveyed`.

    Raises
    ------
    InputError
        For an image without exposure, a point measured twice in an image, coordinates outside the image,
        standard deviations that are not positive.
    """
    known = frame_cameras(cameras)
    records = [IMAGE_POINT_FORMATS[source.format](source.file) for source in sources]
    without = 0
    if orient_without_exposure:
        exposures, without = _with_images_alone(exposures, records, tuple(known))
    inputs = [_converted(source, own, exposures, known) for source, own in zip(sources, records, strict=True)]
    places = Places.of_files([r.file for r in records], [r.line for r in records])
    image = pa.concat_arrays([r.image for r in records])
    point = pa.concat_arrays([r.point for r in records]).dictionary_encode()
    point_code = point.indices.to_numpy(zero_copy_only=False).astype(np.int64)
    exposure = np.concatenate([entry.exposure for entry in inputs])
    points = len(point.dictionary)
    places.refuse_duplicates(exposure * points + point_code, "image point", [point, image])
    rays = np.bincount(point_code, minlength=points)
    single = rays == 1
    if surveyed is not None:
        single &= ~np.isin(np.array(point.dictionary.to_pylist(), dtype=object), list(surveyed))
    kept = np.flatnonzero(~single[point_code])
    xy = np.concatenate([entry.xy_mm for entry in inputs])[kept]
    sigma = np.concatenate([entry.sigma_mm for entry in inputs])[kept]
    taken = pa.array(kept)
    columns = {
        "image": image.take(taken),
        "point": point.take(taken).cast(pa.string()),
        "x_mm": xy[:, 0],
        "y_mm": xy[:, 1],
        "sigma_x_mm": sigma[:, 0],
        "sigma_y_mm": sigma[:, 1],
    }
    extra = joined([r.extra for r in records], [len(r.line) for r in records])
    notes = _notes(inputs, point.dictionary, single, len(kept), exposure, exposures)
    alone = (
        ()
        if without == 0
        else (f"{without:,} images have no exposure and are oriented by their image points.",)
    )
    notes = replace(notes, problems=(*alone, *notes.problems, *about_extra(records)))
    return columns, {name: values.take(taken) for name, values in extra.items()}, notes


def _with_images_alone(
    exposures: pd.DataFrame, records: Sequence[ImagePointRecords], cameras: tuple[str, ...]
) -> tuple[pd.DataFrame, int]:
    """The exposures with the images that only image points name, of the only camera; how many they are.

    Raises
    ------
    InputError
        If there are such images and several cameras.
    """
    measured = pa.concat_arrays([own.image for own in records]).unique().to_pylist()
    alone = sorted(set(measured) - set(exposures["image"]))
    if alone and len(cameras) > 1:
        raise InputError(
            f"{len(alone):,} images have no exposure, and the project has several cameras they may be of.",
            "List them in a file of exposures with their camera; positions and angles may be left empty.",
            entity=f"image {alone[0]}",
        )
    added = pd.DataFrame({"image": alone, "camera": list(cameras) * len(alone)})
    return pd.concat([exposures[["image", "camera"]], added], ignore_index=True), len(alone)


def _converted(
    source: ImagePointsInput,
    records: ImagePointRecords,
    exposures: pd.DataFrame,
    cameras: Mapping[str, FrameCamera],
) -> _Converted:
    places = Places.of_files([source.file], [records.line])
    refuse_sigmas(places, records.sigma, records.point)
    exposure = _exposure_of_rows(records, exposures, places)
    names = list(cameras)
    camera = pd.Index(names).get_indexer(pd.Index(exposures["camera"]))[exposure].astype(np.int64)
    models = [cameras[name] for name in names]
    suspicion = refuse_wrong_unit(records, source.unit, models, camera, places)
    pixel_mm = np.array([model.pixel_size * 1e3 for model in models])[camera][:, None]
    scale = pixel_mm if source.unit == "px" else np.array(1.0 if source.unit == "mm" else 1e-3)
    default = IMAGE_POINT_SIGMA_PX * pixel_mm if source.sigma is None else np.array(source.sigma) * scale
    sigma = np.where(np.isnan(records.sigma), default, records.sigma * scale)
    xy = in_millimetres(records.xy, source.unit, models, camera)
    return _Converted(records, exposure, xy, sigma, () if suspicion is None else (suspicion,))


def _exposure_of_rows(records: ImagePointRecords, exposures: pd.DataFrame, places: Places) -> Codes:
    """Row of the exposure (n,) of each image point."""
    encoded = records.image.dictionary_encode()
    names = encoded.dictionary.to_pylist()
    number = pd.Index(exposures["image"]).get_indexer(pd.Index(names)).astype(np.int64)
    rows: Codes = number[encoded.indices.to_numpy(zero_copy_only=False)]
    unknown = rows < 0
    if unknown.any():
        row = int(np.argmax(unknown))
        name = records.image[row].as_py()
        strange = int((number < 0).sum())
        others = f" and {strange - 1} other images" if strange > 1 else ""
        raise places.error(
            row,
            f"There is no exposure of this image{others} ({int(unknown.sum())} image points).",
            f"Add it to the exposures (position and angles may be empty), correct the name, or declare "
            f'inputs.images_without_exposure = "orient". {did_you_mean(name, exposures["image"])}',
            name,
        )
    return rows


def _notes(
    inputs: Sequence[_Converted],
    names: pa.Array,
    single: NDArray[np.bool_],
    kept: int,
    exposure: Codes,
    exposures: pd.DataFrame,
) -> Notes:
    problems = [problem for entry in inputs for problem in entry.problems]
    dropped = int(single.sum())
    if dropped:
        examples = ", ".join(names.filter(pa.array(single))[:_EXAMPLES].to_pylist())
        verb = ("point is", "was") if dropped == 1 else ("points are", "were")
        problems.append(
            f"{dropped:,} {verb[0]} measured in one image only and {verb[1]} dropped: a single ray "
            f"determines no point ({examples}{', …' if dropped > _EXAMPLES else ''})."
        )
    without = len(exposures) - len(np.unique(exposure))
    if without:
        problems.append(
            f"{without:,} of {len(exposures):,} exposures have no image points and take no part in "
            "the adjustment."
        )
    counts = {
        "image_points_read": len(exposure),
        "image_points": kept,
        "object_points": len(single) - dropped,
        "single_ray_points": dropped,
        "exposures_without_image_points": without,
    }
    return Notes(tuple(problems), {"counts": counts})
