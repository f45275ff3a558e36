"""Section of the camera: what was calibrated, identified by its serial numbers, and its heads."""

from __future__ import annotations

from tasks.document_kit.table import Number
from tasks.documents.certificate.content import Block, Fact, Facts, Figure, Listing, Section, Words
from tasks.documents.certificate.effect_section import cut_to_format
from tasks.documents.certificate.image_axes import image_axes
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.report.rig_heads import HEADS_NOTE, has_heads, head_tables, platform_table
from tasks.documents.report.virtual_image import virtual_image_plot, virtual_image_table, virtual_images
from tasks.settings.cameras import CameraIdentity

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
        *(Fact(key, label, (value,) if value else ()) for key, label, value in _declared(identity)),
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
    )
    heads = tuple(
        Fact(
            f"head-{number}",
            f"head {head.name}, columns × rows",
            (Number(head.columns), Number(head.rows)),
            f"px of {head.pixel_um:g} µm",
            " × ",
        )
        for number, head in enumerate(material.record.heads, start=1)
    )
    blocks: list[Block] = [Facts("camera", "", parts)]
    if heads:
        blocks.append(Facts("heads", f"Other heads of the rig of {camera.name}, calibrated together", heads))
    missing = [label.partition(",")[0] for _, label, value in _declared(identity) if not value]
    if missing:
        blocks.append(
            Words(
                f"The project does not declare: {', '.join(missing)}. Entries by hand are not part of the "
                "record that the verification code protects.",
                "note",
            )
        )
    return Section("camera", "Camera", tuple(blocks))


def axes_section(material: CertificateMaterial) -> Section:
    """How pixels and image coordinates are counted, and how the camera sits in the aircraft."""
    camera = material.record.camera
    origin = material.results.project.cameras[camera.name].pixel_origin
    facts = (
        Fact("mount_deg", "mounting κ, forward is", (_forward(camera.mount_deg),)),
        Fact("pixel_origin", "pixel (0, 0) is the", (f"{origin} of the top-left pixel",)),
        Fact(
            "calibration_axes_deg",
            "axes of additional parameters, rotated by",
            (Number(camera.calibration_axes_deg), "° counter-clockwise relative to x, y"),
            joint="",
        ),
    )
    drawing = Figure(
        "image-axes",
        "The image as displayed on the screen, with the ground seen from above. Pixels are counted from the "
        "top-left corner, x and y from the format centre. The cross of the principal point shows its "
        "direction from the format centre; the distance is not to scale.",
        "Image axes, principal point and direction of flight",
        image_axes(material),
        0.8,
    )
    return Section("axes", "Image axes and mounting", (Facts("axes", "", facts), drawing))


def _declared(identity: CameraIdentity) -> tuple[tuple[str, str, str | None], ...]:
    """Key, label and value of what only the project can say about the camera."""
    return (
        ("manufacturer", "manufacturer", identity.manufacturer),
        ("type", "type", identity.type),
        ("body", "camera body, serial number", identity.body),
        ("lens", "lens, serial number", identity.lens),
        ("imu", "inertial unit, serial number", identity.imu),
        ("mount", "installation in the aircraft", identity.mount),
        *(
            (name, words, value)
            for name, words, value in (
                ("band", "spectral band", identity.band),
                ("software", "version of the image software", identity.software),
            )
            if value
        ),
    )


def _decimals(value: float) -> int:
    """Decimals a given number has, up to four."""
    return next((n for n in range(4) if round(value, n) == value), 4)


def _forward(mount_deg: int) -> str:
    """Mounting in words."""
    edge = {0: "+x (last column)", 90: "−y (last row)", 180: "−x (first column)", 270: "+y (first row)"}
    return f"{mount_deg}°: {edge[mount_deg]}"


def rig_section(material: CertificateMaterial) -> Section | None:
    """Heads against their reference head, and the platform calibration; None for a camera alone."""
    results = material.results
    if not has_heads(results):
        return None
    blocks: list[Block] = [
        Listing(table, ("correlated_with",)) for table in head_tables(results) if table.rows
    ]
    blocks.append(
        Words(
            HEADS_NOTE,
            "note",
        )
    )
    if not results.platform.empty:
        images = virtual_images(results)
        blocks.append(Listing(platform_table(results)))
        for number, image in enumerate(images, start=1):
            caption = (
                f"Virtual image of {image.name}: errors of an image composed with the given attitudes "
                "instead of the calibrated ones, for the mean height above ground."
            )
            figure = Figure(
                f"virtual-image-{number}",
                caption,
                f"Errors in the virtual image of {image.name}, up to {image.longest_um:.1f} µm",
                virtual_image_plot(image),
            )
            blocks.append(cut_to_format(figure, image.half_format))
        blocks.append(Listing(virtual_image_table(images)))
    return Section("rig", "Heads of the rig", tuple(blocks))
