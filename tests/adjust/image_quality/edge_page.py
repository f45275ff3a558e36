"""Every edge that is found in images, with its surroundings, on a page to be looked at.

``python -m tests.adjust.image_quality.edge_page PAGE.html IMAGE…``; prints image, column and row of each.
"""

from __future__ import annotations

import sys
from base64 import b64encode
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from adjust.image_quality.edge_measurement import MeasuredEdge
from tasks.image_files.image_reader import opened_image, raster_environment
from tasks.image_quality.scenes import examined_scene

HALF, ENLARGED = 48, 3


def crops(path: Path) -> Iterator[str]:
    """HTML of a picture for each edge of the second band (green); its words end with contrast / noise."""
    scene = examined_scene(path)
    about = scene.description
    band = scene.bands[min(1, len(scene.bands) - 1)]
    with opened_image(path) as reader:
        for number, edge in enumerate(band.edges.edges, start=1):
            left, top = (
                int(np.clip(at - HALF, 0, max(size - 2 * HALF, 0)))
                for at, size in ((edge.line.column, about.columns), (edge.line.row, about.rows))
            )
            window = (top, min(top + 2 * HALF, about.rows)), (left, min(left + 2 * HALF, about.columns))
            print(f"{path.name},{edge.line.column:.0f},{edge.line.row:.0f}")
            yield _crop(reader.read(*window)[:3], edge, (left, top), f"{path.name} {number}")


def _crop(pixels: Any, edge: MeasuredEdge, origin: tuple[int, int], name: str) -> str:
    """The crop, and the same with the edge drawn as a line outside of the pixels used."""
    line, size = edge.line, 2 * HALF * ENLARGED
    x, y = ((at - first + 0.5) * ENLARGED for at, first in zip((line.column, line.row), origin, strict=True))
    along = 0.5 * line.length * ENLARGED * np.array([-np.sin(line.angle), np.cos(line.angle)])
    image = f'<image href="data:image/png;base64,{_png(pixels)}" width="{size}" height="{size}"/>'
    drawn = (
        f'<line x1="{x - along[0]:.1f}" y1="{y - along[1]:.1f}" x2="{x + along[0]:.1f}" '
        f'y2="{y + along[1]:.1f}" stroke="red" stroke-width="1"/>'
    )
    fit = edge.fit
    words = f"{name}: factor {fit.factor:.2f} ± {fit.sigma_factor:.2f}, {fit.contrast:.0f} / {edge.noise:.1f}"
    beside = f'<g transform="translate({size + 6})">{image}{drawn}</g>'
    svg = f'<svg width="{2 * size + 6}" height="{size}">{image}{beside}</svg>'
    return f"<figure>{svg}<figcaption>{words}</figcaption></figure>"


def _png(pixels: Any) -> str:
    bands = pixels if len(pixels) == 3 else np.repeat(pixels[:1], 3, axis=0)
    grey = np.repeat(np.repeat(bands.astype(np.float64), ENLARGED, axis=1), ENLARGED, axis=2)
    grey = np.clip(255.0 * (grey - grey.min()) / max(float(np.ptp(grey)), 1.0), 0.0, 255.0).astype(np.uint8)
    shape = {"driver": "PNG", "count": 3, "dtype": "uint8", "height": grey.shape[1], "width": grey.shape[2]}
    with raster_environment() as rasterio, rasterio.MemoryFile() as memory:
        with memory.open(**shape) as file:
            file.write(grey)
        return b64encode(memory.read()).decode()


def main() -> None:
    """Write the page."""
    page, *images = (Path(name) for name in sys.argv[1:])
    style = "figure{display:inline-block;margin:4px;font:12px sans-serif}figcaption{max-width:580px}"
    body = "".join(crop for image in images for crop in crops(image))
    page.write_text(f'<!DOCTYPE html><meta charset="utf-8"><style>{style}</style>{body}', encoding="utf-8")


if __name__ == "__main__":
    main()
