"""Alpha that is multiplied into the grey values is seen, and stays so in what is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio

from tasks.image_files.associated_alpha import has_associated_alpha
from tasks.image_files.image_reader import opened_image
from tasks.image_files.image_writer import image_like


def image(path: Path, bands: int = 4, **options: object) -> Path:
    kind = {"driver": "GTiff", "width": 64, "height": 48, "count": bands, "dtype": "uint8", **options}
    with rasterio.open(path, "w", **kind) as dataset:
        dataset.write(np.full((bands, 48, 64), 7, np.uint8))
    return path


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
@pytest.mark.parametrize("form", [{}, {"bigtiff": "yes"}, {"endianness": "big"}, {"bands": 9}])
@pytest.mark.parametrize(("alpha", "expected"), [("premultiplied", True), ("yes", False), ("no", False)])
def test_it_is_seen(tmp_path: Path, form: dict[str, object], alpha: str, expected: bool) -> None:
    path = image(tmp_path / "a.tif", photometric="rgb", alpha=alpha, **form)
    assert has_associated_alpha(path) == expected
    path.write_bytes(path.read_bytes()[:12])
    assert not has_associated_alpha(path)


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
@pytest.mark.parametrize("alpha", ["premultiplied", "yes"])
def test_what_is_written_says_the_same(tmp_path: Path, alpha: str) -> None:
    path = image(tmp_path / "a.tif", photometric="rgb", alpha=alpha)
    with opened_image(path) as source, image_like(source, tmp_path / "b.tif") as writer:
        del writer
    assert has_associated_alpha(tmp_path / "b.tif") == (alpha == "premultiplied")
    assert not has_associated_alpha(image(tmp_path / "a.png", driver="PNG"))
