"""Section of the camera: what was calibrated, by the numbers on it."""

from __future__ import annotations

from tasks.certificate.content import Block, Fact, Facts, Section, Words
from tasks.certificate.material import CertificateMaterial
from tasks.report.table import Number

NOT_DECLARED = "not declared"
_PRODUCTS = {
    "virtual_image": "virtual image (composed of the images of all heads, or of a single-head camera)",
    "camera_head": "image of one camera head",
}


def identity_section(material: CertificateMaterial) -> Section:
    """The camera, its image and its mounting."""
    camera = material.record.camera
    identity = camera.identity
    half = (camera.columns * camera.pixel_um * 1e-3, camera.rows * camera.pixel_um * 1e-3)
    parts = (
        Fact("name", "camera", (camera.name,)),
        Fact("body", "camera body, serial number", (identity.body or NOT_DECLARED,)),
        Fact("lens", "lens, serial number", (identity.lens or NOT_DECLARED,)),
        Fact("imu", "inertial unit, serial number", (identity.imu or NOT_DECLARED,)),
        Fact("mount", "installation in the aircraft", (identity.mount or NOT_DECLARED,)),
        Fact("product", "image", (_PRODUCTS[identity.product],)),
        Fact(
            "size_px",
            "size of the image, columns × rows",
            (Number(camera.columns), Number(camera.rows)),
            "px",
            " × ",
        ),
        Fact("size_mm", "the same on the focal plane", (Number(half[0], 3), Number(half[1], 3)), "mm", " × "),
        Fact("pixel_um", "pixel", (Number(camera.pixel_um, _decimals(camera.pixel_um)),), "µm"),
        Fact("mount_deg", "mounting κ, forward is", (_forward(camera.mount_deg),)),
        Fact(
            "calibration_axes_deg",
            "axes of additional parameters, turn against the image",
            (Number(camera.calibration_axes_deg),),
            "°",
        ),
    )
    blocks: list[Block] = [Facts("camera", "", parts)]
    missing = [words for words, value in _serials(material).items() if value is None]
    if missing:
        blocks.append(
            Words(
                f"The project does not declare: {', '.join(missing)}. Without it this certificate cannot be "
                "told from one of another unit of the same name.",
                "note",
            )
        )
    return Section("camera", "Camera", tuple(blocks))


def _serials(material: CertificateMaterial) -> dict[str, str | None]:
    identity = material.record.camera.identity
    return {
        "camera body": identity.body,
        "lens": identity.lens,
        "inertial unit": identity.imu,
        "installation": identity.mount,
    }


def _decimals(value: float) -> int:
    """Decimals a given number has, up to four."""
    return next((n for n in range(4) if round(value, n) == value), 4)


def _forward(mount_deg: int) -> str:
    """Mounting in words."""
    edge = {0: "+x (last column)", 90: "−y (last row)", 180: "−x (first column)", 270: "+y (first row)"}
    return f"{mount_deg}°: {edge[mount_deg]}"
