"""Section of the camera: what was calibrated, identified by its serial numbers, and its heads.

Its drawing of the image shows pixels, axes, principal point, and where forward and right of the aircraft are.
With the mounting T = diag(1, −1, −1) R_z(κ_mount) the direction of flight in the image is
(cos κ_mount, −sin κ_mount): +x for 0°, −y for 90°, −x for 180°, +y for 270°. The camera looks down, so that
right of the aircraft is a quarter turn clockwise from forward in the image seen from above.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from tasks.document_kit import axes, markup, palette
from tasks.document_kit.table import Number
from tasks.documents.certificate.content import Block, Fact, Facts, Figure, Listing, Section, Words
from tasks.documents.certificate.effect_section import cut_to_format
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.report.rig_heads import HEADS_NOTE, has_heads, head_tables, platform_table
from tasks.documents.report.virtual_image import virtual_image_plot, virtual_image_table, virtual_images
from tasks.settings.camera_identity import CameraIdentity

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


# Width of the drawing, the longer side of the image in it, and the room above and below the image.
_WIDTH, _SIDE, _ROOM = 700.0, 340.0, 80.0
# How far from the middle the principal point is drawn.
_OFFSET = 26.0


@dataclass(frozen=True)
class _Frame:
    """Half of the image's width and height in the drawing, and where its middle is."""

    half: tuple[float, float]

    @property
    def middle(self) -> tuple[float, float]:
        return 0.5 * _WIDTH, self.half[1] + _ROOM

    @property
    def height(self) -> float:
        """Of the whole drawing."""
        return 2.0 * self.middle[1]


def forward_in_image(mount_deg: int) -> tuple[int, int]:
    """Direction of flight in the image system: x, y, one of them ±1."""
    turns = (mount_deg // 90) % 4
    return ((1, 0), (0, -1), (-1, 0), (0, 1))[turns]


def image_axes(material: CertificateMaterial) -> Markup:
    """The drawing."""
    camera = material.record.camera
    scale = _SIDE / max(camera.columns, camera.rows)
    x0_y0 = _principal_point_um(material)
    frame = _Frame((0.5 * camera.columns * scale, 0.5 * camera.rows * scale))
    parts = [
        _format(frame),
        _pixels(frame, camera.columns, camera.rows),
        _axes(frame, x0_y0[0]),
        _principal_point(frame, x0_y0),
        *_flight(frame, forward_in_image(camera.mount_deg)),
    ]
    words = "Image axes, principal point and direction of flight"
    return markup.svg(_WIDTH, frame.height, words, markup.group("image-axes", parts))


def _principal_point_um(material: CertificateMaterial) -> tuple[float, float]:
    """x0 and y0 of the record, µm; given values where they were not estimated."""
    values = {item.parameter: item.value for item in material.record.parameters}
    camera = material.results.cameras[material.record.camera.name]
    given = camera.principal_point
    x0, y0 = (
        1e3 * values.get(f"principal_point_{axis}", 1e3 * float(given[k])) for k, axis in enumerate("xy")
    )
    return x0, y0


def _format(frame: _Frame) -> Markup:
    (x, y), (half_x, half_y) = frame.middle, frame.half
    return axes.frame(x - half_x, y - half_y, x + half_x, y + half_y)


def _arrow(x: float, y: float, dx: float, dy: float, colour: str, width: str = "1.6") -> Markup:
    path = markup.arrow(x, y, dx, dy, 9.0)
    return markup.element("path", d=path, stroke=colour, stroke_width=width, fill="none")


def _pixels(frame: _Frame, columns: int, rows: int) -> Markup:
    """Origin of the pixels and the ways in which they are counted, along the edges."""
    left, top = frame.middle[0] - frame.half[0], frame.middle[1] - frame.half[1]
    ink = palette.INK
    return markup.group(
        "pixels",
        [
            markup.circle(left, top, 3.2, fill=ink),
            markup.text(left + 6, top + 17, "pixel (0, 0)", "start"),
            _arrow(left, top - 10, 70, 0, ink),
            markup.text(left + 76, top - 6, f"column, {columns:,}", "start"),
            _arrow(left - 10, top, 0, 70, ink),
            markup.text(left - 16, top + 40, f"row, {rows:,}", "end"),
        ],
    )


def _axes(frame: _Frame, x0: float) -> Markup:
    """The axes x and y from the format centre."""
    x, y = frame.middle
    blue, long = palette.category(0), 0.62
    beside = -8 if x0 >= 0.0 else 8
    return markup.group(
        "axes",
        [
            _arrow(x, y, long * frame.half[0], 0, blue, "2.2"),
            markup.text(x + long * frame.half[0] + 8, y + 5, "x", "start", "halo"),
            _arrow(x, y, 0, -long * frame.half[1], blue, "2.2"),
            markup.text(x - 4, y - long * frame.half[1] - 8, "y", "middle", "halo"),
            markup.circle(x, y, 3.2, fill=blue),
            # On the side where the principal point is not.
            markup.text(x + beside, y + 18, "format centre", "end" if x0 >= 0.0 else "start"),
        ],
    )


def _principal_point(frame: _Frame, x0_y0_um: tuple[float, float]) -> Markup:
    """A cross towards the side on which the principal point lies, with its coordinates."""
    length = float(np.hypot(*x0_y0_um))
    dx, dy = (0.0, 0.0) if length == 0.0 else (v / length * _OFFSET for v in x0_y0_um)
    x, y, colour = frame.middle[0] + dx, frame.middle[1] - dy, palette.ACCENT
    cross = f"M{markup.number(x - 6)},{markup.number(y)}h12M{markup.number(x)},{markup.number(y - 6)}v12"
    x0, y0 = (f"{value:+z.1f}".replace("-", "−") for value in x0_y0_um)
    below = frame.middle[1] + _OFFSET + 34
    return markup.group(
        "principal-point",
        [
            markup.element("path", d=cross, stroke=colour, stroke_width="2.2", fill="none"),
            markup.text(frame.middle[0], below, "+ principal point", "middle"),
            markup.text(frame.middle[0], below + 17, f"x0 {x0} µm, y0 {y0} µm", "middle"),
        ],
    )


def _flight(frame: _Frame, forward: tuple[int, int]) -> list[Markup]:
    """The direction of flight outside the edge it points to, and right of the aircraft."""
    colour = palette.category(2)
    right = (forward[1], -forward[0])
    drawn = []
    for (fx, fy), words in ((forward, "direction of flight"), (right, "right of the aircraft")):
        x, y = frame.middle[0] + fx * (frame.half[0] + 24), frame.middle[1] - fy * (frame.half[1] + 24)
        drawn.append(_arrow(x, y, fx * 46, -fy * 34, colour, "3"))
        # Beside an upright arrow, and over a level one, so that nothing leaves the drawing.
        place = (x + 12, y - fy * 20 + 5, words, "start") if fy else (x + fx * 46, y - 14, words, "middle")
        drawn.append(markup.text(*place, css_class="label"))
    return drawn
