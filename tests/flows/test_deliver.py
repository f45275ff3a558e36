"""``[[deliver]]``: a run hands its results over by itself, and what is refused counts as a failed gate."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path

import pytest

from flows.command.convert_execution import convert_and_show
from flows.command.exit_code import DONE, GATE_FAILED, OF_STATUS
from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tasks.errors import InputError
from tasks.formats.register import EXPOSURE_FORMATS
from tasks.handover.export import export_results
from tasks.handover.formats.register import REGISTER
from tasks.handover.written_files import write_files
from tasks.results.summary import read_summary
from tasks.settings.deliver import OFFERS
from tasks.settings.load import load_project
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project

#: Five km above ground, so that a Cartesian map without a camera of ours is wrong by more than a pixel.
HIGH = (
    "project.crs=EPSG:25832", "project.latitude_deg=48", "project.longitude_deg=9.0",
    "flight.0.exposures=3", "flight.1.exposures=3", "flight.0.height_m=6000", "flight.1.height_m=6000",
    "points.count=120", "terrain.mean_m=400", "control.columns=3", "control.rows=3",
)  # fmt: skip
DELIVERIES = """
[[deliver]]
format = "eo-csv"
folder = "client/eo"
angles = "phi-omega-kappa"
unit = "gon"

[[deliver]]
format = "patb"
"""


@pytest.fixture(scope="module")
def project_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("deliver")
    file = simulate_project(load_simulation("uce-high", HIGH), folder / "b").project_file
    file.write_text(file.read_text() + DELIVERIES)
    return file


@pytest.fixture(scope="module")
def outcome(project_file: Path) -> RunOutcome:
    # Of an earlier run, which the format would not be refused for.
    stale = project_file.parent / "results" / "export" / "patb"
    write_files(stale, {"patb.ori": "of an earlier run"}, "of an earlier run\n")
    return carry_out(aerial_triangulation, RunRequest(project_file))


def test_a_run_writes_its_deliveries(outcome: RunOutcome) -> None:
    assert outcome.error is None
    written, _ = outcome.summary.deliveries
    assert (written.format, written.folder, written.world, written.written) == (
        "eo-csv", "client/eo", "map", True
    )  # fmt: skip
    folder = outcome.directory / "client" / "eo"
    assert "Nothing is approximated" in (folder / "HANDOVER.txt").read_text()
    assert (folder / "eo.csv").read_text().startswith("image,camera,x_m,y_m,z_m,phi_gon,omega_gon,kappa_gon")


def test_a_refused_delivery_is_said_and_fails_its_gate(outcome: RunOutcome) -> None:
    refused = outcome.summary.deliveries[1]
    assert not refused.written
    assert refused.misfit_px is not None
    assert refused.misfit_px > 1.0
    gates = {gate.name: gate for gate in outcome.summary.gates}
    assert gates["delivery_client/eo"].passed
    assert not gates["delivery_export/patb"].passed
    assert gates["delivery_export/patb"].value == refused.misfit_px
    assert "The delivery export/patb (patb) is refused." in outcome.summary.problems[0]
    assert outcome.summary.status == "gate_failed"
    assert OF_STATUS[outcome.summary.status] == GATE_FAILED
    assert read_summary(outcome.directory) == outcome.summary
    # What an earlier run had written would pass for the delivery of this one.
    assert not (outcome.directory / "export" / "patb").exists()


def test_a_folder_that_holds_something_else_is_left_alone(
    project_file: Path, outcome: RunOutcome, tmp_path: Path
) -> None:
    out = Path(shutil.copytree(outcome.directory, tmp_path / "results"))
    own = out / "client" / "own"
    own.mkdir(parents=True)
    (own / "letter.txt").write_text("kept")
    request = RunRequest(project_file, out, ('deliver=[{format="eo-csv", folder="client/own"}]',))
    summary = carry_out(aerial_triangulation, request).summary
    assert summary.status == "gate_failed"
    assert "other files than a delivery" in summary.problems[0]
    assert [path.name for path in own.iterdir()] == ["letter.txt"]


def test_a_delivery_that_was_edited_stays(project_file: Path, outcome: RunOutcome, tmp_path: Path) -> None:
    out = Path(shutil.copytree(outcome.directory, tmp_path / "results"))
    folder = out / "client" / "eo"
    with (folder / "eo.csv").open("a") as stream:
        stream.write("checked by Ann\n")
    edited = (folder / "eo.csv").read_text()
    summary = carry_out(aerial_triangulation, RunRequest(project_file, out)).summary
    assert summary.status == "gate_failed"
    (told,) = [problem for problem in summary.problems if "client/eo (eo-csv) is refused" in problem]
    assert "eo.csv: The file would be replaced, but it is not by aerocal or was changed since." in told
    assert [path.name for path in folder.iterdir()] == ["eo.csv"]
    assert (folder / "eo.csv").read_text() == edited


@pytest.mark.parametrize(
    ("deliver", "says"),
    [
        ('{format="patp"}', "patb"),
        ('{format="rpc", world="local"}', "cannot be written for the kind"),
        ('{format="patb", unit="gon"}', "has its own order and unit of angles"),
        ('{format="stac"}', "needs the date of the flight"),
        ('{format="patb", folder="../elsewhere"}', "below the folder of the results"),
        ('{format="patb", folder="/srv"}', "below the folder of the results"),
        ('[{format="patb"}, {format="patb", world="local"}]', "a `folder` of its own"),
    ],
)
def test_wrong_deliveries_are_refused_before_anything_is_computed(
    project_file: Path, deliver: str, says: str
) -> None:
    with pytest.raises(InputError, match=says):
        load_project(project_file, (f"deliver={deliver}",))


def test_every_format_is_offered_in_the_project_file() -> None:
    assert set(OFFERS) == set(REGISTER)


def test_convert_takes_a_project_file_and_a_block_of_another_program(
    project_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = tmp_path / "blocks", tmp_path / "model"
    assert (
        convert_and_show(project_file, "blocks-exchange", first, None, None, overrides=(), data=None) == DONE
    )
    given = first / "block.xml"
    assert convert_and_show(given, "colmap", second, None, 5.2, overrides=(), data=None) == DONE
    assert "This block is not adjusted" in " ".join(capsys.readouterr().out.split())
    records = EXPOSURE_FORMATS["colmap"](second / "images.txt", "omega-phi-kappa")
    assert len(records.image) == 12
    with pytest.raises(InputError, match="--pixel-um"):
        convert_and_show(given, "colmap", second, None, None, overrides=(), data=None)
    with pytest.raises(InputError, match="not a block of COLMAP or OpenSfM"):
        convert_and_show(tmp_path, "colmap", second, None, 5.2, overrides=(), data=None)
    with pytest.raises(InputError, match="no format 'rpc'"):
        convert_and_show(given, "rpc", second, None, 5.2, overrides=(), data=None)


def test_a_conversion_replaces_nothing_that_was_delivered(project_file: Path, tmp_path: Path) -> None:
    model = tmp_path / "colmap"
    convert_and_show(project_file, "colmap", model, None, None, overrides=(), data=None)
    before = {file.name: file.read_bytes() for file in model.iterdir()}
    # The default folder, NAME next to INPUT, is the delivery itself.
    with pytest.raises(InputError, match="This is a delivered file, which the results would replace"):
        convert_and_show(model, "colmap", None, None, 5.2, overrides=(), data=None)
    assert {file.name: file.read_bytes() for file in model.iterdir()} == before


def test_an_export_replaces_no_input_of_its_run(outcome: RunOutcome, tmp_path: Path) -> None:
    results = Path(shutil.copytree(outcome.directory, tmp_path / "results"))
    points = tmp_path / "patb.im"
    points.write_text("as delivered")
    manifest = json.loads((results / "manifest.json").read_text())
    manifest["inputs"][str(points)] = "0" * 64
    (results / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(InputError, match=r"patb\.im: This is a delivered file"):
        export_results(results, "patb", tmp_path, force=True)
    assert points.read_text() == "as delivered"
    assert not (tmp_path / "patb.ori").exists()


@pytest.mark.parametrize(
    ("pixel_um", "says"),
    [(5.2, "project file states"), (-3.0, "-3 is not the size"), (math.nan, "nan is not")],
)
def test_a_pixel_size_is_one_and_only_for_blocks_without(
    project_file: Path, tmp_path: Path, pixel_um: float, says: str
) -> None:
    with pytest.raises(InputError, match=says):
        convert_and_show(project_file, "colmap", tmp_path / "out", None, pixel_um, overrides=(), data=None)
    assert not (tmp_path / "out").exists()
