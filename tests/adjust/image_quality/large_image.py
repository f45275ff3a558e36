"""Time and memory of an image of 13,080 × 20,010 pixels in four bands.

``python -m tests.adjust.image_quality.large_image FOLDER [THREADS]``
"""

from __future__ import annotations

import hashlib
import logging
import pickle
import resource
import sys
import time
from pathlib import Path

import numpy as np

from tasks.image_files.image_reader import raster_environment
from tasks.image_quality.measurement import Progress
from tasks.image_quality.scenes import examined_scene
from tests.adjust.image_quality.synthetic_edges import scene

ROWS, COLUMNS, BLURS, STRIP = 13_080, 20_010, (0.35, 0.4, 0.45, 0.6), 480


def write_large(path: Path) -> None:
    """Squares everywhere, 16 bit, a different blur in every band; the same strip again and again."""
    rng = np.random.default_rng(1)
    strips = []
    for number, blur in enumerate(BLURS):
        tiled = np.tile(scene(blur, 0.0, np.random.default_rng(number)), (1, 42))[:, :COLUMNS]
        noise = np.tile(rng.normal(0.0, 40.0, (STRIP, 3000)), (1, 7))[:, :COLUMNS]
        strips.append(np.rint(20.0 * tiled + noise).astype(np.uint16))
    pixels = np.stack(strips)
    shape = {"width": COLUMNS, "height": ROWS, "count": len(BLURS), "dtype": "uint16"}
    kind = {"driver": "GTiff", "interleave": "band", "blockysize": 8, "BIGTIFF": "YES"}
    with raster_environment() as rasterio, rasterio.open(path, "w", **shape, **kind) as file:
        for first in range(0, ROWS, STRIP):
            last = min(first + STRIP, ROWS)
            file.write(pixels[:, : last - first], window=((first, last), (0, COLUMNS)))


def main() -> None:
    """Write the image if it is not there, examine it, print time and memory."""
    path = Path(sys.argv[1]) / "large.tif"
    if not path.exists():
        write_large(path)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    clock, processor = time.perf_counter(), time.process_time()
    threads = int(sys.argv[2]) if len(sys.argv) > 2 else None
    found = examined_scene(path, None, Progress(path.name).tell, threads)
    clock, processor = time.perf_counter() - clock, time.process_time() - processor
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{clock:.0f} s on the clock, {processor:.0f} s of processor time, {memory:.0f} MB")
    values = [(edge.line, edge.fit.values.tobytes()) for band in found.bands for edge in band.edges.edges]
    print("sha256 of all edges", hashlib.sha256(pickle.dumps(values)).hexdigest()[:16])
    for band in found.bands:
        factors = [edge.fit.factor for edge in band.edges.edges]
        print(f"band {band.band}: {len(factors)} edges, factor {np.mean(factors):.3f}")


if __name__ == "__main__":
    main()
