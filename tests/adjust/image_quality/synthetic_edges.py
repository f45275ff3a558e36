"""Synthetic edges: exact steps blurred, seen by square pixels, with noise, sharpened where asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import convolve, gaussian_filter
from scipy.special import ndtr

from adjust.arrays import Floats
from adjust.image_quality.edge_model import edge_values
from adjust.image_quality.edge_samples import EdgeLine

CROSS = np.array([[0.0, 1.0, 0.0], [1.0, -4.0, 1.0], [0.0, 1.0, 0.0]])
_SUB = 16


@dataclass(frozen=True)
class Kind:
    """Blur (px), slant (degrees), noise of the finished image and contrast (grey values), sharpening."""

    blur: float
    slant: float
    noise: float
    contrast: float = 120.0
    sharpening: float = 0.0
    size: int = 56
    length: float = 32.0


def unit_edge(
    distance: Floats, blur: float, values: Callable[[Floats], Floats], spread: float = 0.0
) -> Floats:
    """Values near the edge; further than 8 σ, half a diagonal and half a spread from it, 0 or 1 to 1e-15."""
    image = (distance > 0.0).astype(np.float64)
    near = np.abs(distance) < 8.0 * blur + 0.75 + 0.5 * spread
    image[near] = values(distance[near])
    return image


def blurred_step(distance: Floats, kind: Kind, angle: float) -> Floats:
    """Grey values by sampling every pixel 16 × 16 times: not the formulas that are tested."""
    at = (np.arange(_SUB) + 0.5) / _SUB - 0.5
    shifts = (at[:, None] * np.cos(angle) + at[None, :] * np.sin(angle)).ravel()
    return unit_edge(
        distance, kind.blur, lambda near: np.mean([ndtr((near + s) / kind.blur) for s in shifts], axis=0)
    )


def edge_image(kind: Kind, rng: np.random.Generator) -> tuple[Floats, EdgeLine]:
    """An image of one edge with a random place and quarter, and the edge as somebody might have found it."""
    quarter, side = rng.integers(4), rng.choice([-1.0, 1.0])
    angle = float(np.deg2rad(side * kind.slant) + quarter * 0.5 * np.pi)
    angle = float(np.angle(np.exp(1j * angle)))
    middle = 0.5 * kind.size + rng.uniform(-0.5, 0.5, 2)
    row, column = np.mgrid[: kind.size, : kind.size]
    distance = (column - middle[0]) * np.cos(angle) + (row - middle[1]) * np.sin(angle)
    image = 80.0 + kind.contrast * blurred_step(distance, kind, angle)
    # The mask raises the noise; it is asked for in the finished image.
    gain = np.hypot(1.0 + 4.0 * kind.sharpening, 2.0 * kind.sharpening)
    image = image + rng.normal(0.0, kind.noise / gain, image.shape)
    image = image - kind.sharpening * convolve(image, CROSS, mode="nearest")
    found = EdgeLine(
        float(middle[0] + rng.normal(0.0, 0.3)),
        float(middle[1] + rng.normal(0.0, 0.3)),
        angle + float(rng.normal(0.0, 0.01)),
        kind.length,
    )
    return image, found


def scene(blur: float, noise: float, rng: np.random.Generator, size: int = 480) -> Floats:
    """Bright squares of 60 px on a dark ground, all turned differently by more than 3° from the pixels."""
    image = np.full((size, size), 90.0)
    row, column = np.mgrid[-80:80, -80:80].astype(np.float64)
    for top in range(0, size - 159, 160):
        for left in range(0, size - 159, 160):
            turn = np.deg2rad(rng.uniform(3.0, 42.0))
            across, down = rng.uniform(-20.0, 20.0, 2)
            square = np.ones(row.shape)
            for quarter in range(4):
                angle = turn + quarter * 0.5 * np.pi
                distance = 30.0 - (column - across) * np.cos(angle) - (row - down) * np.sin(angle)
                square *= unit_edge(
                    distance, blur, lambda near, at=angle: edge_values(near, blur**2, at).value
                )
            image[top : top + 160, left : left + 160] += 100.0 * square
    return image + rng.normal(0.0, noise, image.shape)


def texture(rng: np.random.Generator, size: int = 480) -> Floats:
    """Grass, gravel, forest: noise of the scene at several scales, as strong as edges."""
    image = np.full((size, size), 120.0)
    for scale in (0.7, 1.5, 3.0, 6.0):
        layer = gaussian_filter(rng.normal(0.0, 1.0, (size, size)), scale)
        image += 22.0 * layer / layer.std()
    return image
