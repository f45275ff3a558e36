"""Film cameras with the values of their calibration report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import cast

import numpy as np

from adjust.camera.radial_distortion import FittedDistortion, RadialDistortion, fit_distortion
from adjust.errors import InconsistentBlockError
from tasks.errors import Location
from tasks.formats.records import CameraRecord
from tasks.settings.base import PathContext
from tasks.settings.cameras import CameraInput
from tasks.settings.film_report import UM, FilmReport
from tasks.settings.settings_file import SettingsKind, read_settings_file

_REPORT = SettingsKind(FilmReport, "calibration report", "docs/import.md")


def read_film_report(path: Path) -> FilmReport:
    """Read a report.

    Raises
    ------
    InputError
        If it is no such file, or a key or value in it is wrong or impossible.
    """
    return cast(FilmReport, read_settings_file(path, _REPORT).validated(PathContext(path.parent)))


def fiducials_of(camera: CameraInput) -> Mapping[str, tuple[float, float]]:
    """Calibrated coordinates of the fiducial marks of a camera, mm; empty for digital cameras."""
    return camera.fiducials_mm if camera.calibration_report is None else _of(camera).fiducials_mm


def film_camera(camera: CameraInput) -> CameraRecord:
    """Interior orientation and distortion of a camera with a report.

    Raises
    ------
    InputError
        If the report is of another camera or lens, or cannot be read.
    """
    report = _of(camera)
    fitted = _fitted(camera, report)
    return CameraRecord(
        cast(int, camera.columns),
        cast(int, camera.rows),
        cast(float, camera.pixel_um),
        1e3 * fitted.focal_length,
        _principal_point(report),
        {f"brown:{name}": value for name, value in zip(fitted.names, fitted.values.tolist(), strict=True)},
    )


def about_film_reports(cameras: Mapping[str, CameraInput]) -> tuple[str, ...]:
    """Sentences about what was taken from reports, and how well it reproduces them."""
    return tuple(
        sentence
        for name, camera in cameras.items()
        if camera.calibration_report is not None
        for sentence in _about(name, camera, _of(camera))
    )


def _about(name: str, camera: CameraInput, report: FilmReport) -> Iterator[str]:
    fitted, printed = _fitted(camera, report), report.camera.focal_length_mm
    worst = np.unravel_index(int(np.argmax(np.abs(fitted.residual))), fitted.residual.shape)
    radius = 1e3 * _stated(camera, report).radius[worst[0]]
    yield (
        f"Camera {name} has the values of the calibration report of {report.camera.serial}: c "
        f"{1e3 * fitted.focal_length:.4f} mm (calibrated {printed:.4f}; the difference is the linear part of "
        f"the distortion), principal point {report.camera.principal_point.upper()}, "
        f"{len(report.fiducials_mm)} fiducial marks, radial distortion as "
        f"{', '.join(('K0', *fitted.names))}: RMS misfit {1e6 * fitted.rms:.2f} µm, largest "
        f"{1e6 * abs(fitted.residual[worst]):.2f} µm at {radius:.0f} mm."
    )
    if not fitted.fits:
        sigma = UM[report.distortion.unit] * report.distortion.sigma
        yield (
            f"The distortion of {report.camera.serial} does not agree with its parameters: RMS misfit "
            f"{1e6 * fitted.rms:.2f} µm, stated σ {sigma:.2f} µm. Check the "
            "values of the report and its σ."
        )


def _of(camera: CameraInput) -> FilmReport:
    """The report of a camera, if it is of this camera and lens."""
    path = cast(Path, camera.calibration_report)
    report = read_film_report(path)
    for what, there, here in (
        ("camera", report.camera.serial, camera.identity.body),
        ("lens", report.camera.lens, camera.identity.lens),
    ):
        if None not in (there, here) and there != here:
            raise Location(path).error(
                f"The calibration report is of {what} {there}, and the images are of {what} {here}.",
                "Name the report of this camera, or correct identity.",
            )
    return report


def _principal_point(report: FilmReport) -> tuple[float, float]:
    camera = report.camera
    return camera.ppa_mm if camera.principal_point == "ppa" else camera.pps_mm


def _stated(camera: CameraInput, report: FilmReport) -> RadialDistortion:
    """The printed distortion in metres, and in the axes of additional parameters."""
    printed = report.distortion
    um = UM[printed.unit] * (1.0 if printed.positive == "outward" else -1.0)
    outward = 1e-6 * um * np.array(printed.columns).T
    if printed.radius_mm is not None:
        radius = 1e-3 * np.array(printed.radius_mm)
    else:
        ideal = 1e-3 * report.camera.focal_length_mm * np.tan(np.deg2rad(printed.places))
        radius = ideal + outward.mean(axis=1)
    axes = np.deg2rad(camera.calibration_axes_deg)
    centre = 1e-3 * (np.array(report.camera.pps_mm) - np.array(_principal_point(report)))
    turned = np.array([[np.cos(axes), np.sin(axes)], [-np.sin(axes), np.cos(axes)]]) @ centre
    direction = np.deg2rad([float(name) for name in printed.semi_diagonals]) - axes
    return RadialDistortion(radius, direction, outward, 1e-6 * abs(um) * printed.sigma, turned)


def _fitted(camera: CameraInput, report: FilmReport) -> FittedDistortion:
    try:
        return fit_distortion(_stated(camera, report), 1e-3 * report.camera.focal_length_mm)
    except InconsistentBlockError as error:
        raise Location(camera.calibration_report).error(str(error), "Give the whole table.") from error
