"""Files are recognised by their content, through the register of readers; what is open is never guessed."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.inventory import recognition
from tasks.inventory.folder import begin_project
from tasks.inventory.recognition import recognised, rows_of
from tasks.results.manifest import Manifest, write_manifest
from tasks.settings.load import load_project
from tests.command_line import aerocal
from tests.tasks.forked import fails_with_files_of_at_most
from tests.tasks.formats.sound_files import SOUND, content_of

# Lists of photos are read alike, whoever wrote them; one list alone could as well be of control points.
LISTS = {"patb", "bingo", "pix4d"}
PHOTOS = "1001 120000.0\n5 -34210.4 12988.7\n-99\n1002 120000.0\n5 3210.4 12988.7\n-99\n1003 1\n5 1 2\n-99\n"


@pytest.mark.parametrize("key", SOUND, ids=" ".join)
def test_every_format_of_the_register_is_recognised(tmp_path: Path, key: tuple[str, str]) -> None:
    kind, name = key[0].replace(" ", "_"), key[1]
    file = tmp_path / "without_extension"
    file.write_bytes(content_of(key))
    found = {(content.kind, content.format) for content in recognised(file).contents}
    if kind == "image_points" and name in LISTS:
        assert {one for _, one in found} <= LISTS
    else:
        assert (kind, name) in found


def test_rational_polynomials_are_no_heights_of_control(tmp_path: Path) -> None:
    file = tmp_path / "W01_001_RPC.TXT"
    file.write_text("ERR_BIAS: -1\nERR_RAND: 0.02\nLINE_OFF: 6911.5\nSAMP_OFF: 3839.5\nLAT_OFF: 52.01\n")
    found = recognised(file)
    assert found.contents == ()
    assert found.remark == "rational polynomials of an image: not read"


def test_a_note_is_named_as_one(tmp_path: Path) -> None:
    file = tmp_path / "README.txt"
    file.write_text("The block was flown in May.\n")
    found = recognised(file)
    assert (found.contents, found.remark) == ((), "a note")


def test_a_survey_with_numbers_and_labels_is_control(tmp_path: Path) -> None:
    file = tmp_path / "survey.txt"
    file.write_text("Id,label,X,Y,Z\n1001,CP1,0,1,0\n1002,CP2,1,1,0\n")
    assert [content.kind for content in recognised(file).contents] == ["control"]


def test_a_full_disk_leaves_no_half_of_a_project_file(tmp_path: Path) -> None:
    """It was never overwritten, so that the next attempt was refused."""
    folder = delivery(tmp_path / "delivery")
    files = sorted(path.name for path in folder.iterdir())
    assert fails_with_files_of_at_most(100, lambda: begin_project(folder))
    assert sorted(path.name for path in folder.iterdir()) == files
    begin_project(folder)


def test_results_of_a_run_are_no_delivery(tmp_path: Path) -> None:
    """Neither its tables nor its exports, which would be read as exposures and points once more."""
    folder = delivery(tmp_path / "delivery")
    exports = folder / "results" / "export" / "eo"
    exports.mkdir(parents=True)
    (exports / "eo.txt").write_bytes((folder / "eo.txt").read_bytes())
    begin_project(folder)
    assert "results/export" in (folder / "project.toml").read_text(encoding="utf-8")
    (folder / "project.toml").unlink()
    nothing = Manifest(
        contract_version=1, artifacts={}, stages=(), inputs={}, settings={}, versions={}, times={}
    )
    write_manifest(folder / "results", nothing)
    last = begin_project(folder).files[-1]
    assert (last.path.name, last.remark) == ("results", "results of a run, with its exports: no delivery")
    assert "export" not in (folder / "project.toml").read_text(encoding="utf-8")


def test_photo_lists_are_no_control(tmp_path: Path) -> None:
    file = tmp_path / "points.im"
    file.write_text(PHOTOS)
    assert [content.kind for content in recognised(file).contents] == ["image_points"]


def test_a_large_table_is_recognised_by_its_beginning_and_read_to_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recognition, "_BEGINNING", 10_000)
    file = tmp_path / "points.csv"
    rows = "".join(f"{k // 50:05d},P{k % 500:05d},{k % 97}.25,{k % 89}.5\n" for k in range(1_000))
    file.write_text(f"image,point,x,y\n{rows}")
    assert file.stat().st_size > 20_000
    (content,) = recognised(file).contents
    assert (content.kind, rows_of(content.records)) == ("image_points", 1_000)
    with file.open("a") as stream:
        stream.write("00001,P1,not a number,2\n")
    assert recognised(file).contents == ()


def delivery(folder: Path) -> Path:
    """Foreign headings, semicolons and decimal commas; an image and a note beside them."""
    folder.mkdir()
    (folder / "eo.txt").write_text(
        "Photo;East;North;Height;Omega;Phi;Kappa\nA1;500000,5;5300000,25;2000;0,1;-0,2;10\n"
        "A2;500500,5;5300000,25;2000;0,1;-0,2;10\n"
    )
    (folder / "points.csv").write_text("image,point,x,y\nA1,P1,1.5,2.5\nA2,P1,-1.5,2.5\n")
    (folder / "scan.tif").write_bytes(b"II*\0" + bytes(100))
    (folder / "notes.md").write_text("flown in May\n")
    return folder


def test_init_writes_what_is_known_and_asks_for_the_rest(tmp_path: Path) -> None:
    folder = delivery(tmp_path / "block 7")
    done = aerocal("init", folder)
    assert done.returncode == 0
    for words in ("eo.txt", "2 exposures", "2 image points", "TIFF: an image", "no reader can read it"):
        assert words in done.stdout
    content = tomllib.loads((folder / "project.toml").read_text(encoding="utf-8"))
    (exposures,) = content["inputs"]["exposures"]
    assert exposures["separator"] == "semicolon"
    assert exposures["decimal"] == ","
    assert exposures["columns"] == {"image": "Photo", "x": "East", "y": "North", "z": "Height"}
    assert exposures["camera"] == "CAMERA"
    questions = [exposures[name] for name in ("crs", "heights", "position", "strip")]
    questions += [*exposures["angles"].values(), content["inputs"]["image_points"][0]["unit"]]
    assert all(text.startswith("DECLARE: ") for text in questions)


def test_init_asks_for_the_axes_of_rates(tmp_path: Path) -> None:
    folder = delivery(tmp_path / "delivery")
    headings = "image,camera,strip,x,y,z,heading,pitch,roll,rate_roll,rate_pitch,rate_yaw"
    (folder / "rates.csv").write_text(f"{headings}\ni1,C,1,500000,5400000,900,90,1,2,0.1,0.2,0.3\n")
    begin_project(folder)
    (angles,) = (line for line in (folder / "project.toml").read_text().splitlines() if "rate_axes" in line)
    assert 'rate_axes = "DECLARE: forward-right-down or forward-left-up"' in angles


def test_a_project_with_open_values_is_refused_with_their_list(tmp_path: Path) -> None:
    folder = delivery(tmp_path / "delivery")
    begin_project(folder)
    done = aerocal("run", folder / "project.toml")
    assert done.returncode == 2
    # Two of the project, seven of the camera, one of the points, seven of the exposures.
    assert "17 values are still to be declared" in done.stderr.replace("\n", " ")
    with pytest.raises(InputError) as refused:
        load_project(folder / "project.toml", ["project.crs=EPSG:25832"])
    assert "16 values" in refused.value.what
    for key in ("inputs.exposures.0.angles.order", "inputs.image_points.0.unit", "cameras.CAMERA.mount_deg"):
        assert f"{key} (line " in refused.value.what
    assert "project.crs" not in refused.value.what
    lines = (folder / "project.toml").read_text(encoding="utf-8").splitlines()
    assert refused.value.line is not None
    assert "DECLARE" in lines[refused.value.line - 1]


def test_a_project_file_is_never_overwritten(tmp_path: Path) -> None:
    folder = delivery(tmp_path / "delivery")
    (folder / "project.toml").write_text("mine")
    done = aerocal("init", folder)
    assert done.returncode == 2
    assert "never overwritten" in done.stderr
    assert (folder / "project.toml").read_text() == "mine"


def test_a_folder_without_a_delivery_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("nothing here\n")
    assert aerocal("init", tmp_path).returncode == 2
    assert not (tmp_path / "project.toml").exists()
    assert aerocal("init", tmp_path / "missing").returncode == 2


def test_a_second_orientation_of_the_same_images_is_left_to_a_person(tmp_path: Path) -> None:
    folder = delivery(tmp_path / "delivery")
    (folder / "later.csv").write_text((folder / "eo.txt").read_text())
    begun = begin_project(folder)
    text = (folder / "project.toml").read_text(encoding="utf-8")
    assert len(tomllib.loads(text)["inputs"]["exposures"]) == 1
    assert "keep one of the two" in text
    # What is commented out need not be declared.
    rest = "\n".join(line for line in text.splitlines() if not line.startswith("#"))
    assert begun.open_values == rest.count("DECLARE: ") < text.count('"DECLARE: ')
    assert '# file = "later.csv"' in text


def test_a_name_that_a_project_file_cannot_state_is_refused(tmp_path: Path) -> None:
    folder = delivery(tmp_path / "delivery")
    (folder / os.fsdecode(b"pl\xe4ne.pdf")).write_text("")
    table = next(folder.glob("*.csv")).rename(folder / os.fsdecode(b"pl\xe4ne.csv"))
    with pytest.raises(InputError, match=r"pl\\udce4ne.csv: The name is not UTF-8. Rename the file."):
        begin_project(folder)
    assert not list(folder.glob("*project.toml*"))
    table.rename(folder / "plans.csv")
    begin_project(folder)


def test_names_of_files_cannot_add_lines_to_the_project_file(tmp_path: Path) -> None:
    folder = tmp_path / "delivery"
    folder.mkdir()
    name = 'a "b"\n[adjustment]\nmax_iterations = 1 #.csv'
    (folder / name).write_text("image,point,x,y\nA1,P1,1.5,2.5\nA2,P1,-1.5,2.5\n")
    begin_project(folder)
    content = tomllib.loads((folder / "project.toml").read_text(encoding="utf-8"))
    assert content["inputs"]["image_points"][0]["file"] == name
    assert "adjustment" not in content
