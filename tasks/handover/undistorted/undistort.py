"""Images without the distortion that an adjustment has found, their camera, and a statement on both."""

from __future__ import annotations

import fcntl
import logging
import os
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast, get_args

from adjust.options import available_threads
from adjust.resampling.resampled import Resampling
from tasks.errors import InputError, Location
from tasks.files.delivered_file import require_folder
from tasks.files.installation import remove_abandoned, write_whole, writing_into
from tasks.handover.formats.corrected_csv import ideal_cameras
from tasks.handover.results import CalibratedCamera, film_cameras, read_cameras
from tasks.handover.undistorted.camera_map import CameraMap, camera_map
from tasks.handover.undistorted.undistorted_image import Work, coding_threads, undistort_image
from tasks.image_files.image_reader import ImageDescription, described, opened_image
from tasks.image_files.image_writer import left_out_of
from tasks.nearest_name import did_you_mean

_TIFF = (".tif", ".tiff")
_CAMERAS = "cameras.csv"
_log = logging.getLogger("aerocal")


@dataclass(frozen=True)
class Undistorted:
    """What was written.

    Attributes
    ----------
    folder, files : where, and which images.
    statement : of these images, as in UNDISTORTED.txt, which also has those of earlier calls.
    """

    folder: Path
    files: tuple[str, ...]
    statement: str


@dataclass(frozen=True, eq=False)
class _Job:
    """An image to be written: its camera, what it says about itself, and its new name."""

    path: Path
    camera: CalibratedCamera
    about: ImageDescription
    file: str


def undistort(
    results: Path,
    images: Sequence[Path],
    out: Path | None = None,
    camera: str | None = None,
    resampling: str = "cubic",
    progress: Callable[[str, float], None] = lambda _file, _done: None,
) -> Undistorted:
    """Write images as cameras without distortion would have taken them.

    Parameters
    ----------
    results : folder of the results of a run.
    out : folder of the images; None: `undistorted` in the results.
    camera : name of the camera that has taken the images; None: that of each image in the block.
    resampling : cubic or lanczos.
    progress : told the name of an image and how much of it is done, 0 to 1.

    Raises
    ------
    InputError
        If there are no results, no such camera or resampling, an image is not of the block, is a scanned film
        or does not have the size of its camera, or would be written over another one, or if the folder has
        images of other cameras. Nothing is written then.
    InstallationError
        If the files cannot be written, or the installation is without rasterio.
    """
    folder = results / "undistorted" if out is None else out
    kind = _resampling(resampling)
    cameras, of_image = read_cameras(results)
    film = film_cameras(results)
    jobs = _jobs(cameras, of_image, film, images, folder, camera)
    ideal = _described({name: one for name, one in cameras.items() if name not in film})
    _require_own(folder, jobs, ideal)
    remove_abandoned(folder)
    work, maps, done = Work(kind, available_threads()), dict[str, CameraMap](), Statement()
    for number, job in enumerate(jobs, start=1):
        name = job.camera.frame.name
        if name not in maps:
            _log.info("camera %s: source positions of pixels", name)
            maps[name] = camera_map(job.camera)
        _log.info("%s: image %d of %d", job.file, number, len(jobs))
        done.add(maps[name], _carried_out(job, maps[name], folder, work, progress))
        # After each image: a run that is killed leaves a folder that the next one knows as its own.
        _state(folder, job.file, ideal, done)
    return Undistorted(folder, tuple(job.file for job in jobs), done.text)


def _described(cameras: Mapping[str, CalibratedCamera]) -> str:
    """cameras.csv: the ideal cameras, and a digest of what was removed from the images of each."""
    lines = ideal_cameras(one.frame for one in cameras.values()).splitlines()
    digests = ["corrections", *(one.digest_of_corrections for one in cameras.values())]
    return "".join(f"{line},{digest}\n" for line, digest in zip(lines, digests, strict=True))


def _resampling(text: str) -> Resampling:
    for kind in get_args(Resampling):
        if text == kind:
            return cast(Resampling, kind)
    raise InputError(
        f"'{text}' is not known.", did_you_mean(text, list(get_args(Resampling))), entity="--resampling"
    )


def _carried_out(
    job: _Job, found: CameraMap, folder: Path, work: Work, progress: Callable[[str, float], None]
) -> UndistortedImage:
    """The image of a job, written."""
    with opened_image(job.path, coding_threads(job.about, work.threads)) as source:
        outside = undistort_image(
            source, found.pixels, folder / job.file, work, lambda part: progress(job.file, part)
        )
        left_out = left_out_of(source)
    about = job.about
    part, alpha = outside / (about.columns * about.rows), tuple(band + 1 for band in about.alpha)
    return UndistortedImage(job.file, job.camera.frame.name, work.resampling, part, left_out, alpha)


def _require_own(folder: Path, jobs: Sequence[_Job], cameras: str) -> None:
    """Refuse a folder with images that others have written, or whose cameras are not these."""
    own = folder / _CAMERAS
    if own.exists():
        if own.read_bytes() != cameras.encode():
            raise Location(own).error(
                "The folder has images of other cameras, or of another calibration.",
                "Give another --out, or delete the folder first.",
            )
        return
    for job in jobs:
        if (folder / job.file).exists():
            raise Location(folder / job.file).error(
                "It exists already, and the folder has no images of aerocal undistort.", "Give another --out."
            )


def _state(folder: Path, image: str, cameras: str, done: Statement) -> None:
    """State the images, one of them just written, with those that other calls have written meanwhile."""
    with _alone(folder):
        try:
            _require_own(folder, (), cameras)
        except InputError:
            # Another call has begun since with other cameras.
            (folder / image).unlink(missing_ok=True)
            raise
        write_whole(folder / _CAMERAS, cameras)
        write_whole(folder / STATEMENT, done.after(_stated(folder)).text)


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """While no other call states images in a folder: one of the two statements would be lost."""
    with writing_into(folder):
        handle = os.open(folder, os.O_RDONLY)
    try:
        # Some network folders have no locks.
        with suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def _jobs(
    cameras: Mapping[str, CalibratedCamera],
    of_image: Mapping[str, str],
    film: frozenset[str],
    images: Sequence[Path],
    folder: Path,
    camera: str | None,
) -> list[_Job]:
    """All requested images, after all checks."""
    if camera is not None and camera not in cameras:
        raise InputError(
            f"The results have no camera '{camera}'.", did_you_mean(camera, list(cameras)), entity="--camera"
        )
    require_folder(folder)
    jobs = dict[str, _Job]()
    for path in images:
        about = described(path)
        taken_by = cameras[_camera_of(path, of_image) if camera is None else camera]
        if taken_by.frame.name in film:
            raise Location(path).error(
                f"The camera {taken_by.frame.name} exposes film: where its image lies in a scan differs from "
                "scan to scan and is not applied to pixels.",
                "Use the corrected image points instead: aerocal export RESULTS --to corrected-csv.",
            )
        _require_size(about, taken_by)
        file = path.name if path.suffix.lower() in _TIFF else f"{path.stem}.tif"
        if file in jobs:
            raise Location(path).error(
                f"The image would be written as {file}, as would {jobs[file].path}.",
                "Write one of them into another folder (--out).",
            )
        if (folder / file).exists() and (folder / file).samefile(path):
            raise Location(path).error("The image would overwrite itself.", "Give another --out.")
        jobs[file] = _Job(path, taken_by, about, file)
    return list(jobs.values())


def _camera_of(path: Path, of_image: Mapping[str, str]) -> str:
    """Name of the camera of an image, found by its folders and file name, with or without extension."""
    parts = path.absolute().parts
    for name in (*("/".join(parts[k:]) for k in range(len(parts))), path.stem):
        if name in of_image:
            return of_image[name]
    alike = sorted({camera for name, camera in of_image.items() if Path(name).stem == path.stem})
    if len(alike) == 1:
        return alike[0]
    if alike:
        raise Location(path).error(
            f"Images of this name were taken by the cameras {', '.join(alike)}.", "Name the camera: --camera."
        )
    raise Location(path).error(
        "The block has no adjusted image of this name.",
        f"{did_you_mean(path.stem, list(of_image))} For an image of another block name the camera: --camera.",
    )


def _require_size(about: ImageDescription, camera: CalibratedCamera) -> None:
    frame = camera.frame
    if (about.columns, about.rows) == (frame.columns, frame.rows):
        return
    turned = (about.rows, about.columns) == (frame.columns, frame.rows)
    raise Location(about.path).error(
        f"The image has {about.columns:,} × {about.rows:,} pixels, and the camera {frame.name} "
        f"{frame.columns:,} × {frame.rows:,}.",
        "Deliver it as taken by the camera" + (", not turned." if turned else ", in its full size."),
    )


STATEMENT = "UNDISTORTED.txt"
_WIDTH = 78
_WORDS: dict[Resampling, str] = {
    "cubic": "cubic convolution (Keys, a = -1/2, 4 x 4 pixels)",
    "lanczos": "Lanczos' window (6 x 6 pixels)",
}


@dataclass(frozen=True)
class UndistortedImage:
    """An image that was written.

    Attributes
    ----------
    file, camera : their names.
    resampling : of its pixels.
    outside : part of its pixels that lies outside of what was taken, 0 to 1.
    left_out : what of the taken image applies to its pixels only and was not copied.
    alpha : numbers from 1 of its alpha bands.
    """

    file: str
    camera: str
    resampling: Resampling
    outside: float
    left_out: tuple[str, ...]
    alpha: tuple[int, ...] = ()


@dataclass(frozen=True)
class Statement:
    """UNDISTORTED.txt: what all images have in common, of each camera and of each image.

    Attributes
    ----------
    cameras : paragraphs in their order; without values.
    images : file → its line.
    """

    cameras: dict[str, None] = field(default_factory=dict)
    images: dict[str, str] = field(default_factory=dict)

    def add(self, camera: CameraMap, image: UndistortedImage) -> None:
        """State an image, and the camera that took it."""
        self.cameras[textwrap.fill(_about_camera(camera), _WIDTH)] = None
        self.images[image.file] = _about_image(image)

    def after(self, earlier: Statement) -> Statement:
        """Both; of an image that was written again, what is stated here."""
        return Statement(earlier.cameras | self.cameras, earlier.images | self.images)

    @property
    def text(self) -> str:
        """The whole text."""
        parts = [
            "The images are as cameras without distortion would have taken them, with the focal lengths and "
            "principal points of cameras.csv (mm from the centre of the format, x right, y up). Exterior "
            "orientations are those of the results, unchanged.",
            "Contained: additional parameters and mean residuals. NOT contained: refraction and the "
            "curvature of the earth, which depend on the ground. The program must not apply any other "
            "distortion of the camera.",
            "Pixels are resampled by the method of each image; at borders and next to pixels without data, "
            "bilinearly between the valid ones. Pixels outside the original image have the no-data value or "
            "0.",
        ]
        about, *others = (textwrap.fill(part, _WIDTH) for part in parts)
        return "\n\n".join([about, *self.cameras, *others, "\n".join(self.images.values())]) + "\n"


def _stated(folder: Path) -> Statement:
    """What earlier calls have stated of images that are still in the folder."""
    file = folder / STATEMENT
    parts = file.read_text(encoding="utf-8", errors="replace").split("\n\n") if file.exists() else [""]
    named = ((line.partition(": camera ")[0], line) for line in parts[-1].splitlines())
    return Statement(
        {part: None for part in parts if part.startswith("Camera ")},
        {name: line for name, line in named if name != line and (folder / name).exists()},
    )


def _about_camera(one: CameraMap) -> str:
    camera = one.camera
    return (
        f"Camera {camera.frame.name}: additional parameters change image points by up to "
        f"{1e6 * camera.largest_distortion:.1f} µm, mean residuals by up to "
        f"{1e6 * camera.largest_mean_residual:.1f} µm, both together by up to {one.largest_shift_px:.2f} "
        "pixels. Source positions are interpolated; the largest error found is "
        f"{one.pixels.error_px:.4f} pixels."
    )


def _about_image(one: UndistortedImage) -> str:
    text = (
        f"{one.file}: camera {one.camera}; {_WORDS[one.resampling]}; {100.0 * one.outside:.2f} % of its "
        "pixels are outside the original image"
    )
    # Programs write near infrared as such a band, if they are not told otherwise.
    text += "".join(
        f"; band {band} is alpha by its file: it says which pixels are valid and is moved to whole pixels"
        for band in one.alpha
    )
    return text + (f"; without the {' and '.join(one.left_out)} of the image." if one.left_out else ".")
