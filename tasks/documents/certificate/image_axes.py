"""Drawing of the image: pixels, axes, principal point, and where forward and right of the aircraft are.

With the mounting T = diag(1, −1, −1) R_z(κ_mount) the direction of flight in the image is
(cos κ_mount, −sin κ_mount): +x for 0°, −y for 90°, −x for 180°, +y for 270°. The camera looks down, so that
right of the aircraft is a quarter turn clockwise from forward in the image seen from above.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from tasks.document_kit import markup, palette
from tasks.documents.certificate.material import CertificateMaterial

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
    x, y = frame.middle
    box = {
        "x": x - frame.half[0],
        "y": y - frame.half[1],
        "width": 2.0 * frame.half[0],
        "height": 2.0 * frame.half[1],
    }
    return markup.element("rect", {**box, "class": "frame"})


def _arrow(x: float, y: float, dx: float, dy: float, colour: str, width: str = "1.6") -> Markup:
    path = markup.arrow(x, y, dx, dy, 9.0)
    return markup.element("path", {"d": path, "stroke": colour, "stroke-width": width, "fill": "none"})


def _pixels(frame: _Frame, columns: int, rows: int) -> Markup:
    """Origin of the pixels and the ways in which they are counted, along the edges."""
    left, top = frame.middle[0] - frame.half[0], frame.middle[1] - frame.half[1]
    ink = palette.INK
    return markup.group(
        "pixels",
        [
            markup.element("circle", {"cx": left, "cy": top, "r": "3.2", "fill": ink}),
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
            markup.element("circle", {"cx": x, "cy": y, "r": "3.2", "fill": blue}),
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
    x0, y0 = (f"{value:+.1f}".replace("-", "−") for value in x0_y0_um)
    below = frame.middle[1] + _OFFSET + 34
    return markup.group(
        "principal-point",
        [
            markup.element("path", {"d": cross, "stroke": colour, "stroke-width": "2.2", "fill": "none"}),
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
