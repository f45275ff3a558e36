"""Cameras with values of the certificate of a head: their covariance, and what is said of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tasks.formats.head_certificate import HeadCertificate, read_head_certificate
from tasks.settings.cameras import CalibrationCovariance, CameraInput

#: What becomes of a covariance, by `calibration_use`.
USES = {
    "consider": "Their errors are part of every σ.",
    "prior": "They are observed with their covariance.",
    "held": "They count as exact.",
}


def stated_covariance(camera: CameraInput) -> CalibrationCovariance | None:
    """How well the values of a camera are known, where they are to be anything else than exact.

    Raises
    ------
    InputError
        If the certificate cannot be read.
    """
    if camera.head_certificate is None or camera.calibration_use == "held":
        return camera.covariance
    return CalibrationCovariance(*read_head_certificate(camera.head_certificate).known)


def about_head_certificates(cameras: Mapping[str, CameraInput]) -> tuple[str, ...]:
    """Sentences about what certificates say, and what a test would make of their parameters."""
    return tuple(
        sentence
        for name, camera in cameras.items()
        if camera.head_certificate is not None
        for sentence in _about(name, read_head_certificate(camera.head_certificate), camera.calibration_use)
    )


def _about(name: str, certificate: HeadCertificate, use: str) -> Iterator[str]:
    of = f"the certificate of head {certificate.serial}"
    eliminated = ", ".join(certificate.eliminated)
    held = f"; eliminated and held at zero: {eliminated}" if eliminated else ""
    yield (
        f"Camera {name} has {len(certificate.names)} parameters of {of} "
        f"({', '.join(certificate.names)}){held}. {USES[use]}"
    )
    weak = certificate.insignificant
    if weak:
        sizes = ", ".join(f"{parameter} ({size:.1f} σ)" for parameter, size in weak.items())
        yield (
            f"In {of}, not significant at 5 % are {sizes}: a test would eliminate them. They are used with "
            "their standard deviations."
        )
