"""Interior orientation of film images from their measured fiducial marks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Floats, Ints
from adjust.camera.fiducials import FEWEST_MARKS, FilmOrientations, film_orientations
from adjust.camera.interior import FrameCamera
from adjust.errors import InconsistentBlockError
from tasks.deliveries.cameras import frame_cameras
from tasks.deliveries.film_reports import fiducials_of
from tasks.deliveries.image_names import with_image_names
from tasks.deliveries.image_point_units import in_millimetres, unit_mm
from tasks.errors import InputError
from tasks.formats.register import read_image_points
from tasks.nearest_name import did_you_mean
from tasks.settings.cameras import CameraInput
from tasks.settings.inputs import ImagePointsInput
from tasks.tables.places import places_of

# σ of a measured mark that the delivery does not state, px.
_SIGMA_PX = 0.3
# A standardized residual beyond it is a wrong mark: 0.004 % of good ones.
_WRONG = 4.13
# Redundancy number below which a mark has no check.
_CHECKED = 0.01


@dataclass(frozen=True, eq=False)
class MeasuredMarks:
    """Measured fiducial marks of film images; lengths in mm.

    Attributes
    ----------
    images, cameras : names of the n images and of their cameras.
    image : (k,) index of the image of each mark.
    mark : (k,) its name.
    measured, calibrated : (k, 2) in the scan and in the calibration report.
    sigma : (k,) standard deviation of a measured coordinate.
    """

    images: tuple[str, ...]
    cameras: tuple[str, ...]
    image: Ints
    mark: tuple[str, ...]
    measured: Floats
    calibrated: Floats
    sigma: Floats

    def orientations(self) -> FilmOrientations:
        """Affine transformations of all images.

        Raises
        ------
        InputError
            If an image has too few marks, or all of them on a line.
        """
        few = np.bincount(self.image, minlength=len(self.images)) < FEWEST_MARKS
        if few.any():
            raise InputError(
                f"The image has fewer than {FEWEST_MARKS} measured fiducial marks.",
                "Measure at least three; four or more are needed to find a wrong one.",
                entity=f"image {self.images[int(np.argmax(few))]}",
            )
        try:
            return film_orientations(len(self.images), self.image, self.measured, self.calibrated)
        except InconsistentBlockError as error:
            raise InputError(str(error), "Measure marks in other corners of the images.") from error

    def standardized(self, found: FilmOrientations) -> Floats:
        """Residuals (k, 2) over their standard deviations; NaN for a mark without a check."""
        r = found.redundancy_number
        return np.asarray(found.residual / np.where(r > _CHECKED, self.sigma * np.sqrt(r), np.nan)[:, None])

    def columns(self, found: FilmOrientations) -> dict[str, object]:
        """Columns of film_orientations.parquet."""
        n = len(self.images)
        size = np.abs(found.residual).max(axis=1)
        order = np.lexsort((size, self.image))
        last = order[np.flatnonzero(np.diff(self.image[order], append=n))]
        variance = np.bincount(self.image, self.sigma**2, n) / np.bincount(self.image, minlength=n)
        sigma = np.sqrt(variance[:, None] * np.diagonal(found.cofactor, axis1=1, axis2=2))
        names = ("0_mm", "1", "2")
        terms = {
            f"{row}{name}": found.coefficients[:, i, j]
            for i, row in enumerate("ab")
            for j, name in enumerate(names)
        }
        return {
            "image": list(self.images),
            "camera": list(self.cameras),
            "marks": np.bincount(self.image, minlength=n).astype(np.int32),
            **terms,
            **{f"sigma_{name}": sigma[:, j] for j, name in enumerate(names)},
            "sigma0_um": 1e3 * found.sigma0,
            "largest_um": 1e3 * size[last],
            "largest_mark": [self.mark[row] for row in last],
            "largest_standardized": np.abs(self.standardized(found)[last]).max(axis=1),
        }

    def remarks(self, found: FilmOrientations) -> tuple[str, ...]:
        """Sentences about residuals and shrinkage overall, and about wrong marks."""
        checked = found.redundancy > 0
        squares = float(np.sum((found.redundancy * found.sigma0**2)[checked]))
        rms = 1e3 * np.sqrt(squares / max(int(found.redundancy.sum()), 1))
        scale = np.sqrt(np.abs(np.linalg.det(found.coefficients[:, :, 1:]))).mean() - 1.0
        sentences = [
            f"The interior orientation of {len(self.images):,} film images was determined from their "
            f"fiducial marks: σ0 {rms:.1f} µm; the film is on average {abs(scale) * 1e6:,.0f} ppm "
            f"{'smaller' if scale > 0.0 else 'larger'} than the camera states."
        ]
        wrong = np.nan_to_num(np.abs(self.standardized(found)).max(axis=1))
        rows = np.flatnonzero(wrong > _WRONG)
        if len(rows):
            worst = rows[int(np.argmax(wrong[rows]))]
            sentences.append(
                f"{len(rows)} fiducial marks contradict the others by more than {_WRONG:g} σ; the worst is "
                f"mark {self.mark[worst]} in image {self.images[self.image[worst]]} "
                f"({1e3 * np.abs(found.residual[worst]).max():.1f} µm). Measure it again, or check "
                "the marks of the camera."
            )
        return tuple(sentences)


def measured_marks(
    sources: Sequence[ImagePointsInput],
    exposures: pd.DataFrame,
    camera_table: pd.DataFrame,
    given: Mapping[str, CameraInput],
) -> MeasuredMarks:
    """The marks of all files with their calibrated coordinates.

    Raises
    ------
    InputError
        If an image has no exposure, or a mark is not in the calibration report of its camera or is measured
        twice.
    """
    cameras = frame_cameras(camera_table)
    camera_of_image = exposures.set_index("image")["camera"]
    tables = [_of_file(source, camera_of_image, cameras, given) for source in sources]
    table = pd.concat(tables, ignore_index=True)
    twice = table.duplicated(["image", "mark"])
    if twice.any():
        row = table[twice].iloc[0]
        raise _error(row, "The fiducial mark is measured twice in this image.", "Keep one of the two.")
    images = tuple(sorted(table["image"].unique()))
    return MeasuredMarks(
        images,
        tuple(camera_of_image[list(images)]),
        places_of(table["image"], images),
        tuple(table["mark"]),
        table[["x", "y"]].to_numpy(np.float64),
        table[["x_calibrated", "y_calibrated"]].to_numpy(np.float64),
        table["sigma"].to_numpy(np.float64),
    )


def _of_file(
    source: ImagePointsInput,
    camera_of_image: pd.Series,
    cameras: Mapping[str, FrameCamera],
    given: Mapping[str, CameraInput],
) -> pd.DataFrame:
    records = with_image_names(
        read_image_points(source.format, source.file, source.layout), source.image_names
    )
    table = pd.DataFrame({"image": records.image.to_pylist(), "mark": records.point.to_pylist()})
    table["line"], table["file"] = records.line, str(records.file)
    table["camera"] = table["image"].map(camera_of_image)
    if table["camera"].isna().any():
        row = table[table["camera"].isna()].iloc[0]
        known = did_you_mean(row["image"], list(camera_of_image.index))
        raise _error(row, "There is no exposure of this image.", f"Correct its name. {known}")
    calibrated = {camera: fiducials_of(given[camera]) for camera in table["camera"].unique()}
    known_marks = [
        calibrated[camera].get(mark) for camera, mark in zip(table["camera"], table["mark"], strict=True)
    ]
    if None in known_marks:
        row = table.iloc[known_marks.index(None)]
        names = list(calibrated[row["camera"]])
        raise _error(
            row,
            f"The camera {row['camera']} has no fiducial mark '{row['mark']}'.",
            f"Add it to the fiducial marks of the camera. {did_you_mean(row['mark'], names)}",
        )
    models = list(cameras.values())
    number = places_of(table["camera"], tuple(cameras))
    unit = unit_mm(source.unit, models)[number]
    pixel = np.array([model.pixel_size * 1e3 for model in models])[number]
    sigma = records.sigma.mean(axis=1) * unit
    stated = _SIGMA_PX * pixel if source.sigma is None else float(np.mean(source.sigma)) * unit
    table["sigma"] = np.where(np.isfinite(sigma), sigma, stated)
    table[["x", "y"]] = in_millimetres(records.xy, source.unit, models, number)
    table[["x_calibrated", "y_calibrated"]] = np.array(known_marks, dtype=np.float64).reshape(-1, 2)
    return table


def _error(row: pd.Series, what: str, remedy: str) -> InputError:
    entity = f"mark {row['mark']} in image {row['image']}"
    return InputError(what, remedy, Path(row["file"]), int(row["line"]), entity)
