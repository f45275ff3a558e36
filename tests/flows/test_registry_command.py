"""`aerocal registry` as its users meet it: from calibration.json to an approved calibration."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from datetime import date
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from flows.command.main import app
from tasks.settings.camera_identity import CameraIdentity
from tasks.settings.registry import registry_address
from tests.postgresql_server import PASSWORD, PostgresqlServer
from tests.tasks.documents.report.page_reader import Page
from tests.tasks.registry.records import Registry, add, approve, changed, record


class Console:
    """The command line with a registry of its own."""

    def __init__(self, registry: str) -> None:
        self.registry = registry

    def __call__(self, *arguments: str | Path, **environment: str) -> Result:
        variables = {"COLUMNS": "120", "AEROCAL_REGISTRY": self.registry, **environment}
        return CliRunner().invoke(app, ["registry", *map(str, arguments)], env=variables)


@pytest.fixture
def console(tmp_path: Path) -> Console:
    return Console(str(tmp_path / "data" / "registry.sqlite"))


@pytest.fixture(scope="module")
def four_calibrations(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a registry, to be copied."""
    file = tmp_path_factory.mktemp("filled") / "registry.sqlite"
    registry = Registry.at(registry_address(str(file)))
    head = CameraIdentity(body="UC-E-1", product="camera_head")
    refused = record(changed(85), verdict="refused", reasons=("One flying height only.",))
    for item in (record(), record(changed(1)), refused, record(name="H", identity=head)):
        add(registry, item)
    approve(registry, 1, date(2024, 3, 1))
    approve(registry, 2, date(2024, 9, 1))
    return file


@pytest.fixture
def filled(console: Console, four_calibrations: Path) -> Console:
    """A superseded calibration, an approved one, a refused draft, and a camera head of the same body."""
    Path(console.registry).parent.mkdir()
    shutil.copy(four_calibrations, console.registry)
    return console


def error(done: Result, code: int = 2) -> str:
    assert done.exit_code == code, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    errors = [line for line in done.stderr.splitlines() if line.startswith("Error: ")]
    assert len(errors) == 1, done.stderr
    return errors[0]


def test_from_the_results_of_a_calibration_to_an_approved_version(console: Console, tmp_path: Path) -> None:
    (tmp_path / "results").mkdir()
    for number in range(2):
        file = tmp_path / "results" / "calibration.json"
        file.write_text(record(changed(number)).text, encoding="utf-8")
        code = record(changed(number)).digest
        done = console("add", tmp_path / "results", "--by", "ann", "--note", "spring", "--code", code)
        assert done.exit_code == 0, done.stderr
        assert f"calibration {number + 1}, a draft: version {number + 1} of UCE (body UC-E-1)" in done.stdout
        assert record(changed(number)).digest in done.stdout
        done = console("approve", number + 1, "--from", f"2024-0{number + 5}-01", "--by", "ben")
        assert done.exit_code == 0, done.stderr
    assert "All 5 common parameters together agree" in done.stdout
    assert "Superseded: calibration 1 (UCE, version 1)" in done.stdout
    assert "It is valid for flights from 2024-05-01 to 2024-05-31 only" in done.stdout
    listed = json.loads(console("list", "--json").stdout)
    assert [(item["id"], item["state"], item["valid_to"]) for item in listed] == [
        (1, "superseded", "2024-05-31"),
        (2, "approved", None),
    ]
    assert [event["by"] for event in listed[0]["history"]] == ["ann", "ben", "ben"]
    assert listed[1]["record"] == json.loads(record(changed(1)).text)


def test_the_records_of_all_cameras_of_a_folder_are_added(console: Console, tmp_path: Path) -> None:
    codes = []
    for name in ("left", "right"):
        calibration = record(name=name, identity=CameraIdentity())
        (tmp_path / f"calibration_{name}.json").write_text(calibration.text, encoding="utf-8")
        codes += ["--code", calibration.digest[:16]]
    done = console("add", tmp_path, *codes)
    assert done.exit_code == 0, done.stderr
    assert "version 1 of left" in done.stdout
    assert "version 1 of right" in done.stdout
    assert "cameras.left.identity" in done.stdout


def test_what_is_exported_has_the_verification_code_and_can_be_added_elsewhere(
    filled: Console, tmp_path: Path
) -> None:
    digest = record(changed(1)).digest
    spoken = "-".join(digest[i : i + 4].upper() for i in range(0, 16, 4))
    exported = filled("export", spoken, "--out", tmp_path / "two.json")
    assert exported.exit_code == 0
    assert exported.stdout == f"Calibration {spoken} is in {tmp_path / 'two.json'}.\n"
    content = (tmp_path / "two.json").read_bytes()
    assert hashlib.sha256(content).hexdigest() == digest
    assert filled("export", "2").stdout_bytes == content
    other = Console(str(tmp_path / "other.sqlite"))
    assert digest in other("add", tmp_path / "two.json", "--code", spoken).stdout


def test_two_cameras_with_one_serial_number_are_told(console: Console, tmp_path: Path) -> None:
    registry = Registry.at(registry_address(console.registry))
    add(registry, record())
    for number, other in enumerate((record(changed(1)), record(changed(2), name="Second"))):
        file = tmp_path / f"{number}.json"
        file.write_text(other.text, encoding="utf-8")
        said = console("add", file, "--code", other.digest).stdout
        assert ("1, 2 are of the camera 'UCE'; 3 are of the camera 'Second'" in _joined(said)) == (
            number == 1
        )
    page = tmp_path / "page.html"
    for what in (
        ("list",),
        ("show", "3"),
        ("show", "UCE"),
        ("show", "UC-E-1", "--plot", page),
        ("approve", "3", *FROM),
    ):
        assert "All count as those of one camera (body UC-E-1)" in _joined(console(*what).stdout), what
    assert "All count as those of one camera (body UC-E-1)" in page.read_text()


def test_one_serial_number_with_two_images_is_told(console: Console) -> None:
    registry = Registry.at(registry_address(console.registry))
    camera = record().camera
    for number, columns in enumerate((13080, 14592)):
        of_image = camera.model_copy(update={"columns": columns})
        add(registry, record(changed(number), camera=of_image))
    said = _joined(console("list").stdout)
    assert "1 are of an image of 13080 × 20010 px" in said
    assert "2 are of an image of 14592 × 20010 px" in said
    assert "are of the camera" not in said


def test_a_validity_until_the_end_of_the_calendar_is_one_without_an_end(
    filled: Console, tmp_path: Path
) -> None:
    assert filled("approve", "4", "--from", "2024-01-01", "--to", "9999-12-31").exit_code == 0
    due = filled("due", "--max-age", "0", "--without", "UCE")
    assert due.exit_code == 0, due.output
    page = tmp_path / "page.html"
    assert filled("show", "4", "--plot", page).exit_code == 0
    band = re.search(r'<rect x="([\d.]+)"[^>]* width="([\d.]+)"[^>]*class="limits"', page.read_text())
    assert band is not None
    # It reaches the right edge of a drawing of years, not of millennia.
    assert float(band[1]) + float(band[2]) == pytest.approx(948.0)
    assert float(band[2]) > 400.0


@pytest.mark.parametrize("option", ["--max-age", "--within"])
def test_days_beyond_a_century_are_refused(filled: Console, option: str) -> None:
    assert filled("due", option, "999999999").exit_code == 2


def test_a_folder_in_the_place_of_a_file_is_wrong_input(filled: Console, tmp_path: Path) -> None:
    assert "--out: " in error(filled("export", "2", "--out", tmp_path))
    assert "--plot: " in error(filled("show", "2", "--plot", tmp_path))


def test_a_renamed_camera_is_excluded_by_either_name(console: Console) -> None:
    registry = Registry.at(registry_address(console.registry))
    add(registry, record())
    add(registry, record(changed(1), name="Later"))
    for name in ("UCE", "Later", "UC-E-1"):
        done = console("due", "--without", name)
        assert done.exit_code == 0, done.output


FROM = ("--from", "2025-01-01")


def _joined(text: str) -> str:
    return " ".join(text.split())


def test_list_and_show_say_what_there_is(filled: Console) -> None:
    listed = filled("list")
    assert listed.exit_code == 0, listed.stderr
    for words in ("UCE (body UC-E-1)", "IMU I-7", "superseded", "2024-03-01 – 2024-08-31", "draft, refused"):
        assert words in listed.stdout
    assert "c [mm] ± σ [µm]" in listed.stdout
    assert "79.9920 ± 1.2" in listed.stdout
    shown = filled("show", "3").stdout
    for words in ("One flying height only.", "boresight roll", "+6.0", "do not agree", "Against calibration"):
        assert words in shown, shown
    assert record(changed(85), verdict="refused", reasons=("One flying height only.",)).digest in shown
    camera = filled("show", "UCE").stdout
    assert "Parameters from one calibration to the next" in camera
    assert "+0.1 " in camera
    assert len(json.loads(filled("show", "UCE", "--json").stdout)) == 3


def test_show_speaks_of_flights_and_not_of_names_of_settings(console: Console) -> None:
    reason = "gnss_shift_y of 1 is not determined: no control."
    add(Registry.at(registry_address(console.registry)), record(verdict="refused", reasons=(reason,)))
    assert "GNSS shift y of flight 1 is not determined: no control." in _joined(console("show", "1").stdout)
    assert json.loads(console("show", "1", "--json").stdout)["record"]["reasons"] == [reason]


@pytest.mark.parametrize("what", [("list",), ("show", "2"), ("show", "3"), ("show", "UCE")])
def test_nothing_is_cut_in_80_characters_or_fewer(filled: Console, what: tuple[str, ...]) -> None:
    wide, narrow, narrower = (filled(*what, COLUMNS=str(width)).stdout for width in (200, 80, 40))
    assert narrower == narrow
    assert max(map(len, narrow.splitlines())) <= 96  # a verification code is one word
    # Words that were wrapped are still there, every number still in one piece.
    assert "…" not in narrow
    assert sorted(_numbers(narrow)) == sorted(_numbers(wide))


def _numbers(text: str) -> list[str]:
    return re.findall(r"(?<!\S)[+−-]?\d+\.\d+(?!\S)", text)


def test_the_plot_has_every_value_of_every_calibration(filled: Console, tmp_path: Path) -> None:
    done = filled("show", "UCE", "--plot", tmp_path / "plots" / "uce.html")
    assert done.exit_code == 0, done.stderr
    text = (tmp_path / "plots" / "uce.html").read_text(encoding="utf-8")
    page = Page(text)
    assert text.count("<svg") == 5
    assert text.count('class="calibration"') == 15
    assert text.count('class="limits"') == 10
    for number, values in ((1, changed(0)), (2, changed(1)), (3, changed(85))):
        cell = page.tables["values"].numbers[f"focal_length:{number}", "value"]
        assert float(cell.data) == values[0]


def test_a_refused_calibration_is_approved_with_a_reason_only(filled: Console) -> None:
    said = error(filled("approve", "3", "--from", "2025-01-01"))
    assert "One flying height only." in said
    assert "--although" in said
    done = filled("approve", "3", "--from", "2025-01-01", "--although", "no other flight", "--by", "cid")
    assert done.exit_code == 0, done.stderr
    assert "do not agree" in done.stdout
    assert "Focal length changed by" in done.stdout
    history = json.loads(filled("show", "3", "--json").stdout)["history"]
    assert history[-1]["although"] == "no other flight"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("show", "9"), "There is no calibration '9'"),
        (("show", "UC-E-2"), "Did you mean 'UC-E-1'?"),
        (("show", "UC-E-1"), ":camera_head"),
        (("approve", "2", "--from", "2025-01-01"), "approved already"),
        (("approve", "3", "--from", "2025-01-01", "--to", "2024-01-01"), "before it begins"),
        (("add", "nowhere"), "nowhere"),
        (("verify", "--since", "0123456789abcdef"), "not written by aerocal"),
        # Before, the first was as no state at all, and the second one of any event that begins with it.
        (("verify", "--since", ""), "--since: '' is not a state"),
        (("verify", "--since", "a"), "--since: 'a' is not a state"),
        (("list", "--registry", "mysql://u:secret@h/d"), "cannot be kept in 'mysql'"),
        (("list", "--registry", "postgresql://u:secret@h:port/d"), "is not valid"),
        (("list", "--registry", "postgresql://u:secret@h/d?x=1"), "'x' is not valid"),
        (("list", "--registry", "nowhere.sqlite"), "There is no registry at"),
    ],
)
def test_what_cannot_be_ends_with_2_and_one_sentence(
    filled: Console, arguments: tuple[str, ...], words: str
) -> None:
    done = filled(*arguments)
    assert words in error(done)
    assert "secret" not in done.stdout + done.stderr


def test_a_day_that_is_none_is_refused_with_the_way_to_write_it(filled: Console) -> None:
    for day in ("2025-13-01", "1.3.2025", "20250301"):
        done = filled("approve", "3", "--from", day)
        assert done.exit_code == 2
        assert f"'{day}' is no day. Write year-month-day" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--although", "  "), "The reason is blank"),
        (("--although", "\u200b"), "The reason is blank"),
        (("--although", "flown again", "--by", ""), "The name of the person responsible is blank"),
        (("--although", "flown again", "--by", " "), "The name of the person responsible is blank"),
    ],
)
def test_blank_reasons_and_names_approve_nothing(
    filled: Console, arguments: tuple[str, ...], words: str
) -> None:
    assert words in error(filled("approve", "3", "--from", "2025-01-01", *arguments))
    assert json.loads(filled("list", "--json").stdout)[2]["state"] == "draft"


@pytest.mark.parametrize(
    ("content", "words"),
    [("no JSON", "not JSON"), ('{"format": "x"}', "not a calibration"), ("[1, NaN]", "not JSON")],
)
def test_a_file_that_is_no_calibration_is_refused_with_its_name(
    console: Console, tmp_path: Path, content: str, words: str
) -> None:
    file = tmp_path / "calibration.json"
    file.write_text(content)
    said = error(console("add", tmp_path))
    assert words in said
    assert str(file) in said
    assert not Path(console.registry).exists()


def test_due_says_which_cameras_need_a_calibration_and_ends_like_a_gate(filled: Console) -> None:
    done = filled("due", "--max-age", "0")
    assert done.exit_code == 4, done.stderr
    for words in ("UCE (body UC-E-1), virtual image", "IMU I-7", "in force"):
        assert words in done.stdout
    assert "H (body UC-E-1), camera head: No approved calibration is in force. Calibration 4" in done.stdout
    # The refused draft takes no part; of the camera head there is a draft only.
    done = filled("due", "--max-age", "0", "--without", "H")
    assert done.exit_code == 0, done.stdout
    assert "No calibration is due" in done.stdout
    aged = json.loads(filled("due", "--max-age", "100", "--without", "H", "--json").stdout)
    assert [reason["kind"] for reason in aged["cameras"][0]["reasons"]] == ["too_old"]
    assert {one["parameter"] for one in aged["series"]} >= {"focal_length", "boresight_roll"}
    strict = filled("due", "--max-age", "0", "--without", "H", "--limit", "focal_length=0.1")
    assert strict.exit_code == 4
    assert "focal length +0.1 µm (σ 1.7 µm, limit 0.1 µm)" in strict.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--limit", "focal_lenght=3"), "Did you mean 'focal_length'?"),
        (("--limit", "focal_length=-3"), "has no positive number"),
        (("--limit", "boresight=nan"), "has no positive number"),
        (("--without", "UC-E-2"), "Did you mean 'UC-E-1'?"),
        (("--registry", "nowhere.sqlite"), "There is no registry at"),
    ],
)
def test_due_refuses_what_it_does_not_know(filled: Console, arguments: tuple[str, ...], words: str) -> None:
    assert words in error(filled("due", *arguments))


def test_an_edited_registry_is_named_and_not_used(filled: Console) -> None:
    sound = filled("verify")
    assert sound.exit_code == 0
    state = sound.stdout.split("State ")[1].split()[0]
    assert filled("verify", "--since", state).exit_code == 0
    with closing(sqlite3.connect(filled.registry)) as connection, connection:
        connection.execute(
            "UPDATE calibrations SET content = replace(content, '79.99', '79.98') WHERE id = 2"
        )
    done = filled("verify")
    assert "1 thing in the registry" in error(done)
    assert "Calibration 2 (UCE, version 2): its content has the digest" in done.stderr
    for arguments in (("show", "2"), ("export", "2"), ("approve", "3", "--from", "2025-01-01")):
        assert "The registry was edited: Calibration 2" in error(filled(*arguments))
    listed = filled("list")
    assert "Calibration 2" in listed.stderr
    assert error(listed)


def test_a_file_that_is_no_database_is_said_to_be_none(console: Console, tmp_path: Path) -> None:
    text = tmp_path / "notes.txt"
    text.write_text("no database " * 100)
    assert "not a SQLite database" in error(console("list", "--registry", text))
    other = tmp_path / "other.sqlite"
    with closing(sqlite3.connect(other)) as connection, connection:
        connection.execute("CREATE TABLE somebody (x)")
    calibration = tmp_path / "calibration.json"
    calibration.write_text(record().text)
    assert "belongs to another program" in error(
        console("add", calibration, "--registry", other, "--code", record().digest)
    )


def test_a_server_that_does_not_answer_ends_with_1_and_shows_no_password(console: Console) -> None:
    done = console("list", "--registry", "postgresql://u:secret@127.0.0.1:9/d")
    said = error(done, code=1)
    assert "postgresql://u:***@127.0.0.1:9/d cannot be reached" in said
    assert "secret" not in done.stdout + done.stderr


def test_help_teaches_and_comes_without_the_database(console: Console) -> None:
    done = console("--help")
    for word in ("add", "approve", "verify", "Exit codes", "AEROCAL_REGISTRY", "project.flown"):
        assert word in done.stdout
    # Nor does a run that asks no registry; and a list needs neither tables nor statistics.
    heavy = "{'pandas', 'scipy', 'pyproj', 'tasks.formats.register'}"
    loaded = f"import flows.command.registry_tables, sys; print({heavy} & {{*sys.modules}})"
    found = subprocess.run([sys.executable, "-c", loaded], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "set()"
    loaded = "import flows.command.main, flows.runs.project_run, sys; print('sqlalchemy' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", loaded], capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["False"]


@pytest.mark.service
def test_the_same_on_a_server(postgresql: PostgresqlServer, tmp_path: Path) -> None:
    url = postgresql.emptied()
    console = Console(url.replace(f":{PASSWORD}", ""))
    (tmp_path / "calibration.json").write_text(record().text)
    done = console("add", tmp_path, "--code", record().digest, PGPASSWORD=PASSWORD)
    assert done.exit_code == 0, done.stderr
    assert console("approve", "1", "--from", "2024-05-01", PGPASSWORD=PASSWORD).exit_code == 0
    assert "calibrations: 1, events: 2" in console("verify", PGPASSWORD=PASSWORD).stdout
    wrong = console("list", PGPASSWORD="wrong-one")
    assert "refuses this user or password" in error(wrong, code=1)
    missing = Console(postgresql.url("nowhere"))("list")
    assert "There is no database" in error(missing, code=1)
    plain = Console(f"{url}?sslmode=require")("list")
    assert "cannot be reached" in error(plain, code=1)
    for done in (wrong, missing, plain):
        assert PASSWORD not in done.stdout + done.stderr
        assert "wrong-one" not in done.stdout + done.stderr
