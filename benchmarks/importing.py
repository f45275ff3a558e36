"""The import of image points from CSV: points per second and memory.

``python -m benchmarks.importing FOLDER RESULTS`` is a process of its own and answers with a line of JSON.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks.machine import REPOSITORY, machine, peak_memory_mib
from benchmarks.record import IMPORT, Record

POINTS = 10_000_000
# As in the operational block: points of an image, and images of a point.
_OF_IMAGE, _RAYS = 225, 3
_STRIP = 250
_PROJECT = """\
version = 1
[project]
name = "import"
crs = "EPSG:32632"
heights = "ellipsoidal"
[cameras.CAM]
columns = 10000
rows = 8000
pixel_um = 5.0
focal_length_mm = 100.0
principal_point_mm = [0.0, 0.0]
pixel_origin = "corner"
mount_deg = 0
[inputs.image_points]
file = "points.csv"
format = "csv"
unit = "px"
[inputs.exposures]
file = "exposures.csv"
format = "csv"
crs = "EPSG:32632"
heights = "ellipsoidal"
position = "antenna"
angles = { order = "omega-phi-kappa", unit = "deg", reference = "grid" }
"""


@dataclass(frozen=True)
class Import:
    """One import.

    Attributes
    ----------
    clock_s, processor_s : seconds it took.
    rows : image points in the table; 0 if the file is refused.
    refused : why.
    memory_mib : what it took beyond what the process had before.
    peak_memory_mib : of the process.
    """

    clock_s: float
    processor_s: float
    rows: int
    refused: str
    memory_mib: float
    peak_memory_mib: float


def importing(runs: int, count: int = POINTS) -> Record:
    """Import as many image points several times, each in its own process and into an empty store."""
    with tempfile.TemporaryDirectory(prefix="aerocal-bench-") as name:
        folder = Path(name).resolve()
        write_delivery(folder, count)
        done = [imported(folder, folder / f"results-{run}") for run in range(runs)]
    seconds = [run.clock_s for run in done]
    return Record(
        name=f"{IMPORT}{count}",
        ours_s=median(seconds),
        ours_min_s=min(seconds),
        ours_max_s=max(seconds),
        runs=runs,
        included="stage import_image_points: CSV file to Parquet table in the store",
        machine=machine(),
        images=-(-count // _OF_IMAGE),
        image_points=count,
        processor_s=median(run.processor_s for run in done),
        peak_memory_mib=max(run.peak_memory_mib for run in done),
    )


def imported(folder: Path, results: Path) -> Import:
    """Import the image points of a folder in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.importing", str(folder), str(results)]
    done = subprocess.run(command, cwd=REPOSITORY, stdout=subprocess.PIPE, text=True, check=True)
    return Import(**json.loads(done.stdout))


def write_delivery(folder: Path, count: int, row: str = "{image},{point:06d},{x:.3f},{y:.3f}") -> Path:
    """Write a project of so many image points, each point in three images one after the other.

    Parameters
    ----------
    row : of the file of image points; besides these there is ``own``, a number that no other row has.

    Returns
    -------
    file : the file of image points.
    """
    (folder / "project.toml").write_text(_PROJECT, encoding="utf-8")
    images = -(-count // _OF_IMAGE)
    names = [f"{image // _STRIP + 1:02d}_{image % _STRIP:05d}" for image in range(images)]
    with (folder / "exposures.csv").open("w", encoding="utf-8") as stream:
        stream.write("image,camera,strip,x,y,z,omega,phi,kappa\n")
        for image, name in enumerate(names):
            x, y = 500_000 + 400 * (image % _STRIP), 5_300_000 + 1_000 * (image // _STRIP)
            stream.write(f"{name},CAM,{image // _STRIP + 1},{x},{y},2000,0.1,-0.2,10\n")
    random = np.random.default_rng(5)
    with (folder / "points.csv").open("w", encoding="utf-8") as stream:
        stream.write("image,point,x,y\n")
        for image, name in enumerate(names):
            first = _OF_IMAGE * image
            xy = random.uniform(0.0, [10_000.0, 8_000.0], (min(_OF_IMAGE, count - first), 2)).tolist()
            stream.writelines(
                row.format(image=name, point=_OF_IMAGE // _RAYS * image + at, x=x, y=y, own=first + at) + "\n"
                for at, (x, y) in enumerate(xy)
            )
    return folder / "points.csv"


def main(folder: str, results: str) -> None:
    """Import the image points of a folder into an empty store."""
    from tasks.errors import InputError
    from tasks.settings.load import load_project
    from tasks.stages.ingest import import_exposures, import_image_points
    from tasks.store.store import Store

    project = load_project(Path(folder) / "project.toml", ())
    store = Store.of(Path(results))
    read = import_exposures(
        store, sources=project.inputs.exposures, cameras=project.cameras, project=project.project
    )
    import pyarrow.csv  # noqa: F401  (what every process loads once is not counted)

    before, processor_s, begin = peak_memory_mib(), _processor_s(), time.perf_counter()
    rows, refused = 0, ""
    try:
        outputs = import_image_points(
            store, sources=project.inputs.image_points, exposures=read["exposures"], cameras=read["cameras"]
        )
        rows = outputs["image_points"].rows or 0
    except InputError as error:
        refused = error.what
    answer = {
        "clock_s": time.perf_counter() - begin,
        "processor_s": _processor_s() - processor_s,
        "rows": rows,
        "refused": refused,
        "memory_mib": peak_memory_mib() - before,
        "peak_memory_mib": peak_memory_mib(),
    }
    print(json.dumps(answer))


def _processor_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


if __name__ == "__main__":
    main(*sys.argv[1:])
