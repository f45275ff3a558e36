"""A block in every format of block exchange, adjusted again from there: the same result.

What is exchanged is not adjusted, so the second adjustment has the observations of the first one, to the digits that the format
prints.
"""  # noqa: E501

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.geometry.rotation import from_omega_phi_kappa
from flows.stories.aerial_triangulation import adjusted_block
from flows.stories.block_conversion import converted_block
from flows.stories.block_preparation import PreparedBlock, prepare_block
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, local_frame, local_from_grid, local_from_map
from tasks.handover.formats.exchange import EXCHANGE
from tasks.handover.recognised import project_text, recognised
from tasks.settings.load import load_project
from tasks.settings.load_simulation import load_simulation
from tasks.settings.project import Project
from tasks.simulation.simulate import simulate_project
from tasks.store.notes import read_notes
from tasks.store.store import Store
from tasks.tables.parquet import read_table

#: 16 images in crossing lines; GNSS and attitudes alike in all axes, whatever frame they are observed in.
SMALL = (
    "project.crs=EPSG:25832", "project.latitude_deg=48", "project.longitude_deg=11.5",
    "project.angles=omega-phi-kappa", "flight.0.exposures=4", "flight.1.exposures=4", "points.count=150",
    "terrain.mean_m=400", "control.columns=3", "control.rows=3", "truth.gnss_shift_m=[0,0,0]",
    "noise.ins_deg=[0.003,0.003,0.003]",
)  # fmt: skip
PIXEL_UM, SIGMA_MM = 5.2, 0.00105
#: Unit of the image points of a format → its σ.
SIGMA = {"px": SIGMA_MM / PIXEL_UM * 1e3, "longer-side": SIGMA_MM / (PIXEL_UM * 1e-3 * 20010)}
#: Formats that say everything, and what carries control.
RECOGNISED = {
    "blocks-exchange": "block.xml", "colmap": "", "opensfm": "", "openmvg": "sfm_data.json", "opf": "opf.zip"
}  # fmt: skip
WITH_CONTROL = {"blocks-exchange", "opf", "patb", "bingo", "corrected-csv"}
PLACE = 'crs = "EPSG:25832"\nheights = "ellipsoidal"\n'
DECLARED = f"""version = 1
[project]
name = "again"
{PLACE}[cameras.UCE-80]
columns = 13080
rows = 20010
pixel_um = {PIXEL_UM}
focal_length_mm = 80.0
principal_point_mm = [0.0, 0.0]
pixel_origin = "corner"
mount_deg = 0
[inputs.image_points]
file = "{{0}}"
format = "{{format}}"
unit = "{{unit}}"
image_names = "{{names}}"
[inputs.exposures]
file = "{{1}}"
format = "{{format}}"
{PLACE}position = "projection_centre"
angles = {{angles}}
camera = "UCE-80"
image_names = "{{names}}"
[inputs.control]
file = "{{2}}"
format = "{{format}}"
{PLACE}sigma_m = 0.02
"""
OPK = '{ order = "omega-phi-kappa", unit = "deg", reference = "grid" }'
POK = '{ order = "phi-omega-kappa", unit = "gon", reference = "grid" }'
OF_LISTS = {
    "patb": (("patb.im", "patb.ori", "patb.con"), "um", OPK, "patb_images.csv"),
    "bingo": (("image.dat", "itera.dat", "geoin.dat"), "mm", POK, None),
    "corrected-csv": (
        ("image_points.csv", "exterior_orientations.csv", "control_points.csv"),
        "mm",
        OPK,
        None,
    ),
}
#: Formats that a reader of another name reads.
READERS = {"corrected-csv": "csv"}


@dataclass(frozen=True, eq=False)
class Adjusted:
    """Names, positions and rotations in one local frame, and σ0."""

    names: list[str]
    centre: Floats
    turn: Floats
    sigma0: float
    image_points: int


@dataclass(frozen=True, eq=False)
class Original:
    """The simulated block, prepared, and the frame in which it is exchanged."""

    project: Project
    store: Store
    block: PreparedBlock
    frame: AdjustmentFrame

    @cache  # noqa: B019
    def adjusted(self, control: bool) -> Adjusted:
        """The first result, with or without its control points."""
        if control:
            return adjust(self.project, self.store, self.block, self.frame)
        inputs = self.project.inputs.model_copy(update={"control": ()})
        project = self.project.model_copy(update={"inputs": inputs})
        return adjust(project, self.store, prepare_block(project, self.store), self.frame)


def adjust(project: Project, store: Store, block: PreparedBlock, frame: AdjustmentFrame) -> Adjusted:
    outputs = adjusted_block(project, store, block)
    table = read_table(outputs["exterior_orientations"])
    place = MapFrame.of(project.project.crs, project.project.heights)
    centre = table[["x_m", "y_m", "z_m"]].to_numpy(float)
    turn = from_omega_phi_kappa(np.deg2rad(table[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy(float)))
    if not place.is_local:
        turn = local_from_grid(place, frame, centre) @ turn
        centre = local_from_map(place, frame, centre)
    figures = read_notes(outputs["notes"]).figures
    counts = figures["counts"]
    return Adjusted(table["image"].tolist(), centre, turn, figures["sigma0"], counts["image_points"])


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Original:
    folder = tmp_path_factory.mktemp("exchange")
    file = simulate_project(load_simulation("uce-high", SMALL), folder / "b").project_file
    project = load_project(file, ("adjustment.free=[]", "project.flown=2026-05-24"))
    store = Store.of(folder / "original")
    store.begin_run()
    block = prepare_block(project, store)
    positions = read_table(block.exposures["exposures"])[["x_m", "y_m", "z_m"]].to_numpy(float)
    place = MapFrame.of(project.project.crs, project.project.heights)
    return Original(project, store, block, local_frame(place, positions))


def project_of(name: str, folder: Path) -> Path:
    """A project file that reads what was written."""
    text = folder / "again.toml"
    if name in OF_LISTS:
        files, unit, angles, names = OF_LISTS[name]
        content = DECLARED.format(
            *files, format=READERS.get(name, name), unit=unit, angles=angles, names=names
        )
        if names is None:
            content = content.replace('image_names = "None"\n', "")
        text.write_text(content)
        return text
    if name == "opf":
        with zipfile.ZipFile(folder / "opf.zip", "w") as packed:
            for file in folder.iterdir():
                if file.suffix != ".zip":
                    packed.write(file, file.name)
    block = recognised(folder / RECOGNISED[name])
    assert block is not None
    assert block.format == name
    text.write_text(project_text(block, "again", PIXEL_UM))
    return text


def sigma_of(name: str) -> float:
    unit = OF_LISTS[name][1] if name in OF_LISTS else "longer-side" if name == "opensfm" else "px"
    return {**SIGMA, "um": SIGMA_MM * 1e3, "mm": SIGMA_MM}[unit]


@pytest.mark.parametrize("name", EXCHANGE)
def test_an_exchanged_block_has_the_same_result(name: str, original: Original, tmp_path: Path) -> None:
    out = tmp_path / "out"
    written, _ = converted_block(original.project, original.store, name, out, None)
    assert written.misfit_px < 1e-6
    assert "This block is not adjusted" in " ".join(written.statement.split())
    settings = (
        f"inputs.image_points.sigma={sigma_of(name)!r}", "inputs.exposures.sigma.position_m=0.05",
        "inputs.exposures.sigma.attitude_deg=0.003", "adjustment.free=[]", "adjustment.rejection=none",
        "adjustment.refraction=none",
    )  # fmt: skip
    project = load_project(project_of(name, out), settings)
    assert bool(project.inputs.control) == (name in WITH_CONTROL)
    store = Store.of(tmp_path / "again")
    store.begin_run()
    again = adjust(project, store, prepare_block(project, store), original.frame)
    first = original.adjusted(name in WITH_CONTROL)
    assert (again.names, again.image_points) == (first.names, first.image_points)
    # Image points have 1e-4 pixels (OPF 1e-3), 13 µm on the ground; positions of BINGO and control 0.1 mm.
    np.testing.assert_allclose(again.centre, first.centre, rtol=0, atol=2e-4)
    # ω, φ, κ are not orthogonal: about another north equal σ weigh a little differently (σ of κ here 1e-5).
    np.testing.assert_allclose(again.turn, first.turn, rtol=0, atol=5e-8)
    assert again.sigma0 == pytest.approx(first.sigma0, rel=1e-4)


def test_every_format_of_block_exchange_is_adjusted_again() -> None:
    assert set(EXCHANGE) == {*RECOGNISED, *OF_LISTS}
