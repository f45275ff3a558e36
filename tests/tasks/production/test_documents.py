"""Documents of runs: shown as they were written, by a name of the manifest, and in no other way."""

from __future__ import annotations

import os
import shutil
import uuid
from pathlib import Path

import pytest

from tasks.files.json_text import read_json, replace_json
from tasks.production.documents import ChangedDocumentError, NoDocumentError, documents_of, read_document
from tasks.production.records import Records
from tasks.production.run_record import RunRecord, StageTime
from tasks.store.artifact import digest_of_file
from tests.tasks.production.runs import ended, run

REPORT = b"<!DOCTYPE html><title>report</title>"


@pytest.fixture
def records(tmp_path: Path) -> Records:
    return Records.at(str(tmp_path / "records.sqlite"))


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "root").mkdir()
    return (tmp_path / "root").resolve()


@pytest.fixture
def published(records: Records, root: Path) -> RunRecord:
    """A run whose folder has a report, a table and a file that no manifest names."""
    return publish(records, root / "block" / "results")


def publish(records: Records, folder: Path, hours: float = 0.0) -> RunRecord:
    write_results(folder, "0")
    done = (StageTime("report", 1.0, False, "0"),)
    return ended(records, run("block", hours, directory=str(folder)), done=done)


def write_results(folder: Path, key: str) -> None:
    """Results whose report is the output of a key."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "report.html").write_bytes(REPORT)
    (folder / "images.parquet").write_bytes(b"PAR1")
    (folder / "secret.html").write_bytes(b"not of the run")
    artifacts = {
        Path(name).stem: {
            "file": name,
            "sha256": digest_of_file(folder / name),
            "rows": None,
            "stage": "report",
            "key": key,
        }
        for name in ("report.html", "images.parquet")
    }
    manifest = {
        "contract_version": 1, "artifacts": artifacts, "stages": [], "inputs": {}, "settings": {},
        "versions": {}, "times": {},
    }  # fmt: skip
    replace_json(folder / "manifest.json", manifest)  # type: ignore[arg-type]


def test_a_document_is_shown_as_it_was_written(records: Records, published: RunRecord, root: Path) -> None:
    document = read_document(records, published.id, "report.html", (root,))
    assert (document.content, document.media_type) == (REPORT, "text/html")
    assert documents_of(published, (root,)) == ("report.html",)


def test_changed_bytes_are_refused(records: Records, published: RunRecord, root: Path) -> None:
    (Path(published.directory) / "report.html").write_bytes(REPORT + b" ")
    with pytest.raises(ChangedDocumentError, match="was changed after the run"):
        read_document(records, published.id, "report.html", (root,))


@pytest.mark.parametrize(
    "name",
    [
        "secret.html", "images.parquet", "manifest.json", "summary.json", "", ".", "..", "../report.html",
        "..%2freport.html", "/etc/passwd", "report.html/", "report.html\0", "Report.html", ".store",
        "results/report.html", "report.html'; DROP TABLE aerocal_runs; --",
    ],
)  # fmt: skip
def test_no_other_name_leads_anywhere(records: Records, published: RunRecord, root: Path, name: str) -> None:
    with pytest.raises(NoDocumentError, match="not written a document with this name"):
        read_document(records, published.id, name, (root,))


@pytest.mark.parametrize(
    "number", ["", "..", "%", "*", "' OR '1'='1", "x" * 36, "0" * 36, str(uuid.UUID(int=1)), "../../root"]
)
def test_no_other_number_is_a_run(records: Records, published: RunRecord, root: Path, number: str) -> None:
    assert published.id != number
    with pytest.raises(NoDocumentError, match="no run with this number"):
        read_document(records, number, "report.html", (root,))


def test_a_manifest_cannot_name_a_file_elsewhere(
    records: Records, published: RunRecord, root: Path, tmp_path: Path
) -> None:
    outside = tmp_path / "outside.html"
    outside.write_bytes(REPORT)
    file = Path(published.directory) / "manifest.json"
    for named in ("../../../outside.html", str(outside)):
        content = read_json(file)
        content["artifacts"]["report"]["file"] = named  # type: ignore[index, call-overload]
        replace_json(file, content)
        for asked in (named, "outside.html", "report.html"):
            with pytest.raises(NoDocumentError):
                read_document(records, published.id, asked, (root,))


def test_a_link_out_of_the_folders_is_not_followed(
    records: Records, published: RunRecord, root: Path, tmp_path: Path
) -> None:
    outside = tmp_path / "outside.html"
    outside.write_bytes(REPORT)
    report = Path(published.directory) / "report.html"
    report.unlink()
    report.symlink_to(outside)
    with pytest.raises(NoDocumentError, match="no longer where it was written"):
        read_document(records, published.id, "report.html", (root,))


def test_results_outside_the_folders_are_named_and_not_shown(records: Records, tmp_path: Path) -> None:
    elsewhere = publish(records, tmp_path / "elsewhere")
    (tmp_path / "root").mkdir()
    with pytest.raises(NoDocumentError, match="outside the folders that this server may read"):
        read_document(records, elsewhere.id, "report.html", (tmp_path / "root",))
    assert documents_of(elsewhere, (tmp_path / "root",)) == ()


def test_results_that_were_removed_are_not_said_to_be_elsewhere(
    records: Records, published: RunRecord, root: Path
) -> None:
    shutil.rmtree(published.directory)
    with pytest.raises(NoDocumentError, match="are no longer where they were"):
        read_document(records, published.id, "report.html", (root,))


def test_a_pipe_in_place_of_a_report_holds_nobody_up(
    records: Records, published: RunRecord, root: Path
) -> None:
    report = Path(published.directory) / "report.html"
    report.unlink()
    os.mkfifo(report)
    with pytest.raises(NoDocumentError, match="cannot be read"):
        read_document(records, published.id, "report.html", (root,))


def test_results_that_a_later_run_has_replaced_are_not_shown_as_its_own(
    records: Records, published: RunRecord, root: Path
) -> None:
    later = publish(records, Path(published.directory), hours=1)
    with pytest.raises(NoDocumentError, match="A later run has replaced"):
        read_document(records, published.id, "report.html", (root,))
    assert read_document(records, later.id, "report.html", (root,)).content == REPORT


def test_the_report_of_a_run_that_is_not_on_record_is_not_shown_as_that_of_another(
    records: Records, published: RunRecord, root: Path
) -> None:
    """Beside the figures of the run on record would be a report with others."""
    write_results(Path(published.directory), "1")
    assert documents_of(published, (root,)) == ()
    with pytest.raises(NoDocumentError, match="another run has replaced it"):
        read_document(records, published.id, "report.html", (root,))
    write_results(Path(published.directory), "0")
    assert read_document(records, published.id, "report.html", (root,)).content == REPORT


def test_a_run_without_results_has_no_documents(records: Records, published: RunRecord, root: Path) -> None:
    failed = ended(
        records, run("block", 1, directory=published.directory), "InputError", "exposures.csv is not there."
    )
    with pytest.raises(NoDocumentError, match=r"InputError.*exposures\.csv is not there"):
        read_document(records, failed.id, "report.html", (root,))
    assert read_document(records, published.id, "report.html", (root,)).content == REPORT
