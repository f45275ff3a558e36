"""SQL in names changes nothing in a registry: what is added comes back verbatim, and nothing is lost."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from flows.command.main import app
from tasks.database.address import DatabaseAddress
from tasks.errors import InputError
from tasks.registry.calibration_file import SealedRecord
from tasks.registry.choice import chosen_calibration
from tasks.registry.identity import CameraBody
from tasks.registry.registry import Registry, Signature
from tasks.registry.series import series_of
from tasks.settings.camera_identity import CameraIdentity
from tests.tasks.registry.records import add, approve, changed, record

SQL = (
    "'; DROP TABLE calibrations; --",
    '"; DROP TABLE calibrations; --',
    "' OR '1'='1",
    "1); DELETE FROM events; --",
    "x' UNION SELECT content FROM calibrations --",
    "%s %(name)s :name ? $1 {0}",
    "back\\slash \\' \\",
    "%",
    "_",
)
DAY = date(2024, 6, 1)


def hostile(text: str) -> CameraIdentity:
    return CameraIdentity(body=f"{text}", lens=f"L{text}", imu=f"I{text}", mount=f"M{text}")


@pytest.fixture
def filled(registry: Registry) -> Registry:
    """A calibration for each text, all of them approved, and an ordinary one."""
    add(registry, record())
    approve(registry, 1, date(2024, 3, 1))
    for number, text in enumerate(SQL, start=2):
        add(registry, record(name=text, identity=hostile(text)))
        approve(registry, number, date(2024, 3, 1))
    return registry


def test_every_name_comes_back_verbatim_and_nothing_is_lost(filled: Registry) -> None:
    found = filled.verified()
    assert not found.findings
    assert [item.record.camera.name for item in found.calibrations] == ["UCE", *SQL]
    assert [item.record.camera.identity for item in found.calibrations[1:]] == [hostile(t) for t in SQL]
    assert {item.state for item in found.calibrations} == {"approved"}


def test_a_calibration_is_chosen_by_such_a_name_and_by_no_other(filled: Registry) -> None:
    contents = filled.contents()
    for number, text in enumerate(SQL, start=2):
        camera = CameraBody.of_record(record(name=text, identity=hostile(text)).camera)
        assert chosen_calibration(contents, camera, DAY).id == number
        assert [item.id for item in contents.of_camera(text)] == [number]
        assert series_of(contents.of_camera(text))
        with pytest.raises(InputError):
            chosen_calibration(contents, replace(camera, identity=hostile(f"{text}'")), DAY)
    for text in ("1 OR 1=1", "1; DROP TABLE calibrations", "' OR ''='", "%", "*"):
        with pytest.raises(InputError):
            contents.calibration(text)


def test_who_signed_and_why_may_hold_sql_as_well(registry: Registry) -> None:
    for number, text in enumerate(SQL):
        registry.add(SealedRecord.of(record(changed(number))), Signature(text, text))
    found = registry.verified()
    assert not found.findings
    assert [item.events[0].person for item in found.calibrations] == list(SQL)


def command(address: DatabaseAddress, *arguments: str | Path) -> Result:
    where = address.url.render_as_string(hide_password=False) if not address.is_file else str(address.file)
    where = where.replace("+pg8000", "")
    return CliRunner().invoke(
        app, ["registry", *map(str, arguments)], env={"AEROCAL_REGISTRY": where, "COLUMNS": "300"}
    )


@pytest.mark.parametrize("text", SQL[:5])
def test_the_commands_take_such_names_from_adding_to_exporting(
    address: DatabaseAddress, text: str, tmp_path: Path
) -> None:
    file = tmp_path / "calibration.json"
    file.write_text(record(name=text, identity=hostile(text)).text, encoding="utf-8")
    code = SealedRecord.of(record(name=text, identity=hostile(text))).digest
    added = command(address, "add", file, "--by", text, "--note", text, "--code", code)
    assert added.exit_code == 0, added.stdout + added.stderr
    approved = command(address, "approve", "1", "--from", "2024-03-01", "--by", text, "--note", text)
    assert approved.exit_code == 0, approved.stdout + approved.stderr
    shown = command(address, "list", "--json")
    assert shown.exit_code == 0, shown.stdout + shown.stderr
    assert text in json.dumps(json.loads(shown.stdout), ensure_ascii=False).replace('\\"', '"')
    for arguments in (("show", "1"), ("show", text)):
        done = command(address, *arguments)
        assert done.exit_code == 0, done.stdout + done.stderr
    exported = command(address, "export", "1", "--out", tmp_path / "out.json")
    assert exported.exit_code == 0, exported.stdout + exported.stderr
    assert json.loads((tmp_path / "out.json").read_text(encoding="utf-8")) == json.loads(file.read_text())
    assert len(Registry.at(address).verified().calibrations) == 1
