"""Image points of all input files in millimetres of the image system.

Fast for millions of rows: names become numbers once, everything after that is arithmetic on arrays, some rows
at a time (`tasks.deliveries.measured_points`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from adjust.arrays import Bools
from adjust.camera.interior import FrameCamera
from tasks.deliveries.cameras import frame_cameras
from tasks.deliveries.image_names import with_image_names
from tasks.deliveries.image_point_rows import ImagePointRows, rays_of_points
from tasks.deliveries.image_point_units import in_format, unit_mm
from tasks.deliveries.measured_points import Codes, MeasuredFile, MeasuredPoints, blocks, counted
from tasks.deliveries.points_in_images import look_through
from tasks.deliveries.source_rows import Places, SigmaRange, about_extra, refuse_sigmas, sigmas_missing
from tasks.errors import InputError, Location
from tasks.formats.joined_names import joined_names
from tasks.formats.records import ImagePointRecords
from tasks.formats.register import read_image_points
from tasks.nearest_name import did_you_mean
from tasks.settings.inputs import ImagePointsInput
from tasks.settings.quality import OUTSIDE_FORMAT_SHARE
from tasks.store.notes import Notes

_EXAMPLES = 3
# Surveyed points that orient a single image.
_RESECTION = 3
# No measurement is better than a thousandth of a pixel, and worse than ten thousand says nothing.
_SIGMAS = SigmaRange(1e-3, 1e4, "px")


@dataclass(frozen=True, slots=True, eq=False)
class UsableImagePoints:
    """The image points that are used.

    Attributes
    ----------
    groups : columns of consecutive rows of ``image_points.parquet``, with those of `extra`.
    extra : names of the further columns of the files.
    notes : what is to be said.
    """

    groups: Iterator[Mapping[str, Any]]
    extra: tuple[str, ...]
    notes: Notes


def usable_image_points(
    sources: Sequence[ImagePointsInput],
    exposures: pd.DataFrame,
    cameras: pd.DataFrame,
    surveyed: Sequence[str] | None = None,
    outside_share: float = OUTSIDE_FORMAT_SHARE,
    orient_without_exposure: bool = False,
) -> UsableImagePoints:
    """Rows of ``image_points.parquet``, and notes.

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
    # An image has the number of its place in the order of the table.
    names = pa.array(exposures["image"], pa.string())
    exposures = exposures.iloc[pc.sort_indices(names).to_numpy()].reset_index(drop=True)
    problems = (
        []
        if without == 0
        else [f"{without:,} images have no exposure and are oriented by their image points."]
    )
    measured, outside, remarks = _measured(sources, records, exposures, known, outside_share)
    with ThreadPoolExecutor(1) as beside:
        by_name = beside.submit(pc.sort_indices, measured.points)
        about_pairs = look_through(measured, exposures)
    rays = rays_of_points(measured)
    single = rays == 1
    if surveyed is not None:
        single &= ~pc.is_in(measured.points, pa.array(surveyed, pa.string())).to_numpy(zero_copy_only=False)
    extra = [entry.extra for entry in records]
    rows = ImagePointRows.of(measured, single, by_name.result().to_numpy(), extra)
    _refuse_nothing_to_intersect(measured, rows.of_image, rays)
    notes = _notes(measured, remarks, outside, single, int(rows.of_image.sum()))
    problems += [*notes.problems, *about_pairs, *about_extra(records)]
    return UsableImagePoints(rows.groups(), rows.extra_names, Notes(tuple(problems), notes.figures))


def _measured(
    sources: Sequence[ImagePointsInput],
    records: list[ImagePointRecords],
    exposures: pd.DataFrame,
    cameras: Mapping[str, FrameCamera],
    outside_share: float,
) -> tuple[MeasuredPoints, int, list[str]]:
    """All rows under one numbering, how many lie outside their image, and sentences for the user.

    The columns of names are taken out of `records`: they are as large as everything else together.
    """
    camera = pd.Index(list(cameras)).get_indexer(pd.Index(exposures["camera"])).astype(np.int64)
    models = tuple(cameras.values())
    remarks: list[str] = []
    images: list[Codes] = []
    points: list[pa.DictionaryArray] = []
    files: list[MeasuredFile] = []
    outside = 0
    for place, (source, own) in enumerate(zip(sources, records, strict=True)):
        of_code = _exposure_of_code(own, exposures)
        found = in_format(own, source.unit, models, camera[of_code], outside_share)
        image = of_code[own.image.indices.to_numpy()]
        outside_here = len(image) - int(np.count_nonzero(found.inside))
        if outside_here:
            image[~found.inside] = -1
        file = MeasuredFile.of(source, own)
        remarks += [*found.remarks, *_about_sigmas(file, own, image, models, camera)]
        outside += outside_here
        files.append(file)
        images.append(image)
        points.append(own.point)
        records[place] = own.without_names()
        del own, found
    point = joined_names(points)
    image = images.pop() if len(images) == 1 else np.concatenate(images)
    names = pa.array(exposures["image"], pa.string())
    codes = point.indices.to_numpy()
    return (
        MeasuredPoints(tuple(files), image, codes, names, point.dictionary, models, camera),
        outside,
        remarks,
    )


def _exposure_of_code(records: ImagePointRecords, exposures: pd.DataFrame) -> Codes:
    """Row of the exposure of each name in the dictionary of the images."""
    names = records.image.dictionary.to_pylist()
    number: Codes = pd.Index(exposures["image"]).get_indexer(pd.Index(names)).astype(np.int32)
    strange = number < 0
    if not strange.any():
        return number
    unknown = strange[records.image.indices.to_numpy()]
    if unknown.any():
        row = int(np.argmax(unknown))
        name = records.image[row].as_py()
        others = f" and {int(strange.sum()) - 1} other images" if strange.sum() > 1 else ""
        raise Location(records.file, int(records.line[row]), name).error(
            f"There is no exposure of this image{others} ({int(unknown.sum())} image points).",
            f"Add it to the exposures (position and angles may be empty), correct the name, or declare "
            f'inputs.images_without_exposure = "orient". {did_you_mean(name, exposures["image"])}',
        )
    return number


def _about_sigmas(
    file: MeasuredFile,
    records: ImagePointRecords,
    image: Codes,
    cameras: Sequence[FrameCamera],
    camera_of_image: NDArray[np.int64],
) -> list[str]:
    """A sentence if only some rows inside the format give standard deviations.

    Raises
    ------
    InputError
        If one cannot be.
    """
    if file.lacks_sigma:
        return []
    pixel_mm = np.array([model.pixel_size * 1e3 for model in cameras])
    scale = unit_mm(file.unit, cameras) / pixel_mm
    without, rows, given = 0, 0, False
    for block in blocks(len(image)):
        inside = image[block] >= 0
        sigma = file.sigma[block][inside]
        missing = np.isnan(sigma).any(axis=1)
        without, rows = without + int(np.count_nonzero(missing)), rows + len(sigma)
        if len(sigma) == 0 or np.isnan(sigma).all():
            continue
        given = True
        line = file.line[block][inside]
        camera = camera_of_image[image[block][inside]]
        refuse_sigmas(
            Places.of_files([file.file], [line]),
            sigma * scale[camera][:, None],
            records.point.slice(block.start, len(inside)).filter(pa.array(inside)),
            _SIGMAS,
        )
    return [sigmas_missing(file.file, without, rows, "sigma")] if without and given else []


def _with_images_alone(
    exposures: pd.DataFrame, records: Sequence[ImagePointRecords], cameras: tuple[str, ...]
) -> tuple[pd.DataFrame, int]:
    """The exposures with images that only image points name, of the only camera; and their number.

    Raises
    ------
    InputError
        If there are such images and several cameras.
    """
    measured = {name for own in records for name in own.image.unique().to_pylist()}
    alone = sorted(measured - set(exposures["image"]))
    if alone and len(cameras) > 1:
        raise InputError(
            f"{len(alone):,} images have no exposure, but the project has several cameras.",
            "List them in a file of exposures with their camera; positions and angles may be left empty.",
            entity=f"image {alone[0]}",
        )
    added = pd.DataFrame({"image": alone, "camera": list(cameras) * len(alone)})
    return pd.concat([exposures, added], ignore_index=True), len(alone)


def _refuse_nothing_to_intersect(
    measured: MeasuredPoints, of_image: NDArray[np.int64], rays: NDArray[np.int64]
) -> None:
    """Raise if no point is seen in two images and no image sees enough surveyed points to be resected."""
    if rays.max() < 2 and of_image.max(initial=0) < _RESECTION:
        raise Location(measured.files[0].file).error(
            f"No point is measured in two images ({int(rays.sum()):,} image points in all): they determine "
            "neither points nor orientations.",
            "Deliver the image points of all images, with the same name for the same point.",
        )


def _notes(measured: MeasuredPoints, remarks: Sequence[str], outside: int, single: Bools, kept: int) -> Notes:
    problems = list(remarks)
    dropped = int(single.sum())
    if dropped:
        first = np.flatnonzero(single)[:_EXAMPLES]
        examples = ", ".join(measured.points.take(pa.array(first)).to_pylist())
        verb = ("point is", "was") if dropped == 1 else ("points are", "were")
        problems.append(
            f"{dropped:,} {verb[0]} measured in one image only and {verb[1]} ignored: a single ray does "
            f"not determine a point ({examples}{', …' if dropped > _EXAMPLES else ''})."
        )
    images = len(measured.images)
    without = images - int(np.count_nonzero(counted(measured.image, images)))
    if without:
        problems.append(without_image_points(without, images))
    counts = {
        "image_points_read": len(measured.image),
        "outside_format": outside,
        "image_points": kept,
        "object_points": len(single) - dropped,
        "single_ray_points": dropped,
        "exposures_without_image_points": without,
    }
    return Notes(tuple(problems), {"counts": counts})


def without_image_points(without: int, exposures: int) -> str:
    """The sentence about exposures that no image point is measured in."""
    verb = "has no image points and is" if without == 1 else "have no image points and are"
    return f"{without:,} of {exposures:,} exposures {verb} not used in the adjustment."
