"""Edges in real aerial images: only those that somebody has looked at and seen to be edges of objects.

Where AEROCAL_AERIAL_IMAGES names no folder with the images, there is nothing to test. They are

- DJI_0018 to DJI_0035.JPG of github.com/pierotofy/drone_dataset_brighton_beach (BSD 2-Clause): forest, grass,
  roads, cars, a shelter, a shore; drone, processed by the camera;
- IMG_0022 to IMG_0148.jpg of github.com/OpenDroneMap/odm_data_copr (CC BY-SA 4.0): sand, shrubs, targets;
  kite, soft images with colour fringes;
- m_4709963_se_14_1_*.tif of github.com/opengeos/data, folder naip (images of the USDA; the repository is
  under MIT): fields and lakes, resampled.

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


def looked_at() -> list[tuple[str, float, float]]:
    """Image, column and row of the edges."""
    with _LOOKED_AT.open(encoding="utf-8", newline="") as file:
        return [(row["image"], float(row["column"]), float(row["row"])) for row in csv.DictReader(file)]


def image_files() -> list[Path]:
    """The images that there are here."""
    folder = os.environ.get("AEROCAL_AERIAL_IMAGES")
    kinds = ("DJI_*.JPG", "IMG_*.jpg", "m_*.tif") if folder else ()
    return [path for kind in kinds for path in sorted(Path(folder or "").rglob(kind))]


@pytest.mark.skipif(not image_files(), reason="AEROCAL_AERIAL_IMAGES names no folder of aerial images")
def test_the_images_that_have_edges_are_there() -> None:
    assert {image for image, _, _ in looked_at()} <= {path.name for path in image_files()}


@pytest.mark.parametrize("image", image_files(), ids=lambda path: path.name)
def test_only_edges_are_found_that_were_seen_to_be_edges(image: Path) -> None:
    seen = np.array([place for name, *place in looked_at() if name == image.name]).reshape(-1, 2)
    edges = examined_scene(image).bands[1].edges.edges
    found = np.array([[edge.line.column, edge.line.row] for edge in edges]).reshape(-1, 2)
    apart = np.hypot(*(seen[:, None] - found[None]).T).reshape(len(found), len(seen))
    unseen = found[~(apart < _SAME).any(axis=1)].round().tolist()
    assert not unseen, "look at these edges with edge_page"
    assert (apart < _SAME).any(axis=0).all(), "edges that were found before are missing"
