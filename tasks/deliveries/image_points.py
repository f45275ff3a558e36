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
from tasks.deliveries.cameras import frame_cameras
from tasks.deliveries.copied_images import refuse_copied_images
from tasks.deliveries.extra_columns import about_extra, joined
from tasks.deliveries.image_names import with_image_names
from tasks.deliveries.image_point_units import in_format, in_millimetres, unit_mm
from tasks.deliveries.neighbouring_images import about_neighbours
from tasks.deliveries.source_rows import Places, SigmaRange, about_missing_sigmas, refuse_sigmas
from tasks.errors import InputError
from tasks.formats.joined_names import joined_names
from tasks.formats.records import ImagePointRecords
from tasks.formats.register import read_image_points
from tasks.nearest_name import did_you_mean
from tasks.settings.inputs import IMAGE_POINT_SIGMA_PX, ImagePointsInput
from tasks.settings.quality import OUTSIDE_FORMAT_SHARE
from tasks.store.notes import Notes

Codes = NDArray[np.int64]
_EXAMPLES = 3
# No measurement is better than a thousandth of a pixel, and worse than ten thousand says nothing.
# Surveyed points that orient a single image.
_RESECTION = 3
_SIGMAS = SigmaRange(1e-3, 1e4, "px")


@dataclass(frozen=True, slots=True, eq=False)
class _Converted:
    """One input in millimetres, with the exposure of each row, and the number of rows that were left out."""

    records: ImagePointRecords
    exposure: Codes
    xy_mm: Floats
    sigma_mm: Floats
    problems: tuple[str, ...]
    outside: int


def usable_image_points(
    sources: Sequence[ImagePointsInput],
    exposures: pd.DataFrame,
    cameras: pd.DataFrame,
    surveyed: Sequence[str] | None = None,
    outside_share: float = OUTSIDE_FORMAT_SHARE,
    orient_without_exposure: bool = False,
) -> tuple[Mapping[str, Any], Mapping[str, pa.Array], Notes]:
    """Columns of ``image_points.parquet``, further columns of the files, and notes.

    Points seen in one image only are dropped, counted and said, except those in `surveyed`; so are points
    outside the format, up to `outside_share` of a file.

    Raises
    ------
    InputError
        For an image without exposure, a point measured twice in an image, more coordinates outside the
        image, standard deviations that are not positive.
    """
    known = frame_cameras(cameras)
    records = [
        with_image_names(read_image_points(source.format, source.file, source.layout), source.image_names)
        for source in sources
    ]
    without = 0
    if orient_without_exposure:
        exposures, without = _with_images_alone(exposures, records, tuple(known))
    inputs = [
        _converted(source, own, exposures, known, outside_share)
        for source, own in zip(sources, records, strict=True)
    ]
    records = [entry.records for entry in inputs]
    places = Places.of_files([r.file for r in records], [r.line for r in records])
    image = joined_names([r.image for r in records])
    point = joined_names([r.point for r in records])
    point_code = point.indices.to_numpy(zero_copy_only=False).astype(np.int64)
    exposure = np.concatenate([entry.exposure for entry in inputs])
    points = len(point.dictionary)
    places.refuse_duplicates(exposure * points + point_code, "image point", [point, image])
    xy_mm = np.concatenate([entry.xy_mm for entry in inputs])
    refuse_copied_images(places, exposure, point_code, xy_mm, exposures["image"].tolist())
    rays = np.bincount(point_code, minlength=points)
    single = rays == 1
    if surveyed is not None:
        single &= ~np.isin(np.array(point.dictionary.to_pylist(), dtype=object), list(surveyed))
    kept = np.flatnonzero(~single[point_code])
    _refuse_nothing_to_intersect(records, exposure[kept], rays)
    xy = xy_mm[kept]
    sigma = np.concatenate([entry.sigma_mm for entry in inputs])[kept]
    taken = pa.array(kept)
    columns = {
        "image": image.take(taken).cast(pa.string()),
        "point": point.take(taken).cast(pa.string()),
        "x_mm": xy[:, 0],
        "y_mm": xy[:, 1],
        "sigma_x_mm": sigma[:, 0],
        "sigma_y_mm": sigma[:, 1],
        "input_file": _file_names(records).take(pa.array(places.file[kept])),
    }
    extra = joined([r.extra for r in records], [len(r.line) for r in records])
    notes = _notes(inputs, point.dictionary, single, len(kept), exposure, exposures)
    alone = (
        ()
        if without == 0
        else (f"{without:,} images have no exposure and are oriented by their image points.",)
    )
    problems = (*alone, *notes.problems, *about_neighbours(exposures, exposure, point_code))
    notes = replace(notes, problems=(*problems, *about_extra(records)))
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
    measured = joined_names([own.image for own in records]).unique().to_pylist()
    alone = sorted(set(measured) - set(exposures["image"]))
    if alone and len(cameras) > 1:
        raise InputError(
            f"{len(alone):,} images have no exposure, and the project has several cameras they may be of.",
            "List them in a file of exposures with their camera; positions and angles may be left empty.",
            entity=f"image {alone[0]}",
        )
    added = pd.DataFrame({"image": alone, "camera": list(cameras) * len(alone)})
    return pd.concat([exposures, added], ignore_index=True), len(alone)


def _converted(
    source: ImagePointsInput,
    records: ImagePointRecords,
    exposures: pd.DataFrame,
    cameras: Mapping[str, FrameCamera],
    outside_share: float,
) -> _Converted:
    places = Places.of_files([source.file], [records.line])
    exposure = _exposure_of_rows(records, exposures, places)
    names = list(cameras)
    camera = pd.Index(names).get_indexer(pd.Index(exposures["camera"]))[exposure].astype(np.int64)
    models = [cameras[name] for name in names]
    found = in_format(records, source.unit, models, camera, places, outside_share)
    if not found.inside.all():
        records, exposure, camera = _only(records, found.inside), exposure[found.inside], camera[found.inside]
        places = Places.of_files([source.file], [records.line])
    pixel_mm = np.array([model.pixel_size * 1e3 for model in models])[camera][:, None]
    scale = unit_mm(source.unit, models)[camera][:, None]
    refuse_sigmas(places, records.sigma * scale / pixel_mm, records.point, _SIGMAS)
    default = IMAGE_POINT_SIGMA_PX * pixel_mm if source.sigma is None else np.array(source.sigma) * scale
    sigma = np.where(np.isnan(records.sigma), default, records.sigma * scale)
    xy = in_millimetres(records.xy, source.unit, models, camera)
    remarks = about_missing_sigmas(records.file, records.sigma, np.isfinite(records.xy), "sigma")
    return _Converted(records, exposure, xy, sigma, (*found.remarks, *remarks), int((~found.inside).sum()))


def _refuse_nothing_to_intersect(
    records: Sequence[ImagePointRecords], exposure: Codes, rays: NDArray[np.int64]
) -> None:
    """Raise if no point is seen in two images and no image sees enough surveyed points to be resected."""
    most = int(np.bincount(exposure).max()) if len(exposure) else 0
    if rays.max() < 2 and most < _RESECTION:
        raise InputError(
            f"No point is measured in two images ({int(rays.sum()):,} image points in all): they determine "
            "neither points nor orientations.",
            "Deliver the image points of all images, with the same name for the same point.",
            file=records[0].file,
        )


def _only(records: ImagePointRecords, kept: NDArray[np.bool_]) -> ImagePointRecords:
    """The rows (n,) that are kept."""
    chosen = pa.array(np.flatnonzero(kept))
    return ImagePointRecords(
        records.file,
        records.image.take(chosen),
        records.point.take(chosen),
        records.xy[kept],
        records.sigma[kept],
        records.line[kept],
        {name: values.take(chosen) for name, values in records.extra.items()},
    )


def _file_names(records: Sequence[ImagePointRecords]) -> pa.Array:
    """Names of the files, with their folder where two are alike."""
    names = [entry.file.name for entry in records]
    return pa.array(
        [
            f"{entry.file.parent.name}/{name}" if names.count(name) > 1 else name
            for entry, name in zip(records, names, strict=True)
        ]
    )


def _exposure_of_rows(records: ImagePointRecords, exposures: pd.DataFrame, places: Places) -> Codes:
    """Row of the exposure (n,) of each image point."""
    names = records.image.dictionary.to_pylist()
    number = pd.Index(exposures["image"]).get_indexer(pd.Index(names)).astype(np.int64)
    rows: Codes = number[records.image.indices.to_numpy(zero_copy_only=False)]
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
        "image_points_read": len(exposure) + sum(entry.outside for entry in inputs),
        "outside_format": sum(entry.outside for entry in inputs),
        "image_points": kept,
        "object_points": len(single) - dropped,
        "single_ray_points": dropped,
        "exposures_without_image_points": without,
    }
    return Notes(tuple(problems), {"counts": counts})
