"""Edges in real aerial images: only those that somebody has looked at and seen to be edges of objects.

Where AEROCAL_AERIAL_IMAGES names no folder with the images, there is nothing to test. They are

- DJI_0018 to DJI_0035.JPG of github.com/pierotofy/drone_dataset_brighton_beach (BSD 2-Clause): forest, grass,
  roads, cars, a shelter, a shore; drone, processed by the camera;
- IMG_0022 to IMG_0148.jpg of github.com/OpenDroneMap/odm_data_copr (CC BY-SA 4.0): sand, shrubs, targets;
  kite, soft images with colour fringes;
- m_4709963_se_14_1_*.tif of github.com/opengeos/data, folder naip (images of the USDA, public domain):
  fields and lakes, resampled.

`edge_page` shows the edges; ``aerial_edges.csv`` has those that were looked at, one by one.
"""

from __future__ import annotations

import csv
import os
from pathlib import Path

import numpy as np
import pytest

from tasks.image_quality.scenes import examined_scene

_LOOKED_AT = Path(__file__).parent / "aerial_edges.csv"
#: How far the same edge may be found from where it was, px.
_SAME = 24.0


@pytest.fixture(scope="module")
def images() -> dict[str, Path]:
    folder = os.environ.get("AEROCAL_AERIAL_IMAGES")
    if folder is None:
        pytest.skip("AEROCAL_AERIAL_IMAGES names no folder of aerial images")
    kinds = ("DJI_*.JPG", "IMG_*.jpg", "m_*.tif")
    return {path.name: path for kind in kinds for path in sorted(Path(folder).rglob(kind))}


def test_no_edge_is_found_in_aerial_images_that_was_not_seen_to_be_one(images: dict[str, Path]) -> None:
    with _LOOKED_AT.open(encoding="utf-8", newline="") as file:
        rows = [(row["image"], float(row["column"]), float(row["row"])) for row in csv.DictReader(file)]
    assert {name for name, _, _ in rows} <= set(images)
    unseen, found = [], 0
    for name, path in images.items():
        seen = np.array([place for image, *place in rows if image == name]).reshape(-1, 2)
        for edge in examined_scene(path).bands[1].edges.edges:
            found += 1
            place = np.array([edge.line.column, edge.line.row])
            if not (np.hypot(*(seen - place).T) < _SAME).any():
                unseen.append(f"{name} {place.round()}")
    assert not unseen, "look at these edges with edge_page"
    assert found > 0.9 * len(rows)
