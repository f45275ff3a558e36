"""`aerocal adjust` on 60 photos of the Arch of Constantine: all that DBAT prints.

90,561 image points of 26,321 points, c, x0, y0, K1 and K2 free, no control. DBAT fixes the first image and
one coordinate of another; here they are observed to 1 µm and 1.4 mas, and the 353 other coordinates and
angles to 1 km and 180°: of such observations only the datum is left. The text files and the report are in
DBAT's public repository: see `test_dbat_aerial`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tests.golden.dbat import Report, read_report

CENTRE = {"Xc": "x", "Yc": "y", "Zc": "z"}
ANGLES = {"Omega": "omega", "Phi": "phi", "Kappa": "kappa"}
#: Image and label of what is fixed.
DATUM = {(1, label) for label in (*CENTRE, *ANGLES)} | {(19, "Yc")}
#: Observations that only stand for unknowns without observation, or are the datum.
FORMAL = 6 * 60
#: Standard deviations: DBAT ends at a step with ‖J dx‖ ≤ 1e-6 ‖r‖.
LEFT_OPEN = 1e-6 * np.sqrt(101801)
PIXEL_MM = 24.0 / 3744

PROJECT = f"""\
version = 1
[project]
name = "roma"
crs = "local"
[cameras.canon]
columns = 5616
rows = 3744
pixel_um = {1e3 * PIXEL_MM!r}
focal_length_mm = 24.3581
principal_point_mm = [0.1143, 0.0]
pixel_origin = "corner"
mount_deg = 0
[inputs.image_points]
file = "marks.csv"
format = "csv"
unit = "px"
sigma = 1.0
[inputs.exposures]
file = "exposures.csv"
format = "csv"
crs = "local"
position = "projection_centre"
angles = {{ order = "omega-phi-kappa", unit = "deg", reference = "grid" }}
[adjustment]
observe = ["gnss", "ins"]
free = ["focal_length", "principal_point"]
refraction = "none"
rejection = "none"
self_calibration = {{ parameters = "brown_mm:K1-K2", elimination = "none" }}
"""


@dataclass(frozen=True, eq=False)
class Adjusted:
    """What DBAT printed, and our summary and tables; ``scale`` turns our σ into those without datum."""

    printed: Report
    summary: dict
    tables: dict[str, pd.DataFrame]
    scale: float


@pytest.fixture(scope="module")
def adjusted(dbat: Path, tmp_path_factory: pytest.TempPathFactory) -> Adjusted:
    source, folder = dbat / "data/script/romabundledemo", tmp_path_factory.mktemp("roma")
    names = ["image", "point", "x", "y"]
    marks = pd.read_csv(source / "measurements/markpts.txt", comment="#", header=None, names=names)
    marks.to_csv(folder / "marks.csv", index=False)
    names = ["image", "x", "y", "z", "omega", "phi", "kappa"]
    exposures = pd.read_csv(source / "prior/initial_eo.txt", comment="#", header=None, names=names)
    for label, name in (*CENTRE.items(), *ANGLES.items()):
        fixed, free = (1e-6, 1e3) if label in CENTRE else (4e-7, 180.0)
        exposures[f"s{name}"] = [fixed if (k, label) in DATUM else free for k in exposures["image"]]
    exposures[["camera", "strip"]] = ["canon", ""]
    exposures.to_csv(folder / "exposures.csv", index=False)
    (folder / "project.toml").write_text(PROJECT)
    outcome = carry_out(aerial_triangulation, RunRequest(folder / "project.toml"))
    assert outcome.error is None, outcome.error
    names = ["parameters", "exterior_orientations", "object_points", "residuals"]
    tables = {name: pd.read_parquet(outcome.directory / f"{name}.parquet") for name in names}
    summary = outcome.summary.model_dump(mode="json")
    redundancy = summary["redundancy"]
    scale = float(np.sqrt(redundancy / (redundancy + len(DATUM) - FORMAL)))
    return Adjusted(read_report(source / "result/report.txt"), summary, tables, scale)


def test_redundancy_and_sigma0_as_printed(adjusted: Adjusted) -> None:
    figures, summary = adjusted.printed.figures, adjusted.summary
    assert f"{summary['redundancy'] + len(DATUM) - FORMAL:.0f}" == figures["Redundancy"]
    assert f"{summary['sigma0'] * adjusted.scale:.6g}" == figures["Sigma0"]


def test_the_camera_and_its_standard_deviations_as_printed(adjusted: Adjusted) -> None:
    table, camera = adjusted.tables["parameters"].set_index("parameter"), adjusted.printed.camera
    for name, label, begin, sign in (
        ("focal_length", "Camera Constant", 0.0, 1.0),
        ("principal_point_x", "px", 18.0, 1.0),
        ("principal_point_y", "py", 12.0, -1.0),
        ("brown_mm:K1", "K1", 0.0, 1.0),
        ("brown_mm:K2", "K2", 0.0, 1.0),
    ):
        row, printed = table.loc[name], camera[label]
        assert f"{begin + sign * row['value']:.6g}" == printed.value
        assert f"{row['sigma'] * adjusted.scale:.3g}" == printed.deviation


def test_orientations_and_their_standard_deviations_as_printed(adjusted: Adjusted) -> None:
    table, photos = adjusted.tables["exterior_orientations"], adjusted.printed.photos
    table = table.set_index(table["image"].astype(int)).sort_index()
    assert len(photos) == len(table) == 60
    for label, name in (*CENTRE.items(), *ANGLES.items()):
        unit = "m" if label in CENTRE else "deg"
        value, sigma = table[f"{name}_{unit}"], table[f"sigma_{name}_{unit}"] * adjusted.scale
        printed = np.array([float(photo[label].value) for photo in photos])
        turns = 0.0 if label in CENTRE else 360.0 * np.round((value - printed) / 360.0)
        left_open = np.where([(k, label) in DATUM for k in table.index], 5.0, LEFT_OPEN) * sigma
        assert (np.abs(value - turns - printed) <= 0.5e-6 + left_open).all(), label
        for number, photo in enumerate(photos, 1):
            assert ((number, label) in DATUM) == (photo[label].deviation == "")
            if (number, label) not in DATUM:
                assert f"{sigma[number]:.3g}" == photo[label].deviation, (number, label)


def test_image_residuals_and_precision_as_printed(adjusted: Adjusted) -> None:
    residuals, printed = adjusted.tables["residuals"], adjusted.printed
    table = residuals[residuals["group"] == "image_points"].pivot(
        index=["image", "point"], columns="component", values="residual"
    )
    length = np.hypot(table["x"], table["y"]) / (1e3 * PIXEL_MM)
    assert f"{np.sqrt(np.mean(length**2)):.3f}" == printed.figure(r"Overall point RMS: (\S+) pixels")
    text = rf"Maximum: {length.max():.3f} pixels \(OP (\d+) on photo (\d+)\)"
    assert re.search(text, "\n".join(printed.lines)).groups() == (*reversed(length.idxmax()),)
    points = adjusted.tables["object_points"].set_index("point")
    for axis in "xyz":
        sigma = points[f"sigma_{axis}_m"] * adjusted.scale
        largest = printed.figure(rf"Maximum {axis.upper()} standard deviation: (\S+ \(OP \d+)")
        assert f"{sigma.max():.2g} (OP {sigma.idxmax()}" == largest
