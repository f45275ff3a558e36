"""A second head of the camera of a simulated delivery, which shares its readings of GNSS and INS."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd


def add_second_head(folder: Path, later_us: int = 0, camera: str | None = None) -> None:
    """Every exposure once more, some microseconds later, by a camera of another name; None: of the same."""
    exposures, image_points = folder / "exposures.csv", folder / "image_points.csv"
    table, points = pd.read_csv(exposures, dtype=str), pd.read_csv(image_points, dtype=str)
    time = (table["time"].astype(float) + 1e-6 * later_us).map("{:.6f}".format)
    again = table.assign(image="B" + table["image"], time=time)
    if camera is not None:
        file, first = folder / "project.toml", table["camera"].iloc[0]
        text = file.read_text(encoding="utf-8")
        begin, end = text.index(f"[cameras.{first}]"), text.index("[inputs.image_points]")
        file.write_text(text[:end] + text[begin:end].replace(first, camera) + text[end:], encoding="utf-8")
        again = again.assign(camera=camera)
    pd.concat([table, again]).to_csv(exposures, index=False)
    # Measured by itself: the same coordinates would be the same image delivered twice.
    own = points.assign(image="B" + points["image"])
    generator = np.random.default_rng(3)
    for axis in "xy":
        own[axis] = points[axis].astype(float) + generator.normal(0.0, 0.001, len(points))
    pd.concat([points, own]).to_csv(image_points, index=False)
