"""What a registry takes is what its manifest, its certificate or a named code speaks of."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.registry.calibration_file import read_calibrations
from tasks.registry.registry import Signature
from tests.tasks.registry.records import record

REASONS = ("One height only.",)


def published(folder: Path, *, certificate: bool = True) -> Path:
    """A folder of results with the record of a calibration that was refused."""
    refused = record(verdict="refused", reasons=REASONS)
    (folder / "calibration.json").write_text(refused.text, encoding="utf-8")
    if certificate:
        (folder / "certificate.json").write_text(json.dumps({"code": refused.digest}))
    manifest(folder)
    return folder / "calibration.json"


def manifest(folder: Path) -> None:
    """manifest.json that speaks of the record as it is."""
    content = (folder / "calibration.json").read_bytes()
    entry = {"file": "calibration.json", "sha256": hashlib.sha256(content).hexdigest(), "rows": None}
    artifacts = {"calibration": {**entry, "stage": "calibration", "key": "0" * 64}}
    nothing: dict[str, object] = {name: {} for name in ("inputs", "settings", "versions", "times")}
    (folder / "manifest.json").write_text(
        json.dumps({"contract_version": 1, "artifacts": artifacts, "stages": [], **nothing})
    )


def edited(file: Path, **changes: object) -> None:
    file.write_text(json.dumps({**json.loads(file.read_text()), **changes}))


def test_a_folder_of_results_and_a_file_in_it_vouch_for_themselves(tmp_path: Path) -> None:
    file = published(tmp_path)
    for place in (tmp_path, file):
        (sealed,) = read_calibrations(place)
        assert sealed.record.verdict == "refused"
    (tmp_path / "certificate.json").unlink()
    assert read_calibrations(tmp_path)


def test_a_verdict_edited_in_the_folder_is_no_longer_what_was_published(tmp_path: Path) -> None:
    edited(published(tmp_path), verdict="accepted", reasons=[])
    with pytest.raises(InputError, match=r"not the file that was published: manifest.json has the digest"):
        read_calibrations(tmp_path)
    # With the manifest edited, too, the certificate still has the code.
    manifest(tmp_path)
    with pytest.raises(InputError, match="certificate next to it has the verification code"):
        read_calibrations(tmp_path)


def test_a_verdict_without_its_reasons_and_reasons_without_their_verdict_are_refused(tmp_path: Path) -> None:
    code = [record(verdict="refused", reasons=REASONS).digest]
    file = published(tmp_path)
    edited(file, verdict="accepted")
    with pytest.raises(InputError, match="the verdict is 'accepted', and its 1 reasons and 0 restrictions"):
        read_calibrations(file, code)
    parameters = json.loads(record().text)["parameters"]
    parameters[0]["verdict"] = "weak"
    edited(file, reasons=[], parameters=parameters)
    with pytest.raises(InputError, match="focal_length of UCE is weak, which refuses a calibration"):
        read_calibrations(file, code)


def test_a_key_given_twice_is_refused_whatever_its_values(tmp_path: Path) -> None:
    file = published(tmp_path)
    text = file.read_text().replace('"verdict": "refused"', '"verdict": "refused",\n"verdict": "refused"')
    file.write_text(text)
    with pytest.raises(InputError, match="the key 'verdict' exists twice"):
        read_calibrations(tmp_path)


@pytest.mark.parametrize(
    ("changes", "words"),
    [({"sigma0": "1.0"}, "sigma0"), ({"version": True}, "version"), ({"redundancy": True}, "redundancy")],
)
def test_a_text_is_no_number_and_true_is_no_version(
    tmp_path: Path, changes: dict[str, object], words: str
) -> None:
    edited(published(tmp_path), **changes)
    with pytest.raises(InputError, match=f"not a calibration: {words}"):
        read_calibrations(tmp_path)


def test_a_file_that_comes_alone_needs_the_code_of_its_certificate(tmp_path: Path) -> None:
    file = tmp_path / "calibration.json"
    file.write_text(record().text, encoding="utf-8")
    with pytest.raises(InputError, match="not in a results folder") as error:
        read_calibrations(file)
    assert "--code" in error.value.remedy
    digest = record().digest
    spoken = "-".join(digest[i : i + 4].upper() for i in range(0, 16, 4))
    for code in (digest, spoken, f"{spoken}…"):
        assert read_calibrations(file, ["f" * 64, code])[0].digest == digest
    with pytest.raises(InputError, match="has 8 digits"):
        read_calibrations(file, [digest[:8]])
    with pytest.raises(InputError, match="not one of those given"):
        read_calibrations(file, ["f" * 64])


@pytest.mark.parametrize("name", ["", "  ", "\t", "\u200b\u2003"])
def test_a_name_that_says_nothing_is_no_signature(name: str) -> None:
    with pytest.raises(InputError, match="The name of the person responsible is blank"):
        Signature(name)
