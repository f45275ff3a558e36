"""`aerocal run` from text files to tables: every number DBAT prints of the experiments it was published with.

Börlin and Grussenmeyer (2016), International Archives XLI-B5, 7-14: C1 and C2, 21 photos of a sheet of marks
by a calibrated camera; S1 to S4, five aerial images over Strasbourg. Of these also the demonstration with two
check points and two kinds of image points, and the one that observes four projection centres to 5 cm.
Only image points, surveyed points and these positions are given: no attitude, no approximate value.
DBAT's text files and reports are in its public repository, not with the other real data: give a checkout
(niclasborlin/dbat on GitHub, commit b8d1b15) in AEROCAL_DBAT.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tests.golden.dbat import Report, photomodeler_marks, read_report, script_marks

ANGLES = ("omega", "phi", "kappa")
CENTRE = {"Xc": "x", "Yc": "y", "Zc": "z"}
#: Standard deviations: DBAT ends at a step with ‖J dx‖ ≤ 1e-6 ‖r‖, which leaves 1e-6 √redundancy open.
LEFT_OPEN = 5e-5

LENS = {"K1": 4.981e-3, "K2": -9.814e-5, "P1": -6.587e-5, "P2": -2.806e-5}
PROJECT = """\
version = 1
[project]
name = "sxb"
crs = "local"
[cameras.camera]
{camera}
pixel_origin = "corner"
mount_deg = 0
[inputs.control]
file = "control.csv"
format = "csv"
crs = "local"
sigma_m = {sigma_m}
[adjustment]
observe = {observe}
refraction = "none"
rejection = "none"
"""
AERIAL = """\
columns = 8858
rows = 12996
pixel_um = 6.0
principal_point_mm = [0.003, 0.177]
focal_length_mm ="""
CALIBRATED = f"""\
columns = 2272
rows = 1704
pixel_um = {5439.9 / 1704!r}
focal_length_mm = 7.4693
principal_point_mm = {[3.6178 - 7.2532 / 2.0, 5.4399 / 2.0 - 2.6087]}
additional_parameters = {{ {", ".join(f'"brown_mm:{name}" = {value}' for name, value in LENS.items())} }}
"""
MARKS = """\
[[inputs.image_points]]
file = "{file}"
format = "csv"
unit = "px"
sigma = {sigma}
"""
POSITIONS = """\
[inputs.exposures]
file = "positions.csv"
format = "csv"
crs = "local"
position = "projection_centre"
angles = { order = "omega-phi-kappa", unit = "deg", reference = "grid" }
sigma = { position_m = 0.05 }
"""


@dataclass(frozen=True)
class Case:
    """What DBAT was given: image points with their σ (px), σ of control, check points, positions.

    PhotoModeler's exports have the focal length of each image to 1 µm. In those with another origin
    (``moved``) control is rounded to 10 µm, which changes positions by up to 40 µm.
    """

    report: str
    marks: tuple[tuple[str, float], ...]
    control_sigma_m: tuple[float, float, float] = (0.02, 0.02, 0.04)
    check: tuple[int, ...] = ()
    positions: bool = False
    moved: bool = False
    camera: str = f"{AERIAL} 123.939"
    pixel_um: float = 6.0
    control: str = "data/script/sxb/reference/sxb-control.txt"


SHEET = {
    "camera": CALIBRATED,
    "pixel_um": 5439.9 / 1704,
    "control": "data/prague2016/cam/ref/ctrlpts-weighted.txt",
}


def _exported(name: str) -> tuple[tuple[str, float], ...]:
    return ((f"data/prague2016/{name}-pmexport.txt", 0.1 if name.startswith("cam") else 1.0),)


def _printed_in(name: str) -> str:
    return f"data/prague2016/{name}-dbatreport.txt"


SCRIPT = "data/script/sxb"
CASES = {
    "C1, fixed control": Case(
        _printed_in("cam/dbatexports/fixed-no-orient"),
        _exported("cam/pmexports/fixed-no-orient"),
        (1e-8, 1e-8, 1e-8),
        moved=True,
        **SHEET,
    ),
    "C2, observed control": Case(
        _printed_in("cam/dbatexports/weighted-no-orient"),
        _exported("cam/pmexports/weighted-no-orient"),
        (1e-3, 1e-3, 1e-3),
        moved=True,
        **SHEET,
    ),
    "S1, fixed control": Case(
        _printed_in("sxb/dbatexports/f-op0-with-orient"),
        _exported("sxb/pmexports/f-op0-with-orient"),
        (0.0, 0.0, 0.0),
        moved=True,
    ),
    "S2, observed control": Case(
        _printed_in("sxb/dbatexports/w-op0-with-orient"),
        _exported("sxb/pmexports/w-op0-with-orient"),
        moved=True,
    ),
    "S3, a tie point": Case(
        _printed_in("sxb/dbatexports/w-op1-with-orient"),
        _exported("sxb/pmexports/w-op1-with-orient"),
        moved=True,
    ),
    "S4, 365 tie points": Case(
        _printed_in("sxb/dbatexports/sxb-no-prior-eo"), _exported("sxb/pmexports/wsmart-with-orient")
    ),
    "positions": Case(
        _printed_in("sxb/dbatexports/sxb-prior-eo"),
        _exported("sxb/pmexports/wsmart-with-orient"),
        positions=True,
    ),
    "check points": Case(
        f"{SCRIPT}/result/report.txt",
        ((f"{SCRIPT}/measurements/markpts.txt", 0.5), (f"{SCRIPT}/measurements/smartpts.txt", 1.0)),
        check=(351, 410),
        camera=f"{AERIAL} 123.9392",
    ),
}


@dataclass(frozen=True, eq=False)
class Adjusted:
    """A case, what DBAT printed, and the tables of our run by name."""

    case: Case
    printed: Report
    summary: dict
    tables: dict[str, pd.DataFrame]


@pytest.fixture(scope="module", params=CASES)
def adjusted(
    dbat: Path, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Adjusted:
    case = CASES[request.param]
    folder = tmp_path_factory.mktemp("sxb")
    _write(folder, dbat, case)
    outcome = carry_out(aerial_triangulation, RunRequest(folder / "project.toml"))
    assert outcome.error is None, outcome.error
    names = ("exterior_orientations", "object_points", "control_residuals", "check_points", "residuals")
    tables = {name: pd.read_parquet(outcome.directory / f"{name}.parquet") for name in names}
    summary = outcome.summary.model_dump(mode="json")
    orientations = tables["exterior_orientations"]
    tables["exterior_orientations"] = orientations.sort_values("image", key=lambda names: names.astype(int))
    return Adjusted(case, read_report(dbat / case.report), summary, tables)


def _write(folder: Path, dbat: Path, case: Case) -> None:
    """A project as a user has it."""
    observed = '["gnss", "control"]' if case.positions else '["control"]'
    project = PROJECT.format(observe=observed, camera=case.camera, sigma_m=list(case.control_sigma_m))
    for number, (file, sigma) in enumerate(case.marks):
        read = script_marks if file.startswith(SCRIPT) else photomodeler_marks
        read(dbat / file).to_csv(folder / f"marks{number}.csv", index=False)
        project += MARKS.format(file=f"marks{number}.csv", sigma=sigma)
    if case.positions:
        project += POSITIONS
        given = dbat / "data/prague2016/sxb/ref/fake-camera-positions.txt"
        table = pd.read_csv(given, comment="#", header=None, names=["image", "x", "y", "z", "sigma"])
        table["image"] = [1, 2, 3, 4]
        table = pd.concat([table.drop(columns="sigma"), pd.DataFrame({"image": [5]})])
        table[["camera", "strip", *ANGLES]] = ["camera", "", "", "", ""]
        table.to_csv(folder / "positions.csv", index=False)
    (folder / "project.toml").write_text(project)
    names = ["point", "label", "x", "y", "z", "sx", "sy", "sz"]
    control = pd.read_csv(dbat / case.control, comment="#", header=None, names=names)
    control["role"] = np.where(control["point"].isin(case.check), "check", "control")
    control[["point", "x", "y", "z", "role"]].to_csv(folder / "control.csv", index=False)


def test_redundancy_and_sigma0_as_printed(adjusted: Adjusted) -> None:
    figures = adjusted.printed.figures
    assert f"{adjusted.summary['redundancy']:.0f}" == figures["Redundancy"]
    assert f"{adjusted.summary['sigma0']:.6g}" == figures["Sigma0"]


def test_orientations_and_their_standard_deviations_as_printed(adjusted: Adjusted) -> None:
    table, photos = adjusted.tables["exterior_orientations"], adjusted.printed.photos
    assert len(photos) == len(table)
    for label, name in CENTRE.items():
        printed = np.array([float(photo[label].value) for photo in photos])
        value, sigma = table[f"{name}_m"].to_numpy(), table[f"sigma_{name}_m"].to_numpy()
        # PhotoModeler's exports of the first three experiments have moved the origin.
        origin = float(np.mean(printed - value)) if adjusted.case.moved else 0.0
        assert [f"{item:.3g}" for item in sigma] == [photo[label].deviation for photo in photos]
        rounding = 4e-5 if adjusted.case.moved else 0.5e-6
        assert (np.abs(value + origin - printed) <= rounding + LEFT_OPEN * sigma).all(), label
    for name in ANGLES:
        printed = np.array([float(photo[name.capitalize()].value) for photo in photos])
        value, sigma = table[f"{name}_deg"].to_numpy(), table[f"sigma_{name}_deg"].to_numpy()
        assert [f"{item:.3g}" for item in sigma] == [photo[name.capitalize()].deviation for photo in photos]
        assert (np.abs(value - printed) <= 0.5e-6 + LEFT_OPEN * sigma).all(), name


def test_high_correlations_as_printed(adjusted: Adjusted) -> None:
    """DBAT names each correlation of an orientation above 95 %, rounded to 0.1 %."""
    table = adjusted.tables["exterior_orientations"]
    labels = {**CENTRE, **{name.capitalize(): name for name in ANGLES}}
    for (one, first), (other, second) in combinations(labels.items(), 2):
        values = 100.0 * table[f"correlation_{first}_{second}"]
        found = [f"{value:.1f}%" if abs(value) > 95.0 else "" for value in values]
        assert found == adjusted.printed.correlations(one, other), (one, other)


def test_surveyed_points_as_printed(adjusted: Adjusted) -> None:
    """Adjusted positions and σ, and adjusted minus given, of control and check points."""
    printed = adjusted.printed.points.set_index("point")
    points = adjusted.tables["object_points"].set_index("point").loc[printed.index]
    differences = pd.concat([adjusted.tables["control_residuals"], adjusted.tables["check_points"]])
    differences = differences.set_index("point").loc[printed.index]
    for name in ("x", "y", "z"):
        if adjusted.case.control_sigma_m[0] > 1e-6:
            assert [f"{value:.3g}" for value in points[f"sigma_{name}_m"]] == list(printed[f"std{name}"])
        # Printed to a millimetre.
        limit = 0.5e-3 + LEFT_OPEN * points[f"sigma_{name}_m"] + 1e-9
        assert (np.abs(differences[f"d{name}_m"] - printed[f"d{name}"].astype(float)) <= limit).all()
        if not adjusted.case.moved:
            assert (np.abs(points[f"{name}_m"] - printed[name].astype(float)) <= limit).all()


def test_image_residuals_as_printed(adjusted: Adjusted) -> None:
    residuals = adjusted.tables["residuals"]
    table = residuals[residuals["group"] == "image_points"].pivot(
        index=["image", "point"], columns="component", values="residual"
    )
    length = np.hypot(table["x"], table["y"]) / adjusted.case.pixel_um
    printed = adjusted.printed
    assert f"{np.sqrt(np.mean(length**2)):.3f}" == printed.figure(r"Overall point RMS: (\S+) pixels")
    largest = re.search(r"Maximum: (\S+) pixels \(OP (\d+) on photo (\d+)\)", "\n".join(printed.lines))
    assert length.max() == pytest.approx(float(largest[1]), abs=0.5e-3 + LEFT_OPEN)
    assert (*reversed(length.idxmax()),) == largest.groups()[1:]


def test_precision_of_object_points_as_printed(adjusted: Adjusted) -> None:
    points = adjusted.tables["object_points"].set_index("point")
    if points.index.isin(adjusted.printed.points["point"]).all() and max(adjusted.case.control_sigma_m) == 0:
        pytest.skip("no object point is free")
    for axis in "xyz":
        sigma = points[f"sigma_{axis}_m"]
        printed = adjusted.printed.figure(rf"Maximum {axis.upper()} standard deviation: (\S+ \(OP \d+)")
        assert f"{sigma.max():.2g} (OP {sigma.idxmax()}" == printed
