"""Section on use: what the values apply to, and what this certificate must not be used for."""

from __future__ import annotations

from adjust.parameters import BORESIGHT, GNSS_SHIFT, LEVER_ARM
from tasks.documents.certificate.content import Block, Section, Sentences
from tasks.documents.certificate.identity_section import NOT_DECLARED
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.certificate.quantities import has_result, is_of

_OF_PRODUCT = {
    "virtual_image": (
        "For single camera heads: interior orientation and additional parameters are those of the virtual "
        "image. Conversely, the certificates of the heads must not be used for the virtual image."
    ),
    "camera_head": (
        "For the virtual image that is composed of several heads: interior orientation and additional "
        "parameters are those of one camera head."
    ),
}


def use_section(material: CertificateMaterial) -> Section:
    """What it is for, and what it is not for."""
    blocks: list[Block] = []
    if material.record.verdict != "refused":
        blocks.append(Sentences("The values are valid for", _holds_for(material)))
    blocks.append(Sentences("This certificate must not be used", _not_for(material)))
    return Section("use", "Use of this certificate", tuple(blocks))


def _holds_for(material: CertificateMaterial) -> tuple[str, ...]:
    camera = material.record.camera
    identity = camera.identity
    body = f"{_numbered('camera body', identity.body)} with {_numbered('lens', identity.lens)}"
    sentences = [
        f"Interior orientation and additional parameters: images of {camera.name}, {body}, "
        f"{camera.columns:,} × {camera.rows:,} px, until camera or lens is repaired or adjusted."
    ]
    if _any(material, BORESIGHT, LEVER_ARM):
        sentences.append(
            f"Boresight and lever arm: the same camera with {_numbered('inertial unit', identity.imu)} in "
            f"{_numbered('installation', identity.mount)}, until either is removed."
        )
    if _any(material, GNSS_SHIFT):
        sentences.append(
            "GNSS shift: flights whose positions come from the same reference frame, base stations and "
            "processing; otherwise it is valid for the calibration flight only."
        )
    return tuple(sentences)


def _numbered(what: str, number: str | None) -> str:
    """A part with its serial number, or the one of this flight where none is declared."""
    return f"{what} {number}" if number else f"the {what} of this flight (number {NOT_DECLARED})"


def _any(material: CertificateMaterial, *families: str) -> bool:
    return any(is_of(item, *families) and has_result(item) for item in material.parameters)


def _not_for(material: CertificateMaterial) -> tuple[str, ...]:
    record, identity = material.record, material.record.camera.identity
    sentences = []
    if record.verdict == "refused":
        sentences.append(
            "For production: the calibration is refused. The certificate only documents what this flight "
            "lacks."
        )
    sentences.append(_OF_PRODUCT[identity.product])
    sentences.append(
        "For another camera, lens, inertial unit or installation, even if it has the same name in a project."
    )
    held = [item for item in material.parameters if not has_result(item)]
    if held:
        sentences.append(
            "As a statement about parameters that were held, eliminated or not determinable: the certificate "
            "makes no statement about them, and their σ is not zero."
        )
    sentences.append(
        "For a single parameter: the values are valid only together. Focal length, principal point, "
        "boresight and shift compensate each other; using or replacing one of them requires the others and "
        "the covariance matrix of the record."
    )
    sentences.append(
        "As a statement about the accuracy of mapping: differences at control points of the calibration are "
        "no such statement, and those at independent check points apply to their block only."
    )
    if material.results.residual_grid["correction_x_um"].notna().any():
        sentences.append("Without the preceding corrections of the image coordinates by mean residuals.")
    return tuple(sentences)
