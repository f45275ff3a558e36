"""Cameras with values from the certificate of a head: their covariance, and remarks on it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from tasks.errors import Location
from tasks.formats.head_certificate import HeadCertificate, read_head_certificate
from tasks.settings.cameras import CalibrationCovariance, CameraInput

#: What becomes of a covariance, by `calibration_use`.
USES = {
    "consider": "Their errors are part of every σ.",
    "prior": "They are observed with their covariance.",
    "held": "They count as exact.",
}


def certificate_of(camera: CameraInput, path: Path) -> HeadCertificate:
    """The certificate of a head, if it is of the band and software version of the camera.

    Raises
    ------
    InputError
        If it cannot be read, or band or software differ or are declared on one side only.
    """
    certificate = read_head_certificate(path)
    for name, words in (("band", "band"), ("software", "software version")):
        there, here = getattr(certificate, name), getattr(camera.identity, name)
        if there == here:
            continue
        if there is not None and here is not None:
            raise Location(path, entity=name).error(
                f"The certificate is of {words} {there}, and the camera of {here}: the calibration of "
                f"another {words} is not applied.",
                "Name the certificate of this head, or correct identity.",
            )
        given, missing = ("certificate", "camera") if here is None else ("camera", "certificate")
        place = f"identity.{name} of the camera" if here is None else f"[head] {name} of the certificate"
        raise Location(path, entity=name).error(
            f"The {given} declares the {words} {there or here}, and the {missing} does not.",
            f"Declare it: {place}.",
        )
    return certificate


def stated_covariance(camera: CameraInput) -> CalibrationCovariance | None:
    """How well the values of a camera are known, unless they are to be taken as exact.

    Raises
    ------
    InputError
        If the certificate cannot be read.
    """
    if camera.head_certificate is None or camera.calibration_use == "held":
        return camera.covariance
    return CalibrationCovariance(*certificate_of(camera, camera.head_certificate).known)


def about_head_certificates(cameras: Mapping[str, CameraInput]) -> tuple[str, ...]:
    """Sentences about the content of certificates, and about tests of their parameters."""
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
