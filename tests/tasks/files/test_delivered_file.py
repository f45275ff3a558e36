"""Huge, endless and special files are refused in one sentence, before they are in memory."""

from __future__ import annotations

import ast
import os
import resource
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.files.delivered_file import (
    DOCUMENT_VARIABLE,
    ROWS_VARIABLE,
    TABLE_VARIABLE,
    FileLimits,
    digest_for_key,
    digest_of_delivered,
    file_limits,
    keyed_by,
    opened,
    read_delivered,
)
from tasks.files.installation import InstallationError
from tasks.formats.ign_camera import read_ign_camera
from tasks.formats.ign_text import read_ign_app, read_ign_mes, read_ign_opk
from tasks.formats.native_csv import read_csv_control, read_csv_exposures, read_csv_image_points
from tasks.registry.calibration_file import read_calibrations
from tasks.settings.direct_georeferencing import CalibrationInput
from tasks.settings.load import load_project
from tasks.settings.load_simulation import load_simulation
from tasks.store.stage_key import InputFile
from tasks.tables.foreign import read_foreign_table
from tasks.tables.schemas.parameters import PARAMETERS
from tests.command_line import aerocal
from tests.conftest import REPOSITORY
from tests.tasks.formats.sound_files import READERS as FORMAT_READERS

#: Everything that reads a file somebody delivered; the grid of a geoid is read by PROJ, see below.
READERS: dict[str, Callable[[Path], object]] = {
    "project file": load_project,
    "specification": lambda path: load_simulation(str(path)),
    "camera, ign-xml": read_ign_camera,
    "image points, csv": read_csv_image_points,
    "image points, ign-mes": read_ign_mes,
    "exposures, csv": lambda path: read_csv_exposures(path, "omega-phi-kappa"),
    "exposures, ign-opk": lambda path: read_ign_opk(path, "omega-phi-kappa"),
    "control, csv": read_csv_control,
    "control, ign-app": read_ign_app,
    "calibration": read_calibrations,
    **{
        f"{kind}, {name}": reader
        for kind, readers in FORMAT_READERS.items()
        for name, reader in readers.items()
        if name != "csv" and not name.startswith("ign")
    },
    "table of another run": lambda path: read_foreign_table(path, PARAMETERS, "Name another."),
}
every_reader = pytest.mark.parametrize("reader", READERS.values(), ids=READERS)
SPECIAL = ("sparse", "device", "pipe", "zeros")


def special(kind: str, path: Path) -> Path:
    """A file that cannot be read to its end, or not at all."""
    if kind == "sparse":
        path.touch()
        os.truncate(path, 100_000_000_000)
    elif kind == "device":
        return Path("/dev/zero")
    elif kind == "pipe":
        os.mkfifo(path)
    else:
        # Within every limit of size, and yet no line in it ends.
        path.touch()
        os.truncate(path, 15_000_000)
    return path


@every_reader
@pytest.mark.parametrize("kind", SPECIAL)
def test_every_reader_refuses_a_file_without_end(
    reader: Callable[[Path], object], kind: str, tmp_path: Path
) -> None:
    # ".toml": otherwise the name of a simulation's preset is looked for.
    path = special(kind, tmp_path / "delivered.toml")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError) as refused:
        reader(path)
    # A sentence for people, and no copy of the file in it; never more in memory than some 15 MB of zeros.
    assert len(str(refused.value)) < 1_000
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 600_000


@every_reader
def test_every_reader_refuses_a_folder(reader: Callable[[Path], object], tmp_path: Path) -> None:
    folder = tmp_path / "folder.toml"
    folder.mkdir()
    with pytest.raises(
        InputError, match=r"not an ordinary file|no calibration in this folder|a folder, not a"
    ):
        reader(folder)


def test_a_line_without_end_is_named(tmp_path: Path) -> None:
    file = tmp_path / "image_points.csv"
    file.write_text("image,point,x,y\n1,a,2,3\n\n1," + "b" * 100_001 + ",2,3\n")
    with pytest.raises(InputError, match="more than 100,000 characters") as refused:
        read_csv_image_points(file)
    assert refused.value.line == 4
    file.write_text("image,point,x,y" + ",more" * 30_000 + "\n1,a,2,3\n")
    with pytest.raises(InputError, match="more than 100,000 characters"):
        read_csv_image_points(file)
    file.write_text("image,point,x,y," + ",".join(f"c{k}" for k in range(1_000)) + "\n1,a,2,3\n")
    with pytest.raises(InputError, match="1,004 columns"):
        read_csv_image_points(file)


def test_a_file_of_blank_lines_is_passed_over_at_once(tmp_path: Path) -> None:
    file = tmp_path / "image_points.csv"
    file.write_bytes(b"\n" * 3_000_000 + b"image,point,x,y\n1,a,2,oops\n")
    with pytest.raises(InputError, match="oops") as refused:
        read_csv_image_points(file)
    assert refused.value.line == 3_000_002


def test_the_number_of_rows_is_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "image_points.csv"
    file.write_text("image,point,x,y\n" + "1,a,2,3\n" * 20)
    monkeypatch.setenv(ROWS_VARIABLE, "20")
    with pytest.raises(InputError, match="21 rows, more than the 20"):
        read_csv_image_points(file)
    monkeypatch.setenv(ROWS_VARIABLE, "21")
    assert len(read_csv_image_points(file).image) == 20


def test_a_table_of_few_bytes_and_many_rows_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    monkeypatch.setenv(ROWS_VARIABLE, "1000000")
    file = tmp_path / "parameters.parquet"
    rows = pa.table({"value": pa.nulls(100_000, pa.float64())})
    with pq.ParquetWriter(file, rows.schema) as writer:
        for _ in range(11):
            writer.write_table(rows)
    assert file.stat().st_size < 10_000
    with pytest.raises(InputError, match="1,100,000 rows, more than the 1,000,000"):
        read_foreign_table(file, PARAMETERS, "Name another.")


def test_a_project_is_refused_before_a_huge_input_is_even_hashed(
    tmp_path: Path, write_project: Callable[..., Path]
) -> None:
    project = write_project(tmp_path)
    (tmp_path / "image_points.csv").unlink()
    special("sparse", tmp_path / "image_points.csv")
    with pytest.raises(InputError, match="100,000 MB, more than the 4,000 MB") as refused:
        load_project(project)
    assert refused.value.file == project
    assert refused.value.entity == "inputs.image_points.file"
    with pytest.raises(InputError, match="more than the 4,000 MB"):
        InputFile.of(tmp_path / "image_points.csv")
    (tmp_path / "image_points.csv").unlink()
    special("pipe", tmp_path / "image_points.csv")
    with pytest.raises(InputError, match="not an ordinary file"):
        load_project(project)


@pytest.mark.parametrize("kind", ["sparse", "pipe", "device"])
def test_the_grid_of_a_geoid_is_refused_alike(
    kind: str, tmp_path: Path, write_project: Callable[..., Path]
) -> None:
    project, grid = write_project(tmp_path), special(kind, tmp_path / "geoid.tif")
    project.write_text(
        project.read_text().replace('heights = "ellipsoidal"', f'heights = {{ geoid = "{grid}" }}')
    )
    with pytest.raises(InputError, match=r"not an ordinary file|more than the 4,000 MB"):
        load_project(project)


def test_a_file_that_grows_while_it_is_read_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "growing.csv"
    file.write_bytes(b"1\n")
    real = os.fstat

    def grown(handle: int) -> os.stat_result:
        status = real(handle)
        with file.open("ab") as more:
            more.write(b"2\n")
        return status

    monkeypatch.setattr(os, "fstat", grown)
    with pytest.raises(InputError, match="grows while it is being read"):
        read_delivered(file, "table")


def test_a_link_put_in_place_of_a_checked_file_is_not_followed(tmp_path: Path) -> None:
    inside, outside = tmp_path / "inside", tmp_path / "outside"
    for folder in (inside, outside):
        folder.mkdir()
        (folder / "exposures.csv").write_text("words")
    checked = (inside / "exposures.csv").resolve()
    assert read_delivered(checked, "table") == b"words"
    checked.unlink()
    checked.symlink_to(outside / "exposures.csv")
    with pytest.raises(InputError, match="contains a link"):
        read_delivered(checked, "table")
    checked.unlink()
    inside.rmdir()
    inside.symlink_to(outside)
    with pytest.raises(InputError, match="contains a link"), opened(checked, "table"):
        pass


def test_the_limits_come_from_the_environment_of_the_installation() -> None:
    assert file_limits({}) == FileLimits()
    given = {TABLE_VARIABLE: "9", DOCUMENT_VARIABLE: "2", ROWS_VARIABLE: " 5 "}
    assert file_limits(given) == FileLimits(9, 2, 5)
    for wrong in ("-1", "0", "many", "1e9", "²", "9" * 5_000):
        with pytest.raises(InstallationError, match=TABLE_VARIABLE):
            file_limits({TABLE_VARIABLE: wrong})


def test_a_limit_of_nonsense_is_told_as_one_of_the_installation(write_project, tmp_path: Path) -> None:
    project = write_project(tmp_path)
    done = aerocal("doctor", project, **{TABLE_VARIABLE: "lots"})
    assert done.returncode == 1, done.stderr
    assert f"{TABLE_VARIABLE} is 'lots'" in done.stderr
    assert "Traceback" not in done.stderr


def test_the_largest_block_there_is_stays_far_below_the_limits() -> None:
    # 50,000 images with 12 million image points, a generous 120 characters a row.
    assert FileLimits().table_mb * 1_000_000 > 12_000_000 * 120 * 2
    assert FileLimits().rows > 12_000_000 * 5


def test_a_calibration_of_results_is_limited_through_the_project_too(tmp_path: Path) -> None:
    for name in ("parameters", "correlations", "control_residuals", "control_points", "cameras"):
        special("sparse", tmp_path / f"{name}.parquet")
    with pytest.raises(ValueError, match="more than the 4,000 MB"):
        CalibrationInput.model_validate(str(tmp_path))


@pytest.mark.parametrize("folder", ["tasks/formats", "tasks/settings"])
def test_no_reader_opens_a_file_by_itself(folder: str) -> None:
    """A format that is added reads through `read_delivered`, and so has all of the above."""
    sources = sorted((REPOSITORY / folder).glob("*.py"))
    # These read presets and published tables that come along.
    ours = {
        "published_sweep.py",
        "load_simulation.py",
    }
    found = [
        f"{source.name}:{node.lineno}"
        for source in sources
        if source.name not in ours
        for node in ast.walk(ast.parse(source.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        and (
            (isinstance(node.func, ast.Attribute) and node.func.attr in ("open", "read_text", "read_bytes"))
            or (isinstance(node.func, ast.Name) and node.func.id == "open")
        )
    ]
    assert len(sources) > 5
    assert found == []


def test_key_and_content_are_of_the_same_bytes(tmp_path: Path) -> None:
    file = tmp_path / "points.csv"
    file.write_bytes(b"first")
    began = InputFile.of(file)
    with keyed_by({file: began.sha256}):
        assert read_delivered(file, "table") == b"first"
        file.write_bytes(b"other")
        # The key stays what it was, and nothing else is read under it.
        assert digest_for_key(file) == began.sha256
        with pytest.raises(InputError, match="changed while it was being read"):
            read_delivered(file, "table")
    assert digest_for_key(file) == digest_of_delivered(file) != began.sha256


@pytest.fixture
def unreadable(tmp_path: Path) -> Iterator[Path]:
    """A file that this process may not read, whoever carries out the tests."""
    file = tmp_path / "delivered.toml"
    file.write_text("1")
    file.chmod(0)
    root = os.geteuid() == 0
    if root:
        os.seteuid(65534)
    try:
        yield file
    finally:
        if root:
            os.seteuid(0)


@every_reader
def test_every_reader_refuses_a_file_it_may_not_read(
    reader: Callable[[Path], object], unreadable: Path
) -> None:
    with pytest.raises(InputError, match=r"cannot be read|There is no such|no preset"):
        reader(unreadable)


def test_a_stage_refuses_an_input_it_may_not_read(unreadable: Path) -> None:
    with pytest.raises(InputError, match=r"cannot be read|does not exist"):
        InputFile.of(unreadable)
    with pytest.raises(InputError, match="cannot be read"):
        digest_for_key(unreadable)


def test_a_project_file_of_21_kb_and_more_is_refused_at_once(tmp_path: Path) -> None:
    file = tmp_path / "project.toml"
    for text in ("[" + "] " * 10_000, "# " + "a" * 900_000, "a" * 900_000, "[" + " " * 900_000 + "x"):
        file.write_text(text)
        begun = time.process_time()
        with pytest.raises(InputError):
            load_project(file)
        assert time.process_time() - begun < 10.0
