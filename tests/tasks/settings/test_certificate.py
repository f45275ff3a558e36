"""Who calibrates and signs: what is refused, and that no stage but the certificate depends on it."""

from __future__ import annotations

import hashlib
from datetime import date
from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.settings.certificate import CertificateSettings, Signatory
from tasks.settings.load import load_project
from tasks.settings.project import Project
from tests.tasks.settings.test_load import PROJECT


def project(folder: Path, more: str, *overrides: str) -> Project:
    for name in ("a.csv", "b.csv", "e.csv"):
        (folder / name).write_text("")
    file = folder / "project.toml"
    text = PROJECT.replace("${DELIVERY}/", "").replace('name = "p"', 'name = "p"\nflown = 2026-09-14')
    file.write_text(f"{text}\n{more}")
    return load_project(file, overrides)


CERTIFICATE = """
[certificate]
numbers = { "CAM 1" = " 2026-017 " }
calibrated = 2026-09-21
issued = 2026-09-21
laboratory = { name = "Laboratory", address = ["Street 1", "Town"] }
[[certificate.signatories]]
name = "A. Example"
role = "Head"
"""


def test_what_is_given_is_read(tmp_path: Path) -> None:
    found = project(tmp_path, CERTIFICATE).certificate
    assert found.numbers == {"CAM 1": "2026-017"}
    assert (found.calibrated, found.issued) == (date(2026, 9, 21), date(2026, 9, 21))
    assert found.laboratory.address == ("Street 1", "Town")
    assert found.laboratory.accreditation is None
    assert found.signatories == (Signatory(name="A. Example", role="Head"),)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("calibrated = 2026-09-21", "calibrated = 2026-09-13", "lies before project.flown"),
        ("issued = 2026-09-21", "issued = 2026-09-20", "lies before certificate.calibrated"),
        ('"CAM 1" =', '"CAM 2" =', "the camera 'CAM 2', which the project does not have"),
        ("calibrated = 2026-09-21", "calibrated = 2026-09-31", "not valid TOML: Invalid date"),
        ("calibrated = 2026-09-21", 'calibrated = "soon"', "certificate.calibrated"),
        ('role = "Head"', 'role = " "', "certificate.signatories"),
        ('name = "Laboratory"', 'name = "La\\u0007b"', "invisible character"),
        ("[[certificate.signatories]]", "[[certificate.signatory]]", "signatories"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in CERTIFICATE
    with pytest.raises(InputError) as error:
        project(tmp_path, CERTIFICATE.replace(old, new))
    assert words in str(error.value)


def test_two_cameras_cannot_have_one_number() -> None:
    with pytest.raises(ValueError, match="Two certificates have the same number"):
        CertificateSettings(numbers={"A": "1", "B": "1"})


def test_only_the_certificate_depends_on_it(tmp_path: Path) -> None:
    """It is no part of the project's key, and has one of its own."""
    with_it, without = project(tmp_path, CERTIFICATE), project(tmp_path, "")
    assert with_it.key_content() == without.key_content()
    assert with_it.certificate.key_content() != without.certificate.key_content()


def test_a_project_knows_its_file_and_what_replaced_values_of_it_but_no_places(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    found = project(tmp_path, "", "gates.sigma0.max=1.4", f"inputs.exposures.file={file}")
    digest = hashlib.sha256((tmp_path / "project.toml").read_bytes()).hexdigest()
    assert found.source.sha256 == digest
    assert found.source.overrides == ("gates.sigma0.max=1.4", "inputs.exposures.file=…")
